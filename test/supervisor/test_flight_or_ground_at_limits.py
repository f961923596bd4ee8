"""Flight or ground at the limits."""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from story import Story, changed, with_rules

from chute_ros.model import Armed, LandedState, VehicleState
from chute_ros.supervisor import flight, gate, readings
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkEvidence
from chute_ros.supervisor.measured import Measured
from chute_ros.supervisor.rules import BelowMinimum, Profile
from chute_ros.supervisor.state import HeardHere, State

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
        heard=HeardHere(
            vehicle=VehicleState(
                armed=armed, armed_age=0.0, landed_state=landed, landed_state_age=0.0
            ),
            vehicle_received=NOW,
            measurements=MappingProxyType(measurements),
        ),
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
    assert (
        flight.in_air(CONFIG, replace(told, flight=replace(told.flight, landed_at=landed_at)), NOW)
        is in_air
    )


def told_by_heights(*heights: tuple[float, float]) -> State:
    """The last of these heights is the newest that was measured."""
    height = Measured(heights[-1][1], heights[-1][0], heights[-1][0], len(heights))
    known = MappingProxyType({"height": height})
    return State(epoch=7, started_at=0.0, heard=HeardHere(measurements=known, heights=heights))


def test_a_climb_rate_needs_heights_just_so_far_apart() -> None:
    far = told_by_heights((0.0, 50.0), (0.2, 47.0), (0.4, 44.0))
    assert readings.climb_rate(CONFIG, far, 0.4) == pytest.approx(-15.0)
    near = told_by_heights((0.1, 50.0), (0.2, 47.0), (0.4, 44.0))
    assert math.isnan(readings.climb_rate(CONFIG, near, 0.4))


def test_a_climb_rate_is_not_known_where_the_height_is_not() -> None:
    falls = told_by_heights((0.0, 50.0), (0.2, 47.0), (0.4, 44.0))
    assert math.isnan(readings.climb_rate(CONFIG, falls, 9.0)), "the newest is old"
    assert math.isnan(
        readings.climb_rate(CONFIG, replace(falls, heard=replace(falls.heard, heights=())), 0.4)
    )


def test_one_that_started_anew_falls_as_fast_but_it_is_no_sign_of_its_own() -> None:
    falls = told_by_heights((0.0, 50.0), (0.2, 47.0), (0.4, 44.0))
    anew = replace(falls, flight=replace(falls.flight, rebooted=True))
    rate = readings.climb_rate(CONFIG, falls, 0.4)
    assert readings.climb_rate(CONFIG, anew, 0.4) == rate == pytest.approx(-15.0)
    assert readings.measured(CONFIG, anew, "vertical_speed", 0.4) == rate
    assert readings.measured(CONFIG, falls, "climb_rate", 0.4) == rate
    for name in ("climb_rate", "height"):
        value, why = readings.reading(CONFIG, anew, name, 0.4)
        assert math.isnan(value)
        assert why == "the autopilot started anew in flight, and its height with it"


@pytest.mark.parametrize(("height", "in_air"), [(40.0, False), (40.1, True)])
def test_how_high_one_falls_counts_from_where_it_was_armed(height: float, in_air: bool) -> None:
    state = replace(
        known(acceleration=1.0, height=height),
        flight=replace(known(acceleration=1.0, height=height).flight, armed_height=30.0),
    )
    assert flight.in_air(CONFIG, state, NOW) is in_air


@pytest.mark.parametrize(("height", "in_air"), [(32.0, False), (32.1, True)])
def test_without_a_landed_state_it_flies_above_the_height_of_a_take_off(
    height: float, in_air: bool
) -> None:
    state = replace(
        known(LandedState.UNKNOWN, height=height),
        flight=replace(known(LandedState.UNKNOWN, height=height).flight, armed_height=30.0),
    )
    assert flight.in_air(CONFIG, state, NOW) is in_air


def test_one_without_a_height_is_taken_to_be_high_enough_just_so_long_after_its_take_off() -> None:
    profile = {"minimum_height": 10.0, "below_minimum": BelowMinimum.KILL}
    story = Story(with_rules(profile=profile)).flying()
    story.fly(4.95, height=math.nan)
    why = gate.too_low(story.config, story.state, story.state.own.updated_at)
    assert why == "it was never seen at the minimum height, 10 m"
    story.fly(5.05, height=math.nan)
    assert gate.too_low(story.config, story.state, story.state.own.updated_at) == ""


# -- what the heights tell -----------------------------------------------------------------------


