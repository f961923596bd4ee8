"""Stamps tell when something was received, not when its node last spoke of it."""

import math
import time

import pytest
from builtin_interfaces.msg import Time

from chute_ros.model import VehicleState
from chute_ros.ros.messages import before, seconds, vehicle_state
from chute_ros.ros.two_clocks import wall_at

NOW = Time(sec=1_780_000_000, nanosec=250_000_000)


def test_a_stamp_of_before():
    assert before(NOW, 0.5) == Time(sec=1_779_999_999, nanosec=750_000_000)


def test_the_picture_of_a_vehicle_has_the_stamp_of_its_newest_part():
    message = vehicle_state(VehicleState(height=60.0, height_age=7.0, armed_age=3.0), NOW)
    assert seconds(message.header.stamp) == pytest.approx(seconds(NOW) - 3.0)
    assert message.height_age == 7.0


def test_a_vehicle_of_which_nothing_was_received_has_no_stamp():
    assert vehicle_state(VehicleState(), NOW).header.stamp == Time()


# An instant of the monotonic clock, by the wall clock

#: The wall clock is so far ahead of the monotonic one here, ns.
AHEAD = 1_780_000_000 * 10**9


class Processor:
    """Its clocks go on by 1 us with each reading; before those whose numbers are in away, another
    process has the processor for 12 ms."""

    def __init__(self, *away: int) -> None:
        self._now, self._away, self._readings = 50_000_000_000, away, 0

    def monotonic(self) -> float:
        return self.nanoseconds() * 1e-9

    def wall(self) -> int:
        return self.nanoseconds() + AHEAD

    def nanoseconds(self) -> int:
        self._now += 12_000_000 if self._readings in self._away else 1_000
        self._readings += 1
        return self._now


@pytest.mark.parametrize("away", [(), (0,), (1,), (2,), (3,), (1, 4, 8), tuple(range(1, 28))])
def test_a_busy_processor_moves_no_stamp(away):
    """Something was received at 49.9 s, whenever the processor is away meanwhile."""
    processor = Processor(*away)
    stamp = wall_at(49.9, processor.monotonic, processor.wall)
    assert stamp == pytest.approx(49_900_000_000 + AHEAD, abs=100_000)


def test_of_a_processor_that_is_always_away_the_best_is_taken():
    processor = Processor(*range(1000))
    stamp = wall_at(49.9, processor.monotonic, processor.wall)
    assert stamp == pytest.approx(49_900_000_000 + AHEAD, abs=12_000_000)


def test_what_was_never_received_has_no_stamp_and_none_is_before_the_clocks_zero():
    assert wall_at(math.nan) == 0
    assert wall_at(-1e12) == 0


def test_the_clocks_of_this_machine():
    before_, at, after = time.time_ns(), wall_at(time.monotonic()), time.time_ns()
    assert before_ - 1_000_000 <= at <= after + 1_000_000
