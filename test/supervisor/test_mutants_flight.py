"""Flight or ground at the limits: what mutants showed that no story looked at."""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest

from chute_ros.model import Armed, LandedState, VehicleState
from chute_ros.supervisor import flight
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.measurements import Measured
from chute_ros.supervisor.rules import Profile
from chute_ros.supervisor.state import State

CONFIG = SupervisorConfig(profile=Profile("tested", (), minimum_height=10.0))
NOW = 100.0


def known(
    landed: LandedState = LandedState.ON_GROUND, armed: Armed = Armed.ARMED, **told: float
) -> State:
    """A state with these measurements, just made, and this word of the autopilot."""
    measurements = {name: Measured(value, NOW, NOW, 1) for name, value in told.items()}
    return State(
        epoch=7,
        started_at=0.0,
        vehicle=VehicleState(
            armed=armed, armed_age=0.0, landed_state=landed, landed_state_age=0.0
        ),
        vehicle_received=NOW,
        measurements=MappingProxyType(measurements),
    )


def test_a_height_that_is_stuck_may_be_the_lowest_all_the_same() -> None:
    stuck = Measured(4.0, measured_at=NOW, same_since=NOW - 60.0, count=99)
    state = replace(known(), measurements=MappingProxyType({"height": stuck}))
    assert math.isnan(flight.measured(CONFIG, state, "height", NOW))
    assert flight.lowest_height(CONFIG, state, NOW) == 4.0
    assert math.isnan(flight.lowest_height(CONFIG, state, NOW + 9.0)), "an old one may not"
    again = replace(state, rebooted=True)
    assert math.isnan(flight.lowest_height(CONFIG, again, NOW)), "nor one that counts anew"
    assert flight.unusable(CONFIG, again, "height", NOW) == (
        "the autopilot started anew in flight, and its height with it"
    )


@pytest.mark.parametrize(
    ("told", "in_air"),
    [
        ({"acceleration": 4.8, "vertical_speed": -2.1}, True),
        ({"acceleration": 4.9, "vertical_speed": -2.1}, False),
        ({"acceleration": 4.8, "vertical_speed": -2.0}, False),
        ({"acceleration": 4.8, "vertical_speed": 0.0, "height": 10.1}, True),
        ({"acceleration": 4.8, "vertical_speed": 0.0, "height": 10.0}, False),
        ({"acceleration": 9.8, "vertical_speed": -9.0, "height": 50.0}, False),
    ],
)
def test_one_that_says_it_stands_falls_with_the_accelerometer_and_one_more_sign(
    told: dict[str, Any], in_air: bool
) -> None:
    assert flight.in_air(CONFIG, known(**told), NOW) is in_air


@pytest.mark.parametrize(
    ("landed_at", "height", "in_air"),
    [
        (NOW - 59.9, 50.0, True),
        (NOW - 60.0, 50.0, False),
        (math.nan, 50.0, False),
        (NOW - 1.0, 9.0, False),
    ],
)
def test_one_that_also_says_disarmed_needs_all_signs_and_a_flight_just_before(
    landed_at: float, height: float, in_air: bool
) -> None:
    told = known(armed=Armed.DISARMED, acceleration=1.0, vertical_speed=-9.0, height=height)
    assert flight.in_air(CONFIG, replace(told, landed_at=landed_at), NOW) is in_air
