"""In the air, moving, disarmed: what is known is fused, and what contradicts it not believed."""

import math
from typing import Any

import pytest
from story import STANDING, START, Story, changed, rule, shipped, vehicle, with_rules

from chute_ros.model import Armed, LandedState, VehicleState
from chute_ros.supervisor import flight, gate, readings
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkEvidence
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import Measured
from chute_ros.supervisor.rules import BelowMinimum, Profile
from chute_ros.supervisor.state import State

CONFIG = SupervisorConfig(profile=Profile("tested", (), minimum_height=10.0))
NOW = 100.0
GROUND, AIR = LandedState.ON_GROUND, LandedState.IN_AIR
NOTHING = LandedState.UNKNOWN
FAR = MeasurementCondition("distance_from_home", above=100.0)


def landing(hold: float = 1.0, **settings: Any) -> SupervisorConfig:
    return with_rules(profile={"landed_hold": hold}, **settings)


def in_air(story: Story) -> bool | None:
    return flight.in_air(story.config, story.state, START + story.t)


def known(
    landed: LandedState = LandedState.ON_GROUND, armed: Armed = Armed.ARMED, **told: float
) -> State:
    """A state with these measurements, just made, and this word of the autopilot."""
    said = VehicleState(armed=armed, armed_age=0.0, landed_state=landed, landed_state_age=0.0)
    measurements = {name: Measured(value, NOW, NOW, 1) for name, value in told.items()}
    return changed(State(7, 0.0), vehicle=said, vehicle_received=NOW, measurements=measurements)


@pytest.mark.parametrize(
    ("age", "at", "fresh"),
    [
        (0.0, 2.5, True),
        (0.0, 2.6, False),
        # The age that it came with counts.
        (2.0, 0.4, True),
        (2.0, 0.6, False),
        # What claims to come from the future is not young for ever.
        (-1e6, 0.0, True),
        (-1e6, 2.6, False),
    ],
)
def test_what_is_old_says_nothing(age, at, fresh):
    story = Story()
    story.at(0.0, vehicle(age=age, armed=Armed.ARMED, landed_state=AIR))
    now = START + at
    armed = Armed.ARMED if fresh else Armed.UNKNOWN
    assert flight.armed(story.config, story.state, now) is armed
    assert flight.says_down(story.config, story.state, now) is (False if fresh else None)


@pytest.mark.parametrize(
    ("armed", "landed", "expected"),
    [
        (Armed.ARMED, AIR, True),
        (Armed.ARMED, LandedState.TAKING_OFF, True),
        (Armed.ARMED, LandedState.LANDING, True),
        (Armed.ARMED, GROUND, False),
        (Armed.DISARMED, GROUND, False),
        (Armed.DISARMED, NOTHING, False),
        # A barometer drifts, a land detector is mistaken: motors that are off do not take off.
        (Armed.DISARMED, AIR, False),
        (Armed.UNKNOWN, AIR, True),
        (Armed.UNKNOWN, NOTHING, None),
        (Armed.ARMED, NOTHING, None),
    ],
)
def test_before_the_flight(armed, landed, expected):
    story = Story()
    story.at(0.0, vehicle(armed=armed, landed_state=landed))
    assert in_air(story) is expected


@pytest.mark.parametrize(
    ("armed", "landed", "expected"),
    [
        (Armed.ARMED, AIR, True),
        (Armed.DISARMED, AIR, True),
        (Armed.ARMED, NOTHING, True),
        (Armed.UNKNOWN, NOTHING, None),
        (Armed.ARMED, GROUND, None),
        (Armed.DISARMED, GROUND, None),
        (Armed.DISARMED, NOTHING, None),
    ],
)
def test_in_flight_a_landing_is_believed_only_after_its_hold(armed, landed, expected):
    story = Story(landing()).flying()
    told = {"armed": armed, "landed_state": landed, "vertical_speed": -0.3, "acceleration": 9.8}
    story.at(0.5, vehicle(**told))
    assert in_air(story) is expected
    story.at(1.4, vehicle(**told))
    assert story.state.stage is Stage.IN_FLIGHT
    story.at(1.5, vehicle(**told))
    down = expected is None and armed is not Armed.UNKNOWN
    assert (story.state.stage is not Stage.IN_FLIGHT) == down


