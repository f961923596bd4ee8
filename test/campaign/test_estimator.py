"""An estimator that is wrong with itself, and what goes on telling the truth."""

from __future__ import annotations

import itertools
import math

import pytest
from campaign_bench import SHIPPED, scenario

from chute_ros.campaign.estimator import Estimator, EstimatorFault
from chute_ros.campaign.flight import Flight
from chute_ros.campaign.scenario import Failure
from chute_ros.campaign.sensors import SensorFault
from chute_ros.sim.air import air_at
from chute_ros.sim.flight import GRAVITY, FlightModel


def pictures(fault: EstimatorFault, *times: float, **model):
    """What it makes of a vehicle that hovers at 80 m, or of another one."""
    estimator = Estimator()
    estimator.faults.append(fault)
    vehicle = FlightModel(**{"height": 80.0, **model})
    return [estimator.picture(vehicle, now) for now in times]


def test_before_it_goes_wrong_it_tells_what_is_so() -> None:
    for how in ("diverges", "leans", "hovers"):
        (told,) = pictures(EstimatorFault(how, 5.0, 9.0, 2.0), 4.9, vertical_speed=-3.0, roll=0.2)
        assert told == (80.0, -3.0, 0.2)


def test_one_that_diverges_is_wrong_in_height_and_speed_alike_and_is_led_back() -> None:
    fault = EstimatorFault("diverges", 5.0, 9.0, 2.0)
    at_seven, at_nine, back = pictures(fault, 7.0, 9.0, 12.0)
    assert at_seven == pytest.approx((76.0, -4.0, 0.0))
    assert at_nine == pytest.approx((64.0, -8.0, 0.0))
    assert back == pytest.approx((80.0, 0.0, 0.0))


def test_one_that_leans_sinks_as_what_leans_so_would() -> None:
    fault = EstimatorFault("leans", 5.0, 15.0, 0.4)
    times = [5.0 + 0.01 * n for n in range(900)]
    told = pictures(fault, *times)
    for before, after in itertools.pairwise(told):
        push = GRAVITY * (1.0 - math.cos((before.roll + after.roll) / 2.0))
        assert after.vertical_speed - before.vertical_speed == pytest.approx(
            -0.01 * push, abs=2e-3
        )
        sinks = 0.005 * (before.vertical_speed + after.vertical_speed)
        assert after.height - before.height == pytest.approx(sinks, abs=1e-3)
    assert told[100].roll == pytest.approx(0.4, abs=0.01)
    assert told[-1].roll == pytest.approx(1.66)
    assert pictures(fault, 15.0) == [(80.0, 0.0, 0.0)], "it starts anew"


def test_one_that_hovers_keeps_its_height_and_tells_the_attitude() -> None:
    estimator, falling = Estimator(), FlightModel(height=80.0, vertical_speed=-9.0, roll=1.0)
    estimator.faults.append(EstimatorFault("hovers", 5.0, 9.0))
    estimator.picture(falling, 5.0)
    falling.height = 50.0
    assert estimator.picture(falling, 8.0) == (80.0, 0.0, 1.0)
    assert estimator.picture(falling, 9.0) == (50.0, -9.0, 1.0)


def told_by(*faults):
    """The autopilot of a vehicle that hovers at 60 m, 6 s after it is up."""
    flight = Flight(scenario(Failure.NOTHING, *faults, failure_at=7.0), SHIPPED)
    flight.rig.world.run(15.0, lambda: not math.isnan(flight.up))
    end = flight.up + 4.0
    flight.rig.world.run(end, lambda: flight.rig.world.now >= end)
    autopilot = flight.rig.autopilot
    autopilot.now = flight.rig.world.now
    return autopilot


def test_pressure_and_force_tell_the_truth_beside_it() -> None:
    autopilot = told_by(EstimatorFault("diverges", 0.0, 9.0, 3.0))
    position = autopilot._global_position_int()
    assert position.relative_alt / 1000.0 == pytest.approx(36.0, abs=2.0)
    assert position.alt - position.relative_alt == pytest.approx(488_000, abs=2)
    assert position.vz / 100.0 == pytest.approx(12.0, abs=0.5)
    pressure = autopilot._scaled_pressure().press_abs
    assert pressure == pytest.approx(air_at(548.0).pressure / 100.0, abs=0.2)
    assert autopilot._scaled_imu().zacc == pytest.approx(-1000, abs=60)
    # Its controller goes by it, and sees that the vehicle is not where it was told to be.
    local, target = autopilot._local_position_ned(), autopilot._position_target()
    assert local.z - target.z == pytest.approx(24.0, abs=2.0)
    assert local.vz - target.vz == pytest.approx(12.0, abs=0.5)


def test_a_barometer_that_is_wrong_moves_nothing_else() -> None:
    autopilot = told_by(SensorFault("pressure", "jumps", 0.0, 9.0))
    pressure = autopilot._scaled_pressure().press_abs
    assert pressure == pytest.approx(air_at(518.0).pressure / 100.0, abs=0.2)
    assert autopilot._global_position_int().alt / 1000.0 == pytest.approx(548.0, abs=1.0)
    silent = told_by(SensorFault("pressure", "gone", 0.0, 9.0))
    assert math.isnan(silent._scaled_pressure().press_abs)
