"""Flight or ground at the limits: what mutants showed that no story looked at."""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from story import Story, with_rules

from chute_ros.model import Armed, LandedState, VehicleState
from chute_ros.supervisor import flight, gate
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.measurements import Measured
from chute_ros.supervisor.rules import BelowMinimum, Profile
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


def told_by_heights(*heights: tuple[float, float]) -> State:
    """The last of these heights is the newest that was measured."""
    height = Measured(heights[-1][1], heights[-1][0], heights[-1][0], len(heights))
    known = MappingProxyType({"height": height})
    return State(epoch=7, started_at=0.0, measurements=known, heights=heights)


def test_a_climb_rate_needs_heights_just_so_far_apart() -> None:
    far = told_by_heights((0.0, 50.0), (0.2, 47.0), (0.4, 44.0))
    assert flight.climb_rate(CONFIG, far, 0.4) == pytest.approx(-15.0)
    near = told_by_heights((0.1, 50.0), (0.2, 47.0), (0.4, 44.0))
    assert math.isnan(flight.climb_rate(CONFIG, near, 0.4))


def test_a_climb_rate_is_not_known_where_the_height_is_not() -> None:
    falls = told_by_heights((0.0, 50.0), (0.2, 47.0), (0.4, 44.0))
    assert math.isnan(flight.climb_rate(CONFIG, falls, 9.0)), "the newest is old"
    assert math.isnan(flight.climb_rate(CONFIG, replace(falls, rebooted=True), 0.4))
    assert math.isnan(flight.climb_rate(CONFIG, replace(falls, heights=()), 0.4))


@pytest.mark.parametrize(("height", "in_air"), [(40.0, False), (40.1, True)])
def test_how_high_one_falls_counts_from_where_it_was_armed(height: float, in_air: bool) -> None:
    state = replace(known(acceleration=1.0, height=height), armed_height=30.0)
    assert flight.in_air(CONFIG, state, NOW) is in_air


@pytest.mark.parametrize(("height", "in_air"), [(32.0, False), (32.1, True)])
def test_without_a_landed_state_it_flies_above_the_height_of_a_take_off(
    height: float, in_air: bool
) -> None:
    state = replace(known(LandedState.UNKNOWN, height=height), armed_height=30.0)
    assert flight.in_air(CONFIG, state, NOW) is in_air


@pytest.mark.parametrize(
    ("rebooted", "hold", "believed_after"),
    [(False, 1.0, 1.0), (True, 1.0, 10.0), (True, 15.0, 15.0)],
)
def test_how_long_one_must_say_that_it_stands(
    rebooted: bool, hold: float, believed_after: float
) -> None:
    config = SupervisorConfig(profile=Profile("tested", (), landed_hold=hold))
    state = replace(known(), down_since=NOW, rebooted=rebooted)
    assert flight.landed_at(config, state) == NOW + believed_after


def test_one_without_a_height_is_taken_to_be_high_enough_just_so_long_after_its_take_off() -> None:
    profile = {"minimum_height": 10.0, "below_minimum": BelowMinimum.KILL}
    story = Story(with_rules(profile=profile)).flying()
    story.fly(4.95, height=math.nan)
    why = gate.too_low(story.config, story.state, story.state.updated_at)
    assert why == "it was never seen at the minimum height, 10 m"
    story.fly(5.05, height=math.nan)
    assert gate.too_low(story.config, story.state, story.state.updated_at) == ""