def test_the_core_wakes_when_a_landing_is_to_be_believed():
    story = Story(landing()).flying()
    story.at(0.5, vehicle(armed=Armed.ARMED, landed_state=GROUND))
    story.at(2.0)
    # Its links are silent by then, so that the next flight is blocked at once.
    assert "IN_FLIGHT -> LANDED" in story.said()
    assert story.state.stage is Stage.BLOCKED
    assert story.state.stage_since == START + 1.5


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"vertical_speed": -2.1}, "vertical_speed -2.1 m/s (nothing on the ground beyond 2)"),
        ({"vertical_speed": 2.1}, "vertical_speed 2.1 m/s (nothing on the ground beyond 2)"),
        ({"acceleration": 4.8}, "acceleration 4.8 m/s^2 (nothing on the ground below 4.9)"),
        ({"vertical_speed": -2.0, "acceleration": 4.9}, ""),
        ({"vertical_speed": math.nan, "acceleration": math.nan}, ""),
        ({}, ""),
    ],
)
def test_how_it_moves_as_nothing_on_the_ground_does(told, words):
    story = Story()
    story.at(0.0, vehicle(**told))
    assert flight.moving(story.config, story.state, START) == words


@pytest.mark.parametrize("sign", [{"vertical_speed": -5.0}, {"acceleration": 1.0}])
def test_a_landing_that_a_falling_vehicle_reports_is_not_believed(sign):
    story = Story(landing()).flying()
    sign, down = {"height": -1.0, **sign}, {"height": -1.0, "landed_state": GROUND}
    for armed in (Armed.ARMED, Armed.DISARMED):
        story.fly(story.t + 3.0, landed_state=GROUND, armed=armed, **sign)
        assert story.state.stage is Stage.IN_FLIGHT
        assert in_air(story) is True
    assert not flight.disarmed(story.config, story.state, START + story.t)
    # It has come to rest: from then on the hold counts.
    story.fly(story.t + 0.95, armed=Armed.DISARMED, **down)
    assert story.state.stage is Stage.IN_FLIGHT
    story.fly(story.t + 0.2, armed=Armed.DISARMED, **down)
    assert story.state.stage is Stage.READY


def test_the_height_of_an_autopilot_that_started_anew_is_not_used():
    story = Story(landing()).flying()
    story.fly(0.5, height=80.0)
    now = START + story.t
    assert readings.measured(story.config, story.state, "height", now) == pytest.approx(80.0)
    story.fly(1.0, height=0.0, reboot_count=1, rebooted_in_flight=True)
    now = START + story.t
    assert math.isnan(readings.measured(story.config, story.state, "height", now))
    assert "restarted" in readings.unusable(story.config, story.state, "height", now)
    assert readings.unusable(story.config, story.state, "acceleration", now) == ""


def take_off_at(story: Story, latitude: float) -> None:
    story.at(story.t + 0.1, story.heartbeat(), i.VehicleReport(STANDING))
    story.fly(story.t + 0.1, latitude=latitude)


@pytest.mark.parametrize("reset", [False, True])
def test_a_second_flight_from_another_place_has_another_home(reset):
    story = Story(with_rules(rule(FAR)))
    take_off_at(story, 48.0)
    for _ in range(20):
        story.at(story.t + 0.1, story.heartbeat(), i.VehicleReport(STANDING))
    if reset:
        story.at(story.t, i.ResetRequest(1))
        assert story.answer(1).success
    take_off_at(story, 48.5)
    story.fly(story.t + 1.0, latitude=48.5)
    assert story.state.flight.home == pytest.approx((48.5, 11.0))
    assert story.fired() == []


@pytest.mark.parametrize("latitude", [math.nan, math.inf, 91.0])
def test_a_place_that_is_none_is_no_home(latitude):
    story = Story(with_rules(rule(FAR)))
    take_off_at(story, latitude)
    assert story.state.flight.home is None
    story.fly(story.t + 0.5, latitude=latitude)
    assert story.fired() == []


def test_a_vehicle_state_of_nothing_raises_nothing():
    story = Story().flying()
    story.at(0.1, i.VehicleReport(VehicleState()))
    assert in_air(story) is None
    assert story.state.stage is Stage.IN_FLIGHT


