"""In the air, moving, disarmed: what is known is fused, and what contradicts it not believed."""

import math
from typing import Any

import pytest
from story import FLYING, STANDING, START, Story, rule, vehicle, with_rules

from chute_ros.model import Armed, LandedState, VehicleState
from chute_ros.supervisor import flight, readings
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage

GROUND, AIR = LandedState.ON_GROUND, LandedState.IN_AIR
NOTHING = LandedState.UNKNOWN
FAR = MeasurementCondition("distance_from_home", above=100.0)


def landing(hold: float = 1.0, **settings: Any) -> SupervisorConfig:
    return with_rules(profile={"landed_hold": hold}, **settings)


def in_air(story: Story) -> bool | None:
    return flight.in_air(story.config, story.state, START + story.t)


def test_what_is_old_says_nothing() -> None:
    story = Story()
    story.at(0.0, i.VehicleReport(FLYING))
    assert flight.armed(story.config, story.state, START + 2.5) is Armed.ARMED
    assert flight.armed(story.config, story.state, START + 2.6) is Armed.UNKNOWN
    assert flight.says_down(story.config, story.state, START + 2.5) is False
    assert flight.says_down(story.config, story.state, START + 2.6) is None


def test_the_age_that_it_came_with_counts() -> None:
    story = Story()
    story.at(0.0, vehicle(age=2.0, armed=Armed.ARMED, landed_state=AIR))
    assert flight.armed(story.config, story.state, START + 0.4) is Armed.ARMED
    assert flight.armed(story.config, story.state, START + 0.6) is Armed.UNKNOWN


def test_what_claims_to_come_from_the_future_is_not_young_for_ever() -> None:
    story = Story()
    story.at(0.0, vehicle(age=-1e6, armed=Armed.ARMED, landed_state=AIR))
    assert flight.armed(story.config, story.state, START + 2.6) is Armed.UNKNOWN
    assert in_air(story) is True
    story.at(2.6)
    assert flight.says_down(story.config, story.state, START + 2.6) is None


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
def test_before_the_flight(armed: Armed, landed: LandedState, expected: bool | None) -> None:
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
def test_in_flight_a_landing_is_believed_only_after_its_hold(
    armed: Armed, landed: LandedState, expected: bool | None
) -> None:
    story = Story(landing()).flying()
    told = {"armed": armed, "landed_state": landed, "vertical_speed": -0.3, "acceleration": 9.8}
    story.at(0.5, vehicle(**told))
    assert in_air(story) is expected
    story.at(1.4, vehicle(**told))
    assert story.state.stage is Stage.IN_FLIGHT
    story.at(1.5, vehicle(**told))
    down = expected is None and armed is not Armed.UNKNOWN
    assert (story.state.stage is not Stage.IN_FLIGHT) == down


def test_the_core_wakes_when_a_landing_is_to_be_believed() -> None:
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
def test_how_it_moves_as_nothing_on_the_ground_does(told: dict[str, float], words: str) -> None:
    story = Story()
    story.at(0.0, vehicle(**told))
    assert flight.moving(story.config, story.state, START) == words


@pytest.mark.parametrize("sign", [{"vertical_speed": -5.0}, {"acceleration": 1.0}])
def test_a_landing_that_a_falling_vehicle_reports_is_not_believed(sign: dict[str, float]) -> None:
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


def test_the_height_of_an_autopilot_that_started_anew_is_not_used() -> None:
    story = Story(landing()).flying()
    story.fly(0.5, height=80.0)
    now = START + story.t
    assert readings.measured(story.config, story.state, "height", now) == pytest.approx(80.0)
    story.fly(1.0, height=0.0, reboot_count=1, rebooted_in_flight=True)
    now = START + story.t
    assert math.isnan(readings.measured(story.config, story.state, "height", now))
    assert "started anew" in readings.unusable(story.config, story.state, "height", now)
    assert readings.unusable(story.config, story.state, "acceleration", now) == ""


def test_a_restart_that_is_only_counted_is_none_in_flight() -> None:
    story = Story(landing()).flying()
    story.fly(0.2, reboot_count=1)
    assert not story.state.flight.rebooted


def test_the_height_at_which_it_was_armed_is_the_ground() -> None:
    story = Story()
    story.at(0.0, story.heartbeat(), vehicle(armed=Armed.DISARMED, height=30.0))
    story.at(0.1, story.heartbeat(), vehicle(armed=Armed.ARMED, height=30.5))
    assert story.state.flight.armed_height == 30.5
    assert in_air(story) is False
    story.at(0.2, story.heartbeat(), vehicle(armed=Armed.ARMED, height=32.6))
    assert story.state.stage is Stage.IN_FLIGHT


def test_without_a_height_it_is_armed_on_the_ground() -> None:
    story = Story()
    story.at(0.0, i.VehicleReport(STANDING))
    story.at(0.1, vehicle(armed=Armed.ARMED))
    assert story.state.flight.armed_height == 0.0


def take_off_at(story: Story, latitude: float) -> None:
    story.at(story.t + 0.1, story.heartbeat(), i.VehicleReport(STANDING))
    story.fly(story.t + 0.1, latitude=latitude)


def test_home_is_where_it_took_off() -> None:
    story = Story(with_rules(rule(FAR)))
    take_off_at(story, 48.0)
    assert story.state.flight.home == pytest.approx((48.0, 11.0))
    story.fly(story.t + 0.5, latitude=48.0005)
    assert story.state.measured("distance_from_home").value == pytest.approx(55.6, abs=0.1)


@pytest.mark.parametrize("reset", [False, True])
def test_a_second_flight_from_another_place_has_another_home(reset: bool) -> None:
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


def test_one_that_bounces_keeps_its_home() -> None:
    story = Story(landing(0.0))
    take_off_at(story, 48.0)
    story.fly(story.t + 0.2, latitude=48.01, landed_state=GROUND)
    assert story.state.stage is Stage.LANDED
    story.fly(story.t + 0.2, latitude=48.01)
    assert story.state.stage is Stage.IN_FLIGHT
    assert story.state.flight.home == pytest.approx((48.0, 11.0))


@pytest.mark.parametrize("latitude", [math.nan, math.inf, 91.0])
def test_a_place_that_is_none_is_no_home(latitude: float) -> None:
    story = Story(with_rules(rule(FAR)))
    take_off_at(story, latitude)
    assert story.state.flight.home is None
    story.fly(story.t + 0.5, latitude=latitude)
    assert story.fired() == []


def test_a_vehicle_state_of_nothing_raises_nothing() -> None:
    story = Story().flying()
    story.at(0.1, i.VehicleReport(VehicleState()))
    assert in_air(story) is None
    assert story.state.stage is Stage.IN_FLIGHT
