"""What second sources say, and how it is merged with the autopilot's word."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.campaign.sensor_messages import Imu, Vector, odometry, rolled
from chute_ros.model import VehicleState
from chute_ros.protocol import vehicle_readings as readings
from chute_ros.protocol.vehicle_merge import IMU, TELL_INTERVAL, VEHICLE_STATE
from chute_ros.runtime.vehicle_hearing import VehicleHearing


@given(st.floats(-50.0, 500.0), st.floats(-60.0, 60.0), st.floats(-math.pi, math.pi))
def test_odometry_reads_as_what_is_so(height, speed, roll):
    told = readings.odometry(odometry(height, speed, roll))
    assert told["height"] == (height,)
    assert told["vertical_speed"] == pytest.approx((speed,), abs=1e-9)
    assert told["attitude"][3] == pytest.approx(abs(roll), abs=1e-6)


def test_an_imu_reads_as_what_is_so():
    told = readings.imu(Imu(rolled(1.0), Vector(z=9.8)))
    assert told["attitude"][0] == pytest.approx(1.0)
    assert told["acceleration"] == (9.8,)
    gone = readings.imu(Imu(rolled(math.nan), Vector(z=9.8)))
    assert gone == {"attitude": None, "acceleration": (9.8,)}


def test_the_picture_is_told_at_once_and_then_as_often_as_by_the_node():
    """Given messages each 4 ms: the first is told at once, the others together."""
    told: list[tuple[float, VehicleState]] = []
    hearing = VehicleHearing(
        (VEHICLE_STATE, IMU), 2.5, 5.0, lambda report, now: told.append((now, report.state))
    )
    hearing.hear_state(VehicleState(height=12.0, height_age=0.1), 10.0)
    assert [now for now, _ in told] == [10.0]
    for n in range(1, 4):
        told_by_imu = readings.imu(Imu(rolled(0.1 * n), Vector(z=9.8)))
        hearing.hear(IMU, told_by_imu, 10.0 + 0.004 * n)
    assert len(told) == 1
    assert hearing.due == pytest.approx(10.004 + TELL_INTERVAL)
    hearing.tell_now(hearing.due)
    assert math.isinf(hearing.due)
    state = told[-1][1]
    assert (state.height, state.source) == (12.0, "vehicle/state, imu")
    assert state.tilt == pytest.approx(0.3)