# -- signs against its word ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("told", "in_air"),
    [
        # One that says that it stands falls with the accelerometer and one more sign.
        ({"acceleration": 4.8, "vertical_speed": -2.1}, True),
        ({"acceleration": 4.9, "vertical_speed": -2.1}, False),
        ({"acceleration": 4.8, "vertical_speed": -2.0}, False),
        ({"acceleration": 4.8, "vertical_speed": 0.0, "height": 10.1}, True),
        ({"acceleration": 4.8, "vertical_speed": 0.0, "height": 10.0}, False),
        ({"acceleration": 9.8, "vertical_speed": -9.0, "height": 50.0}, False),
        # How high it is counts from where it was armed.
        ({"acceleration": 1.0, "height": 40.0, "armed_height": 30.0}, False),
        ({"acceleration": 1.0, "height": 40.1, "armed_height": 30.0}, True),
        # Without a landed state it flies above the height of a take-off.
        ({"height": 32.0, "armed_height": 30.0, "landed": NOTHING}, False),
        ({"height": 32.1, "armed_height": 30.0, "landed": NOTHING}, True),
        ({"height": 2.1, "landed": NOTHING}, True),
        ({"height": 1.9, "landed": NOTHING}, False),
        ({"height": 50.0, "landed": NOTHING, "armed": Armed.DISARMED}, False),
        ({"height": 50.0, "landed": NOTHING, "armed": Armed.UNKNOWN}, None),
    ],
)
def test_whether_it_is_in_the_air(told, in_air):
    parts = {**told}
    armed_height = parts.pop("armed_height", 0.0)
    state = changed(known(**parts), armed_height=armed_height)
    assert flight.in_air(CONFIG, state, NOW) is in_air


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
    landed_at, height, in_air
):
    told = known(armed=Armed.DISARMED, acceleration=1.0, vertical_speed=-9.0, height=height)
    assert flight.in_air(CONFIG, changed(told, landed_at=landed_at), NOW) is in_air


@pytest.mark.parametrize(
    ("height", "armed_height", "hold"),
    [(10.1, 0.0, 5.0), (10.0, 0.0, 1.0), (35.0, 30.0, 1.0), (40.1, 30.0, 5.0)],
)
def test_how_high_above_where_it_was_armed_a_landing_takes_longer(height, armed_height, hold):
    config = SupervisorConfig(profile=Profile("tested", (), minimum_height=10.0, landed_hold=1.0))
    state = changed(known(height=height), armed_height=armed_height)
    assert flight.landed_hold(config, state) == hold
    off = changed(known(armed=Armed.DISARMED, height=height), armed_height=armed_height)
    assert flight.landed_hold(config, off) == 1.0


def test_a_word_of_disarmed_in_the_air_moves_no_ground():
    """Given a wrong heartbeat at 50 m, then a land detector that is wrong for 3 s."""
    story = Story(shipped("multirotor")).ready()
    story.fly(1.0, height=0.0, landed_state=LandedState.ON_GROUND).fly(3.0)
    story.fly(4.0, armed=Armed.DISARMED)
    story.fly(5.0)
    story.fly(8.0, landed_state=LandedState.ON_GROUND)
    assert story.state.flight.armed_height == pytest.approx(0.0, abs=0.1)
    assert story.state.stage is Stage.IN_FLIGHT


def test_one_without_a_height_is_taken_to_be_high_enough_just_so_long_after_its_take_off():
    profile = {"minimum_height": 10.0, "below_minimum": BelowMinimum.KILL}
    story = Story(with_rules(profile=profile)).flying()
    story.fly(4.95, height=math.nan)
    why = gate.too_low(story.config, story.state, story.state.own.updated_at)
    assert why == "it was never seen at the minimum height, 10 m"
    story.fly(5.05, height=math.nan)
    assert gate.too_low(story.config, story.state, story.state.own.updated_at) == ""


# -- what the heights tell -----------------------------------------------------------------------


def told_by_heights(*heights: tuple[float, float]) -> State:
    """The last of these (t, height) is the newest that was measured."""
    height = Measured(heights[-1][1], heights[-1][0], heights[-1][0], len(heights))
    return changed(State(7, 0.0), measurements={"height": height}, heights=heights)


