"""Stamps tell when something was received, not when its node last spoke of it."""

from __future__ import annotations

import pytest
from builtin_interfaces.msg import Time

from chute_ros.model import VehicleState
from chute_ros.ros.messages import before, seconds, vehicle_state

NOW = Time(sec=1_780_000_000, nanosec=250_000_000)


def test_a_stamp_of_before() -> None:
    assert before(NOW, 0.5) == Time(sec=1_779_999_999, nanosec=750_000_000)


def test_the_picture_of_a_vehicle_has_the_stamp_of_its_newest_part() -> None:
    message = vehicle_state(VehicleState(height=60.0, height_age=7.0, armed_age=3.0), NOW)
    assert seconds(message.header.stamp) == pytest.approx(seconds(NOW) - 3.0)
    assert message.height_age == 7.0


def test_a_vehicle_of_which_nothing_was_received_has_no_stamp() -> None:
    assert vehicle_state(VehicleState(), NOW).header.stamp == Time()
