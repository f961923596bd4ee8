"""Two vehicles, or two parachutes, with the same ids: one clear error, and nothing mixed up."""

import pytest
from autopilot_bench import attitude, position
from link_bench import ASLEEP, Bench, copter, heartbeat, landed, status

from chute_ros.model import Armed

PILOT, CHUTE = (1, 1), (1, 161)


def autopilots(bench, seconds, *booted):
    """As many autopilots as boot times (s before 0), each at another height, say ten times a
    second where they are; the heartbeat of the second one says that it is armed."""
    for step in range(round(seconds * 10)):
        for number, before in enumerate(booted):
            bench.at(bench.t + 0.1 / len(booted) + number * 0.001)
            ms = round((bench.t + before) * 1000)
            bench.hear(PILOT, attitude(ms), position(ms, relative=number * 50_000))
            if step % 10 == 0:
                bench.hear(PILOT, copter(armed=number == 1), landed(1 + number))
    return bench


def restarts(bench):
    return [text for text in bench.notices() if "restarted" in text]


def test_one_alone_is_in_no_doubt_nor_is_a_restart_or_one_that_was_switched_off():
    # One autopilot is in no doubt.
    bench = autopilots(Bench(**ASLEEP).hear(PILOT, copter()), 20.0, 100.0)
    assert bench.link.doubts(bench.now) == []
    assert restarts(bench) == []
    # It is over when the other one is switched off.
    bench = autopilots(Bench(**ASLEEP).hear(PILOT, copter()), 10.0, 100.0, 5.0)
    autopilots(bench, 20.0, 100.0)
    assert bench.link.doubts(bench.now) == []
    assert bench.link.vehicle_state(bench.now).armed is Armed.DISARMED
    # A restart is still one.
    bench = autopilots(Bench(**ASLEEP).hear(PILOT, copter()), 10.0, 100.0)
    autopilots(bench, 10.0, -bench.t)
    assert restarts(bench) == ["autopilot 1/1 restarted on the ground"]
    assert bench.link.doubts(bench.now) == []


@pytest.mark.parametrize("other", [5.0, 97.033, 4000.0])
def test_two_autopilots_with_the_same_ids_are_one_clear_error(other):
    bench = autopilots(Bench(**ASLEEP).hear(PILOT, copter()), 5.0, 100.0)
    autopilots(bench, 10.0, 100.0, other)
    (doubt,) = bench.link.doubts(bench.now)
    assert doubt.startswith(
        f"two autopilots have the ids 1/1 (their clocks are {abs(100 - other):.1f} s"
    )
    assert "system id of its own" in doubt
    assert len(restarts(bench)) <= 1
    assert bench.link.vehicle_state(bench.now).reboot_count == 0
    assert not bench.link.vehicle_state(bench.now).rebooted_in_flight


def test_their_heights_are_not_mixed_and_what_cannot_be_told_apart_ages():
    bench = autopilots(Bench(**ASLEEP).hear(PILOT, copter()), 10.0, 100.0, 5.0)
    heights = set()
    for _ in range(20):
        autopilots(bench, 0.2, 100.0, 5.0)
        heights.add(bench.link.vehicle_state(bench.now).height)
    assert len(heights) == 1
    state = bench.link.vehicle_state(bench.now)
    assert state.height_age < 0.3
    assert state.armed_age > 4.0
    assert state.landed_state_age > 4.0


def test_two_parachutes_with_the_same_ids_are_one_clear_error():
    bench = Bench().hear(CHUTE, heartbeat())
    for second in range(1, 30):
        bench.at(second).hear(CHUTE, heartbeat(), status(boot_ms=50_000 + 1000 * second))
        bench.at(second + 0.5).hear(CHUTE, heartbeat(), status(boot_ms=1000 * second, armed=2))
    (doubt,) = bench.link.doubts(bench.now)
    assert doubt.startswith("two parachutes have the ids 1/161")
    assert len(restarts(bench)) <= 1