FALLS = told_by_heights((0.0, 50.0), (0.2, 47.0), (0.4, 44.0))


def test_a_climb_rate_needs_heights_just_so_far_apart_of_which_the_newest_counts():
    assert readings.climb_rate(CONFIG, FALLS, 0.4) == pytest.approx(-15.0)
    near = told_by_heights((0.1, 50.0), (0.2, 47.0), (0.4, 44.0))
    assert math.isnan(readings.climb_rate(CONFIG, near, 0.4))
    assert math.isnan(readings.climb_rate(CONFIG, FALLS, 9.0)), "the newest is old"
    assert math.isnan(readings.climb_rate(CONFIG, changed(FALLS, heights=()), 0.4))


def test_one_that_started_anew_falls_as_fast_but_it_is_no_sign_of_its_own():
    anew = changed(FALLS, rebooted=True)
    rate = readings.climb_rate(CONFIG, FALLS, 0.4)
    assert readings.climb_rate(CONFIG, anew, 0.4) == rate == pytest.approx(-15.0)
    assert readings.measured(CONFIG, anew, "vertical_speed", 0.4) == rate
    assert readings.measured(CONFIG, FALLS, "climb_rate", 0.4) == rate
    for name in ("climb_rate", "height"):
        value, why = readings.reading(CONFIG, anew, name, 0.4)
        assert math.isnan(value)
        assert why == "the autopilot restarted in flight, and its height with it"


@pytest.mark.parametrize(
    ("heights", "rate", "why"),
    [
        ([50.0, 50.0, 50.0], math.nan, "too few heights that can be used"),
        # It creeps up, by 1 m/s, but for one step down: where the middle and the whole tell
        # opposite ways it neither climbs nor sinks.
        ([0.0, 0.1, 0.2, 0.3, 0.4, -2.0, -1.9, -1.8, -1.7, -1.6], 0.0, ""),
        # It falls with 40 m/s, and its barometer measures half as often as it is read.
        ([200.0 - 8.0 * (n // 2) for n in range(10)], -40.0, ""),
        # One step of what stands is none, however few samples there are.
        ([50.0, 50.0, 50.0, 50.0, 50.0, 40.0], 0.0, ""),
        # It stands: what is the same for longer is no sample that was told again.
        ([50.0] * 10, 0.0, ""),
        # A slow climb is one.
        ([0.05 * n for n in range(9)], 0.5, ""),
    ],
)
def test_what_heights_tell_that_come_each_tenth_of_a_second(heights, rate, why):
    state = told_by_heights(*((n / 10, height) for n, height in enumerate(heights)))
    told = readings.reading(CONFIG, state, "climb_rate", (len(heights) - 1) / 10)
    assert told == (pytest.approx(rate, nan_ok=True), why)


# -- since a kill --------------------------------------------------------------------------------


def killed(speed: float = math.nan, force: float = math.nan, at: float = NOW) -> State:
    """Killed at NOW - 2.0, 100 m high, sinking by 1 m/s; at that time this was told last."""
    told = {"vertical_speed": speed, "acceleration": force}
    return changed(
        known(),
        killed_in_flight=True,
        killed_at=NOW - 2.0,
        killed_height=100.0,
        killed_sinking=1.0,
        measurements={
            name: Measured(value, at, at, 1)
            for name, value in told.items()
            if not math.isnan(value)
        },
    )


LEFT = pytest.approx(100.0 - 2.0 - 9.81 * 2.0)


def test_the_height_that_is_left_since_a_kill():
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
def test_what_was_seen_since_the_kill(told, falls):
    left = flight.height_since_kill(CONFIG, killed(**told), NOW)
    assert left == LEFT if falls else math.isnan(left)


@pytest.mark.parametrize(("before", "silent"), [(1.0, True), (1.01, False), (-0.5, True)])
def test_one_that_was_not_heard_until_its_kill_is_not_silent_since(before, silent):
    links = dict.fromkeys(CONFIG.kill_links, LinkEvidence(heard=NOW - 0.1))
    state = changed(killed(), vehicle_received=NOW - 2.0 - before, links=links)
    assert flight.silent_since_kill(CONFIG, state, NOW) is silent
    assert not flight.silent_since_kill(CONFIG, changed(state, links={}), NOW)
