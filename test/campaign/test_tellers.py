"""Who tells of the vehicle, and whose sensors count."""

from __future__ import annotations

from dataclasses import replace

import pytest
from campaign_bench import scenario

from chute_ros.campaign.channel import Spell
from chute_ros.campaign.scenario import Failure, Stop, WayFault, may_count, outlives
from chute_ros.campaign.sensors import SensorFault
from chute_ros.protocol.vehicle_merge import IMU, VEHICLE_STATE

WITH_IMU, IMU_FIRST = (VEHICLE_STATE, IMU), (IMU, VEHICLE_STATE)
TILT = SensorFault("tilt", "jumps", 0.0, 9.0)
IMU_TILT = replace(TILT, source=IMU)


@pytest.mark.parametrize(
    ("fault", "failure", "sources", "others", "counts"),
    [
        (TILT, Failure.MOTOR, WITH_IMU, (), True),
        (IMU_TILT, Failure.MOTOR, WITH_IMU, (), False),
        (TILT, Failure.MOTOR, IMU_FIRST, (), False),
        (IMU_TILT, Failure.MOTOR, IMU_FIRST, (), True),
        # An IMU knows no height.
        (replace(TILT, sensor="height"), Failure.MOTOR, IMU_FIRST, (), True),
        # Whoever is preferred falls silent.
        (IMU_TILT, Failure.POWER, WITH_IMU, (), True),
        (IMU_TILT, Failure.MOTOR, WITH_IMU, (Stop("mavlink_parachute", 0.0, 1.0),), True),
        (IMU_TILT, Failure.MOTOR, WITH_IMU, (SensorFault("tilt", "gone", 0.0, 1.0),), True),
        (IMU_TILT, Failure.MOTOR, WITH_IMU, (Stop("parachute", 0.0, 1.0),), False),
        (TILT, Failure.MOTOR, IMU_FIRST, (WayFault(IMU, Spell(0.0, 1.0, loss=1.0)),), True),
        # What nobody else says.
        (SensorFault("landed", "lies", 0.0, 1.0), Failure.NOTHING, IMU_FIRST, (), True),
    ],
)
def test_a_sensor_counts_where_the_supervisor_may_go_by_it(
    fault: SensorFault, failure: Failure, sources: tuple[str, ...], others: tuple, counts: bool
) -> None:
    flies = scenario(failure, fault, *others, vehicle_sources=sources)
    assert may_count(flies, fault) is counts


def test_only_one_that_lost_its_power_is_outlived() -> None:
    assert outlives(scenario(Failure.POWER, vehicle_sources=WITH_IMU))
    assert not outlives(scenario(Failure.POWER))
    assert not outlives(scenario(Failure.HANG, vehicle_sources=WITH_IMU))
