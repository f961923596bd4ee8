"""Pre-flight reasons word for word and at their limits."""

import datetime
from dataclasses import replace
from types import MappingProxyType

import pytest

from chute_ros.model import Armed, LinkState, ParachuteState, ParachuteStatus, VehicleState
from chute_ros.supervisor.config import PreflightLimits, SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkEvidence, LinkLimits
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.preflight import arm_reasons, block_reasons
from chute_ros.supervisor.state import HeardHere, State

NOW = 100.0
CONFIG = SupervisorConfig(required_links=("a",), kill_links=("a",), deploy_links=("a",))
READY = ParachuteStatus("1", LinkState.OK, ParachuteState.READY, packed_date="2026-06-01")


def day(text: str) -> int:
    """Days since 1970-01-01."""
    return (datetime.date.fromisoformat(text) - datetime.date(1970, 1, 1)).days


def link(
    *devices: ParachuteStatus, healthy: bool = True, state: LinkState = LinkState.OK
) -> LinkEvidence:
    told = MappingProxyType({one.device: one for one in devices})
    return LinkEvidence(NOW, state, healthy, devices=told)


def standing(vehicle_received: float = NOW, **links: LinkEvidence) -> State:
    return State(
        epoch=7,
        started_at=0.0,
        stage=Stage.READY,
        heard=HeardHere(
            links=MappingProxyType(links),
            vehicle=VehicleState(armed=Armed.DISARMED, armed_age=0.0),
            vehicle_received=vehicle_received,
        ),
    )


@pytest.mark.parametrize(
    ("faults", "deployed", "more"),
    [
        ((), False, ""),
        (("hot",), False, " (1 hot)"),
        (("hot", "wet"), True, " (1 hot; 1 wet; 1 is released)"),
    ],
)
def test_an_unhealthy_device_is_told_with_its_faults_if_it_has_any(
    faults: tuple[str, ...], deployed: bool, more: str
) -> None:
    device = replace(READY, faults=faults, deployed=deployed)
    state = standing(a=link(device, healthy=False))
    assert block_reasons(CONFIG, state, NOW) == (f"a: its device is not healthy{more}",)


@pytest.mark.parametrize(
    ("told", "words"),
    [
        (LinkState.NEVER_SEEN, "a: nothing received from its device"),
        (LinkState.LOST, "a: its device is LOST (1 hot)"),
    ],
)
def test_a_node_that_does_not_hear_its_device_is_told_of_by_the_device(
    told: LinkState, words: str
) -> None:
    state = standing(a=link(replace(READY, faults=("hot",)), state=told))
    assert block_reasons(CONFIG, state, NOW) == (words,)


def test_each_link_is_told_by_its_own_limits() -> None:
    patient = MappingProxyType({"a": LinkLimits(stale_after=2.0, lost_after=4.0)})
    config = replace(CONFIG, link_limits=patient)
    silent = standing(a=replace(link(), heard=NOW - 1.75))
    assert block_reasons(config, silent, NOW) == ()
    silent = standing(a=replace(link(), heard=NOW - 2.0))
    assert block_reasons(config, silent, NOW) == (
        "a: STALE, heartbeat of its node 2.00 s old (limit 2 s)",
    )


@pytest.mark.parametrize("stage", [Stage.KILLING, Stage.DEPLOYED, Stage.FAULT])
def test_after_a_kill_or_a_deploy_only_a_reset_unblocks(stage: Stage) -> None:
    state = replace(standing(a=link()), stage=stage)
    words = f"the vehicle is {stage.name}: needs a reset on the ground"
    assert block_reasons(CONFIG, state, NOW) == (words,)


def test_that_nobody_can_stop_the_motors_does_not_hide_a_required_link() -> None:
    config = SupervisorConfig(required_links=("a",), kill_links=("b",), deploy_links=("c",))
    assert block_reasons(config, standing(c=link()), NOW) == (
        "a: nothing received from its node",
        "b: nothing received from its node",
    )
    assert block_reasons(config, standing(a=link(), b=link(), c=link()), NOW) == ()


def test_a_vehicle_that_never_told_of_its_motors_blocks_flight() -> None:
    state = replace(
        standing(a=link()), heard=replace(standing(a=link()).heard, vehicle=VehicleState())
    )
    assert block_reasons(CONFIG, state, NOW) == (
        "vehicle/state: armed or disarmed was never reported",
    )


@pytest.mark.parametrize(
    ("age", "told"),
    [(2.5, ()), (2.75, ("vehicle/state: armed or not is 2.8 s old (limit 2.5 s)",))],
)
def test_what_the_vehicle_says_of_its_motors_counts_up_to_its_age(
    age: float, told: tuple[str, ...]
) -> None:
    assert block_reasons(CONFIG, standing(NOW - age, a=link()), NOW) == told


@pytest.mark.parametrize(
    ("today", "told"),
    [
        ("2023-12-31", ("the wall clock shows 2023-12-31 (need 2024-01-01 or later)",)),
        ("2024-01-01", ()),
    ],
)
def test_a_wall_clock_may_say_the_first_day_and_none_before(
    today: str, told: tuple[str, ...]
) -> None:
    assert arm_reasons(CONFIG, standing(a=link()), day(today), NOW) == told


def test_a_wall_clock_that_was_never_set_makes_a_pack_look_like_one_from_the_future() -> None:
    assert arm_reasons(CONFIG, standing(a=link(READY)), 0, NOW) == (
        "the wall clock shows 1970-01-01 (need 2024-01-01 or later)",
        "a 1: packed on 2026-06-01, 20605 days from now",
    )


def test_a_pack_may_be_allowed_a_single_day() -> None:
    config = replace(CONFIG, preflight=PreflightLimits(max_pack_age=1))
    state = standing(a=link(READY))
    assert arm_reasons(config, state, day("2026-06-02"), NOW) == ()
    assert arm_reasons(config, state, day("2026-06-03"), NOW) == (
        "a 1: packed on 2026-06-01, 2 days ago (limit 1)",
    )
