"""Flights whose autopilot decides by itself, as peers of this product do."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from campaign_bench import FOLDER, SHIPPED, correct, flown, rocket, scenario

from chute_ros.campaign import comparison
from chute_ros.campaign.channel import Spell
from chute_ros.campaign.comparison import bare_count, comparable, compare, fault_of
from chute_ros.campaign.draw import draw
from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.flight import Flight, Flown, fly
from chute_ros.campaign.guards import GUARDS, ScaledShipped
from chute_ros.campaign.judge import Count, judge
from chute_ros.campaign.manoeuvre import Manoeuvre
from chute_ros.campaign.peer_rig import MakePeer
from chute_ros.campaign.peers.arducopter import ArduCopter
from chute_ros.campaign.peers.px4 import Px4
from chute_ros.campaign.peers.threshold import Threshold
from chute_ros.campaign.scenario import (
    ClockJump,
    Failure,
    Fault,
    HomeMove,
    Person,
    Stalls,
    Stop,
    WayFault,
)
from chute_ros.campaign.sensors import SensorFault
from chute_ros.model import Action
from chute_ros.protocol.vehicle_merge import IMU, VEHICLE_STATE

PEERS = (ArduCopter, Px4, Threshold)


def with_peer(peer: MakePeer, failure: Failure, *faults: Fault, **more: object) -> Flown:
    """The flight of the bench, decided by this peer."""
    return fly(scenario(failure, *faults, **more), SHIPPED, peer)


@pytest.mark.parametrize(
    ("peer", "rule", "kill_to_deploy"),
    [
        (ArduCopter, "loss of control", 0.5),
        (Px4, "failure detector", 0.02),
        (Threshold, "threshold", 0.5),
    ],
)
def test_a_motor_failure_at_60_m_is_released_by_each(
    peer: MakePeer, rule: str, kill_to_deploy: float
) -> None:
    end = correct(with_peer(peer, Failure.MOTOR))
    assert bare_count(end) is Count.CORRECT
    kill, deploy = end.acted
    assert (kill.decision.action, deploy.decision.action) == (Action.KILL, Action.DEPLOY)
    assert {kill.decision.rule, deploy.decision.rule} == {rule}
    assert deploy.at - kill.at == pytest.approx(kill_to_deploy, abs=1e-3)
    assert end.truth.at < end.released == deploy.at < end.truth.latest


@pytest.mark.parametrize("peer", PEERS)
def test_what_flies_well_is_left_alone_by_each(peer: MakePeer) -> None:
    end = correct(with_peer(peer, Failure.NOTHING, gusts=1.0))
    assert not end.acted


@pytest.mark.parametrize("peer", PEERS)
@pytest.mark.parametrize("failure", [Failure.POWER, Failure.REBOOT])
def test_a_peer_is_dead_or_disarmed_with_its_autopilot(peer: MakePeer, failure: Failure) -> None:
    end = with_peer(peer, failure)
    assert not end.acted
    assert end.truth.falls
    assert bare_count(end) is Count.MISSED
    # The campaign excuses whoever nothing tells of the vehicle.
    excused = failure is Failure.POWER
    assert judge(end).count is (Count.NOT_TOLD if excused else Count.MISSED)


def test_an_autopilot_that_hangs_between_kill_and_release_releases_late() -> None:
    """Given a motor that fails, the motors are off at about t+2.4 s; it hangs for 6 s then."""
    killed = with_peer(ArduCopter, Failure.MOTOR, height=250.0).killed
    flight = scenario(Failure.MOTOR, height=250.0)
    one = Flight(flight, SHIPPED, ArduCopter)
    plug = one.rig.plugs["autopilot"]
    one.rig.world.post(killed + 0.1, lambda now: setattr(plug, "dead_until", now + 6.0))
    end = one.run()
    assert end.killed == pytest.approx(killed)
    assert end.released == pytest.approx(killed + 6.1, abs=0.05)


@pytest.mark.parametrize("peer", [Px4, Threshold])
def test_an_estimator_that_leans_moves_a_peer(peer: MakePeer) -> None:
    end = with_peer(peer, Failure.NOTHING, EstimatorFault("leans", 1.0, 8.0, 0.8))
    assert judge(end).count is Count.FALSE
    assert "tilt_deg" in judge(end).why


def test_an_attitude_that_lies_crashes_arducopter_or_makes_it_lose_control() -> None:
    end = with_peer(ArduCopter, Failure.NOTHING, SensorFault("tilt", "jumps", 1.0, 4.0))
    assert judge(end).count is Count.FALSE
    assert "attitude_error" in judge(end).why


def test_a_sensor_that_lies_moves_a_peer() -> None:
    end = with_peer(Px4, Failure.NOTHING, SensorFault("tilt", "jumps", 1.0, 3.0))
    assert judge(end).count is Count.FALSE
    assert end.killed == pytest.approx(end.up + 1.3, abs=0.05)


def test_a_sensor_that_lies_of_a_second_source_moves_no_peer() -> None:
    lies = SensorFault("tilt", "jumps", 1.0, 3.0, IMU)
    sources = (IMU, VEHICLE_STATE)
    assert not with_peer(Px4, Failure.NOTHING, lies, vehicle_sources=sources).acted


def test_a_land_detector_that_lies_blinds_arducopter() -> None:
    lies = SensorFault("landed", "lies", 0.5, 20.0)
    assert bare_count(with_peer(ArduCopter, Failure.MOTOR, lies)) is Count.MISSED


def test_what_a_peer_has_not_does_not_fail_it() -> None:
    """Networks, nodes and the supervisor's process are this product's."""
    harmless = (
        WayFault("mavlink_parachute", Spell(0.0, 9.0, loss=1.0)),
        Stop("supervisor", 0.9, 3.0, dies=True),
        Stop("parachute", 0.9, 3.0),
        Stalls("standby", 0.0, 6.0, 0.5),
        ClockJump("mavlink_parachute", 0.9, 3600.0),
    )
    alone, among = with_peer(Px4, Failure.MOTOR), with_peer(Px4, Failure.MOTOR, *harmless)
    assert alone.released == among.released


def test_a_flip_that_is_flown_in_acro_terminates_nothing() -> None:
    """At 360 degrees a second it is upside down for half a second."""
    flips = Manoeuvre("flip", 360.0, 1.0)
    for peer in (ArduCopter, Px4):
        correct(with_peer(peer, Failure.NOTHING, manoeuvre=flips))


def test_home_that_moves_up_makes_a_peer_take_itself_to_be_low() -> None:
    moved = HomeMove(0.8, 58.0)
    assert bare_count(with_peer(ArduCopter, Failure.MOTOR, moved)) is Count.MISSED
    # PX4 asks for no height.
    assert bare_count(with_peer(Px4, Failure.MOTOR, moved)) is Count.CORRECT


# -- the comparison ------------------------------------------------------------------------------


def test_the_flights_have_nothing_that_only_we_are_asked_for() -> None:
    assert comparable(rocket(Failure.NOTHING)) is None
    drawn = scenario(Failure.MOTOR, arms=True, aps=True, person=Person("kill", 1.0))
    one = comparable(drawn)
    assert one == scenario(Failure.MOTOR)


def test_without_excuses_what_was_excused_is_missed() -> None:
    cut = WayFault("autopilot", Spell(0.9, 20.0, loss=1.0))
    end = flown(Failure.MOTOR, cut)
    assert judge(end).count is Count.NOT_TOLD
    assert bare_count(end) is Count.MISSED
    low = with_peer(ArduCopter, Failure.MOTOR, height=16.0)
    assert low.truth.leeway > 0.0
    assert judge(low).count is Count.NO_TIME
    assert bare_count(low) is Count.LATE
    # What no release saves is nobody's fault.
    doomed = replace(low, truth=replace(low.truth, latest=math.nan))
    assert bare_count(doomed) is Count.NO_TIME


@pytest.mark.parametrize(
    ("faults", "kind"),
    [
        ((), "none"),
        ((HomeMove(1.0, 5.0),), "home"),
        ((HomeMove(1.0, 5.0), Stop("supervisor", 1.0, 1.0)), "ways and processes"),
        ((Stop("supervisor", 1.0, 1.0), SensorFault("tilt", "gone", 1.0, 2.0)), "sensor"),
        ((SensorFault("tilt", "gone", 1.0, 2.0, "imu"),), "second source"),
        ((SensorFault("tilt", "gone", 1.0, 2.0), EstimatorFault("hovers", 1.0, 2.0)), "estimator"),
    ],
)
def test_the_kind_of_several_faults_is_the_gravest(faults: tuple, kind: str) -> None:
    assert fault_of(scenario(Failure.MOTOR, *faults)) == kind


def test_each_guard_flies_each_flight_and_one_of_eight_with_scaled_limits() -> None:
    seeds = [next(n for n in range(k, 99, 8) if comparable(draw(n))) for k in (0, 1)]
    scaled, plain = compare(FOLDER, seeds)
    names = [one.name for one in GUARDS]
    assert [one.guard for one in plain] == names
    assert [one.factor for one in plain] == [1.0] * len(names)
    assert {(one.guard, one.factor) for one in scaled} == {
        (name, factor) for name in names for factor in comparison.FACTORS
    }
    assert repr(compare(FOLDER, [seeds[1]])) == repr([plain]), "the same for the same seed"


def test_a_guard_that_raises_breaks_its_flight_and_no_other(monkeypatch) -> None:
    def breaks(*_: object) -> None:
        raise ValueError("the rig fell apart")

    monkeypatch.setattr(comparison, "fly", breaks)
    seed = next(n for n in range(1, 8) if comparable(draw(n)))
    (flight,) = compare(FOLDER, [seed])
    assert {one.count for one in flight} == {Count.BROKEN}
    assert flight[0].why == "ValueError: the rig fell apart"


def test_our_hold_times_are_scaled_and_nothing_else(tmp_path: Path) -> None:
    key = ("mavlink", "multirotor", False, 0)
    plain, slow = SHIPPED.config(*key), ScaledShipped(FOLDER, 2.0).config(*key)
    pairs = list(zip(plain.profile.rules, slow.profile.rules, strict=True))
    assert any(one.hold > 0.0 for one, _ in pairs)
    assert all(other.hold == 2.0 * one.hold for one, other in pairs)
    assert all(one.conditions == other.conditions for one, other in pairs)
    assert (plain.links, plain.profile.limits) == (slow.links, slow.profile.limits)
