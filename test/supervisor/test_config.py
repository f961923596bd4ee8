"""Settings at their very limits, and what is said past them, in full."""

from typing import Any

import pytest

from chute_ros.errors import ParameterError
from chute_ros.supervisor.config import TRIGGER, Rung, SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkLimits

#: With the smallest that is allowed.
TIMES = {
    "deploy_timeout": 0.1,
    "kill_timeout": 0.1,
    "resend_interval": 0.02,
    "vehicle_state_age": 0.1,
    "ladder_step_timeout": 0.1,
    "alarm_interval": 0.1,
    "late_after": 0.02,
}


def refusal(**settings: Any) -> str:
    with pytest.raises(ParameterError) as caught:
        SupervisorConfig(**settings)
    return str(caught.value)


@pytest.mark.parametrize(
    ("name", "least"),
    [*TIMES.items(), ("kill_to_deploy_delay", 0.0), ("low_kill_to_deploy_delay", 0.0)],
)
def test_every_time_may_reach_its_limits_and_is_told_past_them_in_full(name, least):
    for good in (least, 60.0):
        assert getattr(SupervisorConfig(**{name: good}), name) == good
    for wrong in (least - 0.001, -0.1, 60.1, float("nan"), *([0.0] if least else [])):
        need = f"need a number (1.0, not 1) from {least:g} to 60 s ("
        assert refusal(**{name: wrong}).startswith(f"parameter {name} is {wrong}: {need}")


@pytest.mark.parametrize("name", ["required_links", "kill_links", "deploy_links"])
def test_no_list_of_links_is_empty_or_has_an_empty_name(name):
    assert refusal(**{name: ()}) == f"parameter {name} is []: need at least one link's name"
    said = f"parameter {name} is ['a', '']: need at least one link's name"
    assert refusal(**{name: ("a", "")}) == said


def test_a_step_of_the_ladder_on_another_link_is_told_with_those_that_may_be():
    said = "parameter deploy_ladder names c:1/162: need a link of deploy_links (a, b)"
    assert refusal(deploy_links=("a", "b"), deploy_ladder=(Rung("a"), Rung("c", "1/162"))) == said


def test_without_a_ladder_every_link_that_deploys_is_a_step():
    config = SupervisorConfig(deploy_links=("a", "b"))
    assert config.ladder == (Rung("a"), Rung("b"))
    steps = (Rung("b", TRIGGER), Rung("a"))
    assert SupervisorConfig(deploy_links=("a", "b"), deploy_ladder=steps).ladder == steps


def test_a_step_is_written_as_it_is_read():
    for text in ("upf_can", "upf_can:trigger", "mavlink_parachute:1/162"):
        assert str(Rung.parse(text)) == text
    assert Rung.parse("upf_can:trigger") == Rung("upf_can", TRIGGER)
    assert Rung.parse("mavlink_parachute:1/162") == Rung("mavlink_parachute", "1/162")
    for wrong in ("", ":", ":33", "upf_can:"):
        with pytest.raises(ParameterError) as caught:
            Rung.parse(wrong)
        assert str(caught.value) == (
            f"parameter deploy_ladder has {wrong!r}: need LINK or LINK:DEVICE, for example "
            "mavlink_parachute, mavlink_parachute:1/162, upf_can:trigger"
        )


def test_every_link_is_followed_once():
    config = SupervisorConfig(("a",), ("b", "a"), ("c", "b"))
    assert config.links == ("a", "b", "c")


def test_a_link_has_its_own_limits_or_the_standard_ones():
    slow = LinkLimits(2.0, 4.0)
    config = SupervisorConfig(("a", "b"), link_limits={"a": slow})
    assert config.limits("a") == slow
    assert config.limits("b") == LinkLimits()
