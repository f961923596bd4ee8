"""The automatic deployment on the flight model: in time when it must be, and never otherwise."""

import math

import pytest
from upf_device_bench import KILL, Story

from chute_ros.links.upf.simulator.automatic import ApsLimits, AutomaticDeployment
from chute_ros.model import ParachuteState as S
from chute_ros.sim.flight import FlightModel
from chute_ros.sim.motion import Motion


def flying(height, climb_speed=6.0, **more):
    """A vehicle that has climbed to this height, with a parachute that does all by itself."""
    story = Story(**more).run(1.0)
    story.flight = FlightModel(climb_speed=climb_speed, armed=True, target_height=height)
    story.until(lambda: story.flight.height > height - 0.5, 120.0)
    story.run(5.0)
    return story


def fail(story):
    """The motors fail; s and m until the canopy leaves."""
    story.flight.motors_failed = True
    before = story.flight.height
    seconds = story.until(lambda: story.trigger.fired, 5.0)
    return seconds, before - story.flight.height


def test_motors_that_fail_at_60_m_launch_it_in_time():
    story = flying(60.0)
    assert story.state is S.ARMED
    seconds, lost = fail(story)
    assert seconds < 1.0
    assert lost < 5.0
    assert story.asked()[-1] == KILL
    story.until(lambda: story.flight.on_ground)
    assert story.run(0.2).state is S.LAUNCHED
    story.until(lambda: story.state is S.TOUCHDOWN, 6.0)


def test_it_comes_down_no_faster_than_its_canopy_lets_it():
    story = flying(60.0)
    fail(story)
    story.until(lambda: story.flight.height < 5.0)
    assert -story.flight.vertical_speed < story.flight.canopy_speed * 1.1


def test_from_any_height_in_flight_it_launches_in_a_second():
    for height in (15.0, 30.0, 200.0):
        seconds, _ = fail(flying(height))
        assert seconds < 1.0, height


def test_a_vehicle_that_does_not_answer_costs_only_the_wait():
    story = flying(60.0, kill_wait=0.5)
    story.vehicle.results[KILL] = None
    seconds, _ = fail(story)
    assert seconds < 1.5
    story.until(lambda: story.flight.height < 5.0)
    assert -story.flight.vertical_speed < story.flight.canopy_speed * 1.1


def test_motors_that_fail_on_the_way_up_launch_it():
    story = Story().run(1.0)
    story.flight = FlightModel(armed=True, target_height=60.0)
    story.until(lambda: story.flight.height > 30.0)
    seconds, _ = fail(story)
    assert seconds < 1.5, "it rises on for a moment"


@pytest.mark.parametrize("climb_speed", [3.0, 6.0, 12.0])
def test_a_hard_but_normal_flight_does_not_launch_it(climb_speed):
    """Given a fast climb: at 40 m back down at full speed, up again, a hover, a landing."""
    story = Story().run(1.0)
    story.flight = FlightModel(climb_speed=climb_speed, armed=True, target_height=60.0)
    story.until(lambda: story.flight.height > 40.0)
    story.flight.target_height = 20.0
    story.run(8.0)
    story.flight.target_height = 60.0
    story.run(30.0)
    assert story.state is S.ARMED
    story.flight.target_height = 0.0
    story.until(lambda: story.flight.on_ground)
    story.run(5.0)
    assert not story.trigger.fired
    expected = [S.NOT_READY, S.READY, S.TAKEOFF, S.ARMED, S.TAKEOFF, S.READY]
    assert story.states() == expected
    assert KILL not in story.asked()


def test_a_fast_descent_and_a_steep_turn_within_limits_do_not_launch_it():
    for speed, tilt in ((-5.0, 0.0), (-7.5, 0.5), (0.0, 1.0), (15.0, 0.6)):
        story = flying(60.0)
        story.flight = None
        story.at(50.0, vertical_speed=speed, tilt=tilt).run(10.0)
        assert not story.trigger.fired, (speed, tilt)


def test_below_the_minimum_height_it_does_not_launch():
    story = Story(aps=ApsLimits(minimum_height=20.0)).run(1.0)
    story.flight = FlightModel(armed=True, target_height=18.0)
    story.run(20.0)
    assert story.state is S.ARMED
    story.flight.motors_failed = True
    story.until(lambda: story.flight.on_ground)
    assert not story.run(5.0).trigger.fired


@pytest.mark.parametrize("height", [0.0, 5.0, 9.0])
def test_before_it_is_armed_it_does_not_launch(height):
    story = Story().run(1.0)
    story.flight = FlightModel(armed=True, target_height=height)
    story.run(10.0)
    story.flight.motors_failed = True
    assert not story.run(5.0).trigger.fired


# The conditions one by one


def test_what_holds_for_long_enough_is_an_accident():
    for motion, word in (
        (Motion(50.0, -9.0), "sinks"),
        (Motion(50.0, -2.0, acceleration=1.0), "free fall"),
        (Motion(50.0, tilt=math.pi), "tilted"),
    ):
        aps = AutomaticDeployment(ApsLimits(hold=0.3))
        assert aps.accident(motion, 10.0) == ""
        assert aps.accident(motion, 10.25) == ""
        assert word in aps.accident(motion, 10.31)
    # Whoever rises does not fall freely, and what is not known is no accident.
    for motion in (Motion(50.0, 4.0, acceleration=0.2), Motion(*[math.nan] * 4)):
        aps = AutomaticDeployment(ApsLimits())
        for now in (10.0, 10.5, 11.0, 20.0):
            assert aps.accident(motion, now) == "", motion


def test_a_moment_of_normal_flight_begins_it_anew():
    aps = AutomaticDeployment(ApsLimits(hold=0.3))
    falling = Motion(50.0, -9.0)
    aps.accident(falling, 10.0)
    aps.accident(Motion(50.0), 10.2)
    aps.accident(falling, 10.25)
    assert aps.accident(falling, 10.5) == ""
    aps.reset()
    assert aps.accident(falling, 10.6) == ""
