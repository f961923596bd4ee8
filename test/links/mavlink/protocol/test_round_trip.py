"""A line that is full brings everything, late: the time until the autopilot answers tells."""

import math
from collections import deque

import pytest
from autopilot_bench import Told
from link_bench import copter

from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.links.mavlink.protocol.round_trip import LIMIT, RoundTrip
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.sim.autopilot_device import AutopilotDevice

STEP = 0.02
#: What an autopilot keeps for a line, bytes; what does not fit is not sent.
BUFFER = 16_000


def asked(trip, now):
    question = trip.question(now)
    assert question is not None
    assert question.tc1 == 0
    return question.ts1


def answer(ts1, tc1=5):
    return d.MAVLink_timesync_message(tc1, ts1)


def test_it_is_asked_each_second_and_two_answers_tell():
    trip = RoundTrip()
    for second, took in enumerate((0.7, 0.6)):
        assert math.isnan(trip.seconds(second))
        sent = asked(trip, float(second))
        assert trip.question(second + 0.99) is None
        trip.heard(answer(sent), second + took)
    assert trip.seconds(2.0) == pytest.approx(0.6)
    (fault,) = trip.faults(2.0)
    assert fault.startswith("answers after 0.6 s (TIMESYNC; limit 0.5 s)")
    assert "raise its baud rate" in fault


def test_what_tells_nothing_of_the_time():
    # One late answer is none yet.
    trip = RoundTrip()
    for second, took in enumerate((0.02, 0.9, 0.02)):
        trip.heard(answer(asked(trip, float(second))), second + took)
        assert not trip.late(second + took)
    # Answers to others its own questions and copies count nothing.
    trip = RoundTrip()
    sent = asked(trip, 10.0)
    trip.heard(answer(sent, tc1=0), 10.1)
    trip.heard(answer(sent + 1), 10.1)
    trip.heard(answer(sent), 10.1)
    for again in (10.7, 10.8, 10.9):
        trip.heard(answer(sent), again)
    assert math.isnan(trip.seconds(11.0))
    # What was measured long ago says nothing.
    trip = RoundTrip()
    for second in (0.0, 1.0):
        trip.heard(answer(asked(trip, second)), second + 0.9)
    assert trip.late(11.0)
    assert not trip.late(12.0)


def test_one_that_is_heard_anew_is_measured_anew():
    told = Told().hear(copter())
    for now in (0.0, 1.0):
        told.hear(answer(told.tracker.round_trip.question(now).ts1), now=now + 0.9)
    assert told.at(2.0).faults
    told.tracker.liveness.update(20.0)
    told.hear(copter(), now=20.0)
    assert not told.at(20.0).faults


class Line:
    """The autopilot's side of a serial line: so many bytes a second, and what waits is
    kept. The other way is free."""

    def __init__(self, rate):
        self.rate, self.t = rate, 0.0
        self.link = MavlinkLink(MavlinkConfig(255, 191))
        self.autopilot = AutopilotDevice(1, [])
        self.autopilot.add_second_imu()
        self.waiting: deque[bytes] = deque()
        self.may_send = 0.0

    def run(self, seconds):
        for _ in range(round(seconds / STEP)):
            self.t += STEP
            self.autopilot.update(self.t)
            for frame in self.autopilot.take_output():
                if sum(map(len, self.waiting)) + len(frame) <= BUFFER:
                    self.waiting.append(frame)
            self.may_send = min(self.may_send + self.rate * STEP, 300.0)
            while self.waiting and self.may_send >= len(self.waiting[0]):
                self.may_send -= len(self.waiting[0])
                self.link.receive(self.waiting.popleft(), self.t)
            self.link.update(self.t)
            for frame in self.link.take_output():
                self.autopilot.receive(frame, self.t, "line")
            self.link.take_events()
        return self.link.vehicle_state(self.t).faults

    def delay(self):
        return sum(map(len, self.waiting)) / self.rate


def test_a_line_that_is_nearly_wide_enough_is_told_and_emptied_by_giving_up_what_is_optional():
    line = Line(1800.0)
    for _ in range(60):
        if faults := line.run(1.0):
            break
    (fault,) = faults
    assert "answers after" in fault
    assert LIMIT - 0.1 <= line.delay() <= 3.0
    assert line.run(60.0) == ()
    assert line.delay() < 0.2


def test_a_wide_line_tells_nothing():
    line = Line(5760.0)
    assert line.run(30.0) == ()
