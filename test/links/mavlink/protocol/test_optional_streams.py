"""Messages that are asked for besides the needed ones: a few times, given up on a slow line."""

import itertools

import pytest
from autopilot_bench import Told, attitude, imu, position
from link_bench import landed

from chute_ros.links.mavlink.protocol.stream_watch import AFTER, TRIES
from chute_ros.protocol.mavlink.dialect import dialect as d

PRESSURE, IMU2, IMU3 = 29, 116, 129
ATTITUDE_TARGET, LOCAL_TARGET, GLOBAL_TARGET, NAVIGATION, LOCAL = 83, 85, 87, 62, 32
NEEDED = {245, 33, 30, 26, 1}


def vehicle(autopilot=d.MAV_AUTOPILOT_PX4, kind=d.MAV_TYPE_QUADROTOR):
    return d.MAVLink_heartbeat_message(kind, autopilot, 0, 0, d.MAV_STATE_ACTIVE, 3)


def pressure(_):
    return d.MAVLink_scaled_pressure_message(1000, 955.0, 0.0, 2000)


class Line:
    """An autopilot that is told of, and asked, each tenth of a second."""

    def __init__(self, heartbeat=None):
        self.told = Told().hear(heartbeat or vehicle())
        self.tenth = 0
        #: (time, message, interval)
        self.asked: list[tuple[float, int, float]] = []

    def run(self, seconds, rate=10.0, optional=lambda message: None):
        """The needed ones come at this rate, and of the others what optional makes of an id that
        was asked for, twice as seldom."""
        for _ in range(round(seconds * 10)):
            self.tenth += 1
            now, boot = self.tenth / 10, 1000 + 100 * self.tenth
            if self.tenth % round(10 / rate) == 0:
                power = d.MAVLink_sys_status_message(0, 0, 0, 0, 9000, 0, 9, 0, 0, 0, 0, 0, 0)
                at = {"boot_ms": boot}
                told = (landed(), position(**at), attitude(**at), imu(0, 0, -1000, **at), power)
                self.told.hear(*told, now=now)
            if self.tenth % 2 == 0:
                made = (optional(one) for one in {message for _, message, _ in self.asked})
                self.told.hear(*(one for one in made if one is not None), now=now)
            due = self.told.tracker.messages_due(0.1, now)
            self.asked += [(now, one.message_id, one.interval) for one in due]
        return self

    def optional(self, after=0.0):
        return [one for one in self.asked if one[1] not in NEEDED and one[0] > after]


def test_they_are_asked_for_one_by_one_after_the_needed_ones_had_their_time():
    line = Line().run(6.0)
    first = list(dict.fromkeys(message for _, message, _ in line.optional()))
    assert first == [PRESSURE, ATTITUDE_TARGET, LOCAL_TARGET, LOCAL, IMU2, IMU3]
    times = [time for time, *_ in line.optional()]
    assert times[0] >= AFTER
    assert min(b - a for a, b in itertools.pairwise(times)) >= 0.5 - 1e-6
    assert {interval for *_, interval in line.optional()} == {0.2}


@pytest.mark.parametrize(
    ("heartbeat", "targets"),
    [
        (vehicle(), {ATTITUDE_TARGET, LOCAL_TARGET, LOCAL}),
        (
            vehicle(d.MAV_AUTOPILOT_ARDUPILOTMEGA),
            {ATTITUDE_TARGET, LOCAL_TARGET, LOCAL, GLOBAL_TARGET},
        ),
        (
            vehicle(d.MAV_AUTOPILOT_ARDUPILOTMEGA, d.MAV_TYPE_FIXED_WING),
            {ATTITUDE_TARGET, NAVIGATION},
        ),
    ],
    ids=["PX4", "ArduCopter", "ArduPlane"],
)
def test_only_what_is_read_of_this_autopilot_is_asked_for(heartbeat, targets):
    line = Line(heartbeat).run(20.0)
    assert {message for _, message, _ in line.optional()} == {PRESSURE, IMU2, IMU3, *targets}


def test_what_does_not_come_is_left_alone_until_the_autopilot_is_heard_anew():
    line = Line().run(30.0)
    asked = [message for _, message, _ in line.optional()]
    assert {asked.count(message) for message in asked} == {TRIES}
    line.asked.clear()
    line.run(60.0)
    assert line.optional() == []
    line.told.tracker.liveness.update(200.0)
    line.told.hear(vehicle(), now=200.0)
    line.tenth = 2000
    assert line.run(3.0).optional() != []


def test_what_comes_is_asked_for_once_and_again_when_it_stops():
    line = Line().run(30.0, optional=lambda one: pressure(one) if one == PRESSURE else None)
    assert [message for _, message, _ in line.optional()].count(PRESSURE) == 1
    line.run(3.0)
    assert [message for _, message, _ in line.optional(after=30.0)] == [PRESSURE]


def test_what_comes_more_slowly_by_itself_is_asked_for():
    """PX4 sends SCALED_PRESSURE once a second."""
    line = Line()
    for _ in range(8):
        line.told.hear(pressure(0), now=line.tenth / 10)
        line.run(1.0)
    assert [message for _, message, _ in line.optional()].count(PRESSURE) >= 2


def test_on_a_line_that_is_too_slow_they_are_given_up_one_after_the_other_for_good():
    line = Line().run(10.0)
    line.run(60.0, rate=2.0)
    given_up = [(message, interval) for _, message, interval in line.optional(after=10.0)]
    wanted = [IMU3, IMU2, LOCAL, LOCAL_TARGET, ATTITUDE_TARGET, PRESSURE]
    assert given_up == [(message, 0.0) for message in wanted]
    times = [time for time, *_ in line.optional(after=10.0)]
    assert min(b - a for a, b in itertools.pairwise(times)) >= 4.0 - 1e-6
    line.asked.clear()
    line.run(20.0)
    assert line.optional() == []


def test_rates_of_all_that_is_read():
    line = Line().run(20.0, optional=lambda one: pressure(one) if one == PRESSURE else None)
    rates = line.told.tracker.rates(line.tenth / 10)
    assert rates["ATTITUDE"] == pytest.approx(10.0, rel=0.1)
    assert rates["SCALED_PRESSURE"] == pytest.approx(5.0, rel=0.1)
    assert "SCALED_IMU2" not in rates