def every_tenth(*values: float) -> State:
    """These heights, 0.1 s apart, the last of them at 0.1 s x (their number - 1)."""
    return told_by_heights(*((n / 10, value) for n, value in enumerate(values)))


def told_rate(*values: float) -> tuple[float, str]:
    return readings.reading(CONFIG, every_tenth(*values), "climb_rate", (len(values) - 1) / 10)


def test_too_few_heights_say_so() -> None:
    assert told_rate(50.0, 50.0, 50.0)[1] == "too few heights that can be used"


def test_where_the_middle_and_the_whole_tell_opposite_ways_it_neither_climbs_nor_sinks() -> None:
    """It creeps up, by 1 m/s, but for one step down."""
    value, why = told_rate(0.0, 0.1, 0.2, 0.3, 0.4, -2.0, -1.9, -1.8, -1.7, -1.6)
    assert (value, why) == (0.0, "")


def test_a_slow_climb_is_one() -> None:
    assert told_rate(*[0.05 * n for n in range(9)])[0] == pytest.approx(0.5)


# -- since a kill --------------------------------------------------------------------------------


def killed(speed: float = math.nan, force: float = math.nan, at: float = NOW) -> State:
    """Killed at NOW - 2.0, 100 m high, sinking by 1 m/s; at that time this was told last."""
    told = {"vertical_speed": speed, "acceleration": force}
    measurements = {name: Measured(value, at, at, 1) for name, value in told.items()}
    return replace(
        known(),
        killing=replace(
            known().killing,
            killed_in_flight=True,
            killed_at=NOW - 2.0,
            killed_height=100.0,
            killed_sinking=1.0,
        ),
        heard=replace(
            known().heard,
            measurements=MappingProxyType(
                {name: one for name, one in measurements.items() if not math.isnan(one.value)}
            ),
        ),
    )


LEFT = pytest.approx(100.0 - 2.0 - 9.81 * 2.0)


def test_the_height_that_is_left_since_a_kill() -> None:
    assert flight.height_since_kill(CONFIG, killed(), NOW) == LEFT
    for ground in ({"killed_in_flight": False}, {"killed_standing": True}):
        assert math.isnan(flight.height_since_kill(CONFIG, changed(killed(), **ground), NOW))


@pytest.mark.parametrize(
    ("told", "falls"),
    [
        ({"speed": -2.1}, True),
        ({"speed": -2.0}, False),
        ({"force": 4.8}, True),
        ({"force": 4.9}, False),
        ({"speed": -2.1, "force": 9.8}, True),
        ({"speed": 0.0, "force": 1.0}, True),
        # Just after the kill it need not fall yet.
        ({"speed": 0.0, "force": 9.8, "at": NOW - 1.0}, True),
        ({"speed": 0.0, "force": 9.8, "at": NOW - 0.9}, False),
    ],
)
def test_what_was_seen_since_the_kill(told: dict[str, float], falls: bool) -> None:
    left = flight.height_since_kill(CONFIG, killed(**told), NOW)
    assert left == LEFT if falls else math.isnan(left)


@pytest.mark.parametrize(("before", "silent"), [(1.0, True), (1.01, False), (-0.5, True)])
def test_one_that_was_not_heard_until_its_kill_is_not_silent_since(
    before: float, silent: bool
) -> None:
    heard = LinkEvidence(heard=NOW - 0.1)
    links = MappingProxyType(dict.fromkeys(CONFIG.kill_links, heard))
    state = replace(
        killed(), heard=replace(killed().heard, vehicle_received=NOW - 2.0 - before, links=links)
    )
    assert flight.silent_since_kill(CONFIG, state, NOW) is silent
    assert not flight.silent_since_kill(
        CONFIG, replace(state, heard=replace(state.heard, links=MappingProxyType({}))), NOW
    )


@pytest.mark.parametrize(
    ("height", "armed_height", "hold"),
    [(10.1, 0.0, 5.0), (10.0, 0.0, 1.0), (35.0, 30.0, 1.0), (40.1, 30.0, 5.0)],
)
def test_how_high_above_where_it_was_armed_a_landing_takes_longer(
    height: float, armed_height: float, hold: float
) -> None:
    config = SupervisorConfig(profile=Profile("tested", (), minimum_height=10.0, landed_hold=1.0))
    state = replace(
        known(height=height),
        flight=replace(known(height=height).flight, armed_height=armed_height),
    )
    assert flight.landed_hold(config, state) == hold
    off = replace(
        state,
        heard=replace(state.heard, vehicle=replace(state.heard.vehicle, armed=Armed.DISARMED)),
    )
    assert flight.landed_hold(config, off) == 1.0
