"""Conditions word for word and at their limits."""

import math
from types import MappingProxyType
from typing import Any

import pytest
from story import changed
from told import Told, told

from chute_ros.model import LinkState, ParachuteState, ParachuteStatus, VehicleState
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.conditions.link import LinkCondition
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkEvidence, LinkJudgement, LinkLimits
from chute_ros.supervisor.measured import Measured
from chute_ros.supervisor.pending import ASK_LASTS, Ask
from chute_ros.supervisor.profile_lines import ALL, ANY
from chute_ros.supervisor.rules import Profile
from chute_ros.supervisor.state import HeardHere, State

LINKS = ("a", "b")
PATIENT = LinkLimits(stale_after=50.0, lost_after=100.0)
CONFIG = SupervisorConfig(required_links=LINKS, kill_links=LINKS, deploy_links=LINKS)
NOW = 100.0
SILENT = (LinkJudgement.STALE, LinkJudgement.LOST)


def state(**known: Any) -> State:
    return changed(State(epoch=7, started_at=0.0), **known)


def links(**evidence: LinkEvidence) -> MappingProxyType[str, LinkEvidence]:
    return MappingProxyType(evidence)


def heard(ago: float, *devices: ParachuteStatus) -> LinkEvidence:
    told = MappingProxyType({one.device: one for one in devices})
    return LinkEvidence(heard=NOW - ago, reported=LinkState.OK, devices=told)


def test_samples_that_cannot_be_used_were_seen_all_the_same() -> None:
    old = Measured(value=70.0, measured_at=NOW - 9.0, same_since=NOW - 9.0, count=4)
    known = state(measurements=MappingProxyType({"tilt_deg": old}))
    found = told(CONFIG, known, MeasurementCondition("tilt_deg", above=60.0), NOW)
    assert (found.holds, found.samples) == (None, 4)


def test_every_link_is_told_with_what_was_asked_for() -> None:
    known = state(links=links(a=heard(0.2), b=heard(5.0)))
    text = "link a is OK, heard 0.20 s ago, b is LOST, heard 5.00 s ago (asked for: STALE or LOST)"
    assert told(CONFIG, known, LinkCondition(ANY, SILENT), NOW) == Told(True, text)
    assert told(CONFIG, known, LinkCondition(ALL, SILENT), NOW) == Told(False, text)


def test_each_link_is_judged_by_its_own_limits() -> None:
    config = SupervisorConfig(required_links=LINKS, link_limits=MappingProxyType({"b": PATIENT}))
    known = state(links=links(a=heard(0.2), b=heard(5.0)))
    assert told(config, known, LinkCondition(ANY, SILENT), NOW).holds is False


def test_one_that_is_still_starting_does_not_hide_the_next() -> None:
    known = State(epoch=7, started_at=NOW - 1.0, heard=HeardHere(links=links(b=heard(5.0))))
    found = told(CONFIG, known, LinkCondition(ANY, SILENT), NOW)
    assert found.holds is True
    assert found.text.startswith("link a is still starting, b is LOST")


@pytest.mark.parametrize(("age", "holds"), [(2.5, True), (2.6, None)])
def test_what_the_autopilot_says_of_itself_counts_up_to_its_age(
    age: float, holds: bool | None
) -> None:
    known = state(vehicle=VehicleState(system_status=8), vehicle_received=NOW - age)
    found = told(CONFIG, known, AutopilotCondition(AutopilotFact.EMERGENCY), NOW)
    assert found.holds is holds
    if holds is None:
        assert found.text == "autopilot's own state is old"


def test_one_that_is_being_switched_off_is_no_emergency() -> None:
    known = state(vehicle=VehicleState(system_status=7), vehicle_received=NOW)
    found = told(CONFIG, known, AutopilotCondition(AutopilotFact.EMERGENCY), NOW)
    assert found == Told(False, "autopilot's own state is 7 (6 or 8)")


def test_a_wish_for_a_kill_ends_at_its_time_and_all_are_told() -> None:
    asks = {"a 1": Ask(NOW, "a", "fire"), "b 2": Ask(NOW, "b", "smoke")}
    known, wants = state(asks=MappingProxyType(asks)), DeviceCondition(DeviceFact.ASKS_FOR_KILL)
    assert told(CONFIG, known, wants, NOW) == Told(True, "a 1: fire; b 2: smoke")
    ended = told(CONFIG, known, wants, NOW + ASK_LASTS)
    assert ended == Told(False, "no device asks for a kill")


def test_all_that_are_out_are_told() -> None:
    out = [ParachuteStatus(name, LinkState.OK, deployed=True) for name in ("1", "2")]
    known = state(links=links(a=heard(0.1, *out)))
    found = told(CONFIG, known, DeviceCondition(DeviceFact.DEPLOYED), NOW)
    assert found == Told(True, "a 1, a 2: its own status says deployed")


def test_all_that_are_abnormal_are_told_each_within_the_limits_of_its_link() -> None:
    wrong = [
        ParachuteStatus("1", LinkState.OK, ParachuteState.ABNORMAL, faults=("hot",)),
        ParachuteStatus("2", LinkState.OK, ParachuteState.ABNORMAL),
    ]
    known = state(links=links(a=heard(5.0, *wrong)))
    config = SupervisorConfig(required_links=LINKS, link_limits=MappingProxyType({"a": PATIENT}))
    abnormal = DeviceCondition(DeviceFact.ABNORMAL)
    text = "a 1 is ABNORMAL (hot); a 2 is ABNORMAL (no reason given)"
    assert told(config, known, abnormal, NOW) == Told(True, text)
    assert told(CONFIG, known, abnormal, NOW) == Told(False, "no device is ABNORMAL")


def test_a_speed_that_is_told_by_the_heights_has_their_samples() -> None:
    height = Measured(value=30.0, measured_at=NOW, same_since=NOW, count=7)
    known = state(
        measurements=MappingProxyType({"height": height}),
        heights=((NOW - 1.0, 50.0), (NOW, 30.0)),
    )
    found = told(CONFIG, known, MeasurementCondition("vertical_speed", below=-12.0), NOW)
    assert (found.holds, found.samples) == (True, 7)


@pytest.mark.parametrize(
    ("minimum", "speed", "holds", "words"),
    [
        (50.0, math.nan, True, "(minimum 50 m), and nothing tells whether it falls"),
        (50.1, math.nan, False, "(minimum 50.1 m), and nothing tells whether it falls"),
        (50.0, -4.0, False, "(minimum 50 m), and something tells whether it falls"),
    ],
)
def test_a_kill_aloft_is_told_with_what_is_left_of_the_height(
    minimum: float, speed: float, holds: bool, words: str
) -> None:
    config = SupervisorConfig(profile=Profile("tested", (), minimum_height=minimum))
    told_speed = {} if math.isnan(speed) else {"vertical_speed": Measured(speed, NOW, NOW, 1)}
    known = state(
        killed_in_flight=True,
        killed_at=NOW - 2.0,
        # What a body loses in 2 s.
        killed_height=50.0 + 9.81 / 2.0 * 4.0,
        killed_sinking=0.0,
        vehicle_received=NOW - 1.0,
        measurements=MappingProxyType(told_speed),
        links=MappingProxyType({one: LinkEvidence(heard=NOW) for one in config.kill_links}),
    )
    found = told(config, known, AutopilotCondition(AutopilotFact.KILLED_ALOFT), NOW)
    assert found == Told(holds, f"killed aloft 2.00 s ago, at least 50.0 m are left {words}")
