"""Sensors that lie, each in its way and its time."""

from __future__ import annotations

import math
import random
import statistics

import pytest

from chute_ros.campaign.sensors import SensorFault, Sensors


def reading(how: str, *times: float) -> list[float]:
    """What is told of heights of 100 m + 1 m/s; it lies from 1 s to 3 s."""
    sensors = Sensors(random.Random(1))
    sensors.faults.append(SensorFault("height", how, 1.0, 3.0))
    return [sensors.read("height", 100.0 + now, now) for now in times]


@pytest.mark.parametrize(
    ("how", "told"),
    [
        ("sticks", [100.5, 101.0, 101.0, 103.0]),
        ("drifts", [100.5, 101.0, 99.0, 103.0]),
        ("jumps", [100.5, 71.0, 72.0, 103.0]),
        ("zero", [100.5, 0.0, 0.0, 103.0]),
        ("gone", [100.5, math.nan, math.nan, 103.0]),
    ],
)
def test_a_sensor_lies_in_its_time_only(how: str, told: list[float]) -> None:
    assert reading(how, 0.5, 1.0, 2.0, 3.0) == pytest.approx(told, abs=0.7, nan_ok=True)


def test_a_sensor_that_is_whole_has_the_noise_of_one() -> None:
    told = reading("gone", *(0.001 * n for n in range(500)))
    errors = [one - (100.0 + 0.001 * n) for n, one in enumerate(told)]
    assert len(set(told)) == len(told), "never the same to the last bit"
    assert statistics.fmean(errors) == pytest.approx(0.0, abs=0.03)
    assert statistics.pstdev(errors) == pytest.approx(0.15, rel=0.2)


def test_noise_is_around_what_is_so() -> None:
    told = reading("noise", *(1.0 + 0.01 * n for n in range(100)))
    assert max(told) - min(told) > 40.0
    assert all(70.0 <= one <= 132.0 for one in told)


def test_another_sensor_tells_what_is_so() -> None:
    sensors = Sensors(random.Random(1))
    sensors.faults.append(SensorFault("landed", "lies", 1.0, 3.0))
    assert sensors.read("speed", 4.0, 2.0) == pytest.approx(4.0, abs=0.4)
    assert [sensors.lies("landed", now) for now in (0.9, 1.0, 3.0)] == [False, True, False]
    assert not sensors.lies("fix", 2.0)
