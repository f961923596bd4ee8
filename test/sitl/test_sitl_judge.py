"""What a run is judged by: the record and the simulator's truth, never the supervisor's word."""

import math

import pytest

from chute_ros.protocol.mavlink.dialect import dialect
from sitl.judge import Expectation, Verdict, Want, events_of, held_up, judge
from sitl.record import Seen
from sitl.truth import Truth

LINE, BENCH = 10, 20
FALLS = [(0.1 * step, 40.0 - 5.0 * (0.1 * step) ** 2, -10.0 * 0.1 * step) for step in range(30)]
HOVERS = [(0.1 * step, 40.0, 0.0) for step in range(30)]


def truth(samples: list[tuple[float, float, float]]) -> Truth:
    told = Truth()
    told.take(-10.0, "SIM_STATE", _state(0.0, 0.0))
    for at, height, climb in samples:
        told.take(at, "SIM_STATE", _state(height, climb))
    return told


def _state(height: float, climb: float) -> object:
    message = dialect.MAVLink_sim_state_message(*[0.0] * 21)
    message.alt, message.vd = 100.0 + height, -climb
    return message


def seen(at: float, component: int, message: object, port: int = LINE) -> Seen:
    return Seen(at, port, 1, component, message.get_type(), message)


def kill(at: float) -> Seen:
    return seen(at, 191, dialect.MAVLink_command_long_message(1, 1, 185, 0, *[1.0] * 7))


def out(at: float) -> Seen:
    return seen(at, 161, dialect.MAVLink_parachute_status_message(0, 0, 12, 4, 0, 50, b""))


def beat(at: float, armed: bool, state: int = 4) -> Seen:
    mode = 128 if armed else 0
    return seen(at, 1, dialect.MAVLink_heartbeat_message(2, 3, mode, 0, state, 3))


def verdict(
    want: Want, record: list[Seen], samples: list[tuple[float, float, float]], since: float = 0.0
) -> Verdict:
    told = Verdict()
    expected = Expectation(want, since, 1.0)
    judge(expected, events_of(record, [BENCH]), truth(samples), told)
    return told


def test_a_release_in_time_over_stopped_motors_is_right():
    told = verdict(Want.RELEASE, [kill(0.8), out(0.9), beat(1.0, False)], FALLS)
    assert told.wrong == []
    assert told.times == {"failure to kill": 0.8, "failure to release": 0.9}


@pytest.mark.parametrize(
    ("record", "told"),
    [
        ([], "missed: not released"),
        ([kill(1.1), out(1.2), beat(1.2, False)], "late: released after 1.20 s, need 1 s"),
        ([out(-0.5), beat(0.0, False)], "false: released 0.50 s before the failure"),
        ([kill(0.8), out(0.9), beat(2.5, True)], "over motors that were not stopped"),
        ([kill(-0.2), out(0.9), beat(1.0, False)], "false: killed 0.20 s before it was needed"),
    ],
)
def test_missed_late_false_and_over_motors_are_told(record, told):
    assert told in "; ".join(verdict(Want.RELEASE, record, FALLS).wrong)


def test_a_terminated_autopilot_that_stays_armed_has_its_motors_off():
    told = verdict(Want.RELEASE, [kill(0.8), out(0.9), beat(1.0, True, 8)], FALLS)
    assert told.wrong == []


@pytest.mark.parametrize(("record", "wrong"), [([], 0), ([kill(1.0)], 1), ([out(1.0)], 1)])
def test_a_nominal_flight_sees_nothing(record, wrong):
    assert len(verdict(Want.NOTHING, record, HOVERS, math.nan).wrong) == wrong


def test_a_release_that_the_autopilot_orders_itself_counts_as_well():
    order = dialect.MAVLink_command_long_message(1, 161, 208, 0, 2.0, *[0.0] * 6)
    told = verdict(Want.KILL, [kill(0.1), seen(0.2, 1, order), beat(0.3, False)], HOVERS)
    assert told.wrong == ["false: component 1 ordered a release"]


def test_the_bench_is_no_part_of_the_vehicle():
    order = dialect.MAVLink_command_long_message(1, 161, 208, 0, 2.0, *[0.0] * 6)
    assert verdict(Want.NOTHING, [seen(0.2, 1, order, BENCH)], HOVERS, math.nan).wrong == []


def test_by_truth_a_vehicle_that_was_lost_must_be_released_and_one_that_flew_must_not():
    down = [*FALLS, (3.0, 0.0, 0.0)]
    assert "hit the ground with" in verdict(Want.BY_TRUTH, [], down).wrong[0]
    assert verdict(Want.BY_TRUTH, [], HOVERS).happened == ["it flew on"]
    assert verdict(Want.BY_TRUTH, [kill(1.0), out(1.2), beat(1.2, False)], FALLS).wrong == []
    assert "was not lost" in verdict(Want.BY_TRUTH, [kill(1.0), out(1.2)], HOVERS).wrong[0]


def test_released_too_low_is_false():
    low = [(0.1 * step, 5.0, -3.0) for step in range(30)]
    assert "false: released at 5.0 m" in verdict(Want.RELEASE, [kill(0.1), out(0.2)], low).wrong


def test_a_node_that_was_silent_was_held_up():
    beats = [
        seen(at, 191, dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)) for at in (0, 1, 3.5)
    ]
    assert held_up(beats) == pytest.approx(1.5)
    assert held_up([]) == 0.0
