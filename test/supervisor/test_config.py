"""Settings that contradict themselves stop the start; a vehicle's place without a landed state."""

from typing import Any

import pytest
from story import LINK, START, Story

from chute_ros.errors import ParameterError
from chute_ros.model import Action, Armed, VehicleState
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.sending import fire
from chute_ros.supervisor.turn import Turn


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"kill_to_deploy_delay": 61.0}, "kill_to_deploy_delay is 61.0"),
        (
            {"deploy_timeout": 0.0},
            "^parameter deploy_timeout is 0.0: need a number .* from 0.1 to 60 s",
        ),
        ({"resend_interval": float("nan")}, "resend_interval is nan"),
        ({"required_links": ()}, "required_links is \\[\\]: need at least one"),
        ({"deploy_links": ("",)}, "deploy_links is \\[''\\]"),
    ],
)
def test_a_wrong_setting_names_itself_and_what_is_allowed(
    settings: dict[str, Any], words: str
) -> None:
    with pytest.raises(ParameterError, match=words):
        SupervisorConfig(**settings)


def test_every_link_is_followed_once() -> None:
    config = SupervisorConfig(("a",), ("b", "a"), ("c", "b"))
    assert config.links == ("a", "b", "c")


@pytest.mark.parametrize(
    ("armed", "height", "in_air"),
    [
        (Armed.ARMED, 2.1, True),
        (Armed.ARMED, 1.9, False),
        (Armed.DISARMED, 50.0, False),
        (Armed.UNKNOWN, 50.0, None),
    ],
)
def test_without_a_landed_state_armed_and_high_is_in_the_air(
    armed: Armed, height: float, in_air: bool | None
) -> None:
    vehicle = VehicleState(armed=armed, armed_age=0.0, height=height, height_age=0.1)
    story = Story()
    story.at(0.0, i.VehicleReport(vehicle))
    assert flight.in_air(story.config, story.state, START + 0.1) is in_air


def test_an_unknown_height_says_nothing() -> None:
    vehicle = VehicleState(armed=Armed.ARMED, armed_age=0.0)
    story = Story()
    story.at(0.0, i.VehicleReport(vehicle))
    assert flight.in_air(story.config, story.state, START) is None


def test_a_deploy_does_not_leave_before_its_kill_whoever_asks() -> None:
    story = Story().flying()
    turn = Turn(story.config, story.state, START)
    fire(turn, Action.DEPLOY, "mistake", ())
    assert turn.outputs == []


def test_nothing_fires_in_another_mode() -> None:
    story = Story(mode=i.Mode.INHIBITED).flying()
    turn = Turn(story.config, story.state, START)
    fire(turn, Action.KILL, "mistake", ())
    assert turn.outputs == []
    assert LINK in story.config.kill_links
