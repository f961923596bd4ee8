"""A sink that nobody commanded is an accident, upright or not; one that was commanded is none."""

import math
import random
from collections.abc import Callable
from dataclasses import replace

import pytest
from story import DOWN, Story, pressure_at, shipped

from chute_ros.model import Action, Armed, LandedState, LinkState, VehicleState
from chute_ros.supervisor import inputs as i

EVERY = 0.1
AIRCRAFT = pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])


def sinking(profile: str, fastest: float, barometer: bool = True, **told: float) -> Story:
    """From 110 m, level, to the ground. told: what was commanded."""
    story, height, speed, k = Story(shipped(profile)).ready(), 110.0, 0.0, 0

    def tell(height: float, speed: float, force: float, **more: object) -> None:
        parts = {"height": height, "vertical_speed": speed, "acceleration": force, **more}
        if barometer:
            parts["pressure"] = pressure_at(height + 0.1 * (k % 3))
        story.at(story.t + EVERY, story.heartbeat(), story.told(tilt=8.0, **parts))

    for _ in range(10):
        tell(0.0, 0.0, 9.8, **DOWN)
    for k in range(30):
        tell(110.0, 0.1 * (k % 2), 9.8 + 0.1 * (k % 3))
    while height > 1.0 and not story.fired():
        k += 1
        speed = max(-fastest, speed - 0.35)
        height += EVERY * speed
        tell(height, speed, 9.8 - 3.5 * (speed > -fastest) + 0.1 * (k % 3), **told)
    return story


@pytest.mark.parametrize("fastest", [8.0, 10.0, 11.5])
@pytest.mark.parametrize("barometer", [True, False])
@pytest.mark.parametrize("told", [{"target_vertical_speed": 0.0}, {"below_target": 4.0}])
def test_a_level_sink_that_nobody_commanded_is_deployed_in_time(fastest, barometer, told):
    story = sinking("multirotor", fastest, barometer, **told)
    assert story.fired() == ["KILL"]
    assert story.newest(Action.KILL).rule == "uncommanded sink"
    assert story.state.measured("height").value > 80.0
    assert any("sinks fast" in one for one in story.alarms())


#: Vertical speeds of an ArduPlane (quadplane) with two opposite motors dead in a hover, each
#: 0.5 s, m/s: one that sank from 40 m to the ground, and one that caught itself.
SANK = (-0.2, -2.4, -4.4, -5.5, -6.7, -6.2, -4.5, -4.6, -5.4, -6.5, -5.9, -5.0, -5.8, -7.0)
CAUGHT = (-0.2, -1.3, -3.4, -4.9, -6.5, -5.1, -1.0, -0.6, -1.3, -0.8, -1.6, -1.7, -1.2, -1.8)


@pytest.mark.parametrize(("speeds", "released"), [(SANK, True), (CAUGHT, False)])
@pytest.mark.parametrize("told", [{"target_vertical_speed": 0.0}, {}])
def test_one_that_sinks_on_by_fits_and_starts_is_deployed_and_one_that_is_caught_is_not(
    speeds, released, told
):
    """Seen of the first: `uncommanded sink` for 6.3 s, and killed at 9.6 m, too low to deploy."""
    story, height = Story(shipped("multirotor")).ready(), 40.0
    for k in range(5 * (len(speeds) - 1)):
        before, after = speeds[k // 5 : k // 5 + 2]
        speed = before + (after - before) * (k % 5) / 5.0
        height += EVERY * speed
        parts = {"height": height, "vertical_speed": speed, "below_target": 40.0 - height, **told}
        parts |= {"acceleration": 9.8 + 2.0 * (after - before) + 0.1 * (k % 3), "tilt": 20.0}
        parts["pressure"] = pressure_at(height + 0.1 * (k % 3))
        story.at(story.t + EVERY, story.heartbeat(), story.told(**parts))
        if story.fired():
            break
    assert bool(story.fired()) is released
    if released:
        assert story.newest(Action.KILL).rule == "sinks on"
        assert height > 15.0


@AIRCRAFT
@pytest.mark.parametrize("fastest", [8.0, 10.0])
def test_where_no_target_is_told_it_is_an_alarm(profile, fastest):
    story = sinking(profile, fastest)
    assert story.fired() == []
    assert sum("sinks fast" in one for one in story.alarms()) == 1


@AIRCRAFT
@pytest.mark.parametrize("fastest", [5.0, 8.0, 13.0])
def test_one_that_was_commanded_is_neither(profile, fastest):
    story = sinking(profile, fastest, target_vertical_speed=-fastest)
    assert story.fired() == []
    assert not any("sinks fast" in one for one in story.alarms())


@AIRCRAFT
@pytest.mark.parametrize("pulls", [3.0, 5.0])
@pytest.mark.parametrize("barometer", [True, False])
def test_one_that_pulls_out_of_a_dive_is_no_accident(profile, pulls, barometer):
    """ArduPlane, 30 degrees down by the pilot's stick, then CIRCLE, which keeps the height of that
    moment: below it until it climbs again."""
    story, height, speed, target = Story(shipped(profile)).ready(), 120.0, 0.0, float("nan")
    for k in range(120):
        dives = k < 60
        fastest = 15.0 if profile == "fixed_wing" else 9.0
        speed = max(speed - 0.5, -fastest) if dives else min(speed + EVERY * pulls, 0.0)
        height += EVERY * speed
        if k == 60:
            target = height
        told = {} if dives else {"below_target": target - height, "attitude_error": 5.0}
        if barometer:
            told["pressure"] = pressure_at(height + 0.1 * (k % 3))
        force = 9.8 + 0.1 * (k % 3) + (0.0 if dives else pulls)
        parts = {"height": height, "vertical_speed": speed, "acceleration": force, "tilt": 20.0}
        story.at(story.t + EVERY, story.heartbeat(), story.told(**parts, **told))
        if not dives and speed == 0.0:
            break
    assert story.fired() == []


def aeroplane_sinks(tilt: float, attitude_error: float) -> Story:
    """With 17 m/s for seconds, from high up."""
    story, height, speed = Story(shipped("fixed_wing")).ready(), 300.0, 0.0
    for k in range(60):
        speed = max(speed - 0.8, -17.0)
        height += EVERY * speed
        parts = {"height": height, "vertical_speed": speed, "tilt": tilt + 0.1 * (k % 3)}
        parts |= {"acceleration": 9.6 + 0.1 * (k % 3), "attitude_error": attitude_error}
        parts["pressure"] = pressure_at(height + 0.1 * (k % 3))
        story.at(story.t + EVERY, story.heartbeat(), story.told(**parts))
    return story


def test_a_dive_that_a_pilot_commands_is_no_critical_sink():
    """ArduPlane in FBWA, the stick forward: 30 degrees down, 16 m/s, and its attitude follows."""
    story = aeroplane_sinks(tilt=31.0, attitude_error=3.0)
    assert story.fired() == []
    assert any("sinks fast" in one for one in story.alarms())


@pytest.mark.parametrize(
    ("tilt", "attitude_error"), [(31.0, 60.0), (5.0, 3.0), (31.0, float("nan"))]
)
def test_one_that_lies_otherwise_or_flat_or_tells_no_command_is(tilt, attitude_error):
    story = aeroplane_sinks(tilt, attitude_error)
    assert story.fired()[:1] == ["KILL"]
    off = attitude_error > 45.0
    assert story.newest(Action.KILL).rule == ("off its command" if off else "critical sink")


def spiral(
    attitude_error: float, barometer_sinks: bool = True, hovers_from: float = math.inf
) -> Story:
    """An aeroplane banks to 70 degrees and goes down with 15 m/s after 3 s, at 2.3 times its
    weight; how far it is from its command, degrees. Its estimator tells no sink from so long
    after the start of it, s."""
    story, true, height = Story(shipped("fixed_wing")).ready(), 300.0, 300.0
    for k in range(80):
        t = max(EVERY * (k - 20), 0.0)
        speed = -min(5.0 * t, 15.0)
        true += EVERY * speed * barometer_sinks
        height += EVERY * speed
        bank = min(70.0 * t, 70.0)
        parts = {"height": height, "vertical_speed": speed}
        if t > hovers_from:
            parts = {"height": 300.0, "vertical_speed": 0.1 * (k % 3)}
        parts |= {"tilt": bank + 0.1 * (k % 3), "attitude_error": min(attitude_error, bank)}
        turns = bool(t) and barometer_sinks
        parts["acceleration"] = (22.0 if turns else 9.8) + 0.1 * (k % 3)
        parts["pressure"] = pressure_at(true + 0.1 * (k % 3))
        story.at(story.t + EVERY, story.heartbeat(), story.told(**parts))
        if story.fired():
            break
    return story


def test_an_aeroplane_that_is_far_from_its_command_and_sinks_is_deployed_before_it_is_fast():
    story = spiral(attitude_error=68.0)
    assert story.fired() == ["KILL"]
    assert story.newest(Action.KILL).rule == "off its command"
    assert story.when(Action.KILL) - 2.0 < 3.0


@pytest.mark.parametrize("hovers_from", [0.0, 1.9])
def test_so_is_one_whose_estimator_tells_no_sink(hovers_from):
    story = spiral(attitude_error=68.0, hovers_from=hovers_from)
    assert story.fired() == ["KILL"]
    assert story.newest(Action.KILL).rule == "off its command"
    assert story.when(Action.KILL) - 2.0 < 3.5


@pytest.mark.parametrize(
    "but",
    [{"attitude_error": 20.0}, {"barometer_sinks": False}],
    ids=["a dive that is commanded", "an estimator that is wrong alone"],
)
def test_by_less_than_that_none_is(but):
    story = spiral(**{"attitude_error": 68.0, **but})
    assert "off its command" not in {one.rule for one in story.decisions()}


@pytest.mark.parametrize(
    "told", [{"below_target": -100.0}, {"below_target": -100.0, "attitude_error": 0.0}]
)
@pytest.mark.parametrize("off", [{}, DOWN])
def test_a_height_that_was_commanded_far_below_hides_no_fall(told, off):
    """ArduCopter in GUIDED after its take-off: POSITION_TARGET_LOCAL_NED with z 0 in a hover. It
    was disarmed by the ground station, and nothing was released."""
    story = Story(shipped("multirotor")).ready().fly(2.0, **told)
    assert story.fall(story.t + 1.5, **told, **off).fired()[:1] == ["KILL"]


@pytest.mark.parametrize("told", [{"target_vertical_speed": -9.0}])
def test_nothing_is_commanded_of_motors_that_are_off(told):
    story = Story(shipped("multirotor")).ready().fly(2.0)
    assert story.fall(story.t + 1.5, **told, **DOWN).fired()[:1] == ["KILL"]


def test_above_the_commanded_height_no_sink_is_missed_and_none_made_up():
    assert sinking("multirotor", 5.0, below_target=-8.0).fired() == []


@pytest.mark.parametrize("told", [{}, {"attitude_error": 90.0}])
def test_a_tilt_that_nobody_commanded_is_an_accident(told):
    story = Story(shipped("multirotor")).ready().fly(1.0)
    for k in range(20):
        speed = -0.45 * k
        story.fly(story.t + 0.05, tilt=min(85.0, 12.0 * k), vertical_speed=speed, **told)
    assert story.fired() == ["KILL"]


def test_a_commanded_one_is_none():
    """A flip, and a dive of 65 degrees."""
    story = Story(shipped("multirotor")).ready().fly(1.0)
    for k in range(40):
        speed, tilt = max(-5.0, -0.45 * k), min(65.0, 12.0 * k)
        story.fly(story.t + 0.05, tilt=tilt, vertical_speed=speed, attitude_error=4.0)
    assert story.fired() == []


@AIRCRAFT
@pytest.mark.parametrize("target", [0.0, -9.0])
def test_a_speed_that_is_noise_hides_no_sink_that_heights_and_barometer_tell(profile, target):
    story, height, chance = Story(shipped(profile)).ready(), 110.0, random.Random(7)
    for k in range(80):
        height -= 0.9 * (k >= 30)
        speed = 0.1 * (k % 2) if k < 30 else chance.uniform(-25.0, 10.0)
        parts = {"height": height, "vertical_speed": speed, "target_vertical_speed": target}
        parts["pressure"] = pressure_at(height + 0.1 * (k % 3))
        force = 9.8 + 0.1 * (k % 3)
        story.at(story.t + EVERY, story.heartbeat(), story.told(acceleration=force, **parts))
    if target:
        assert story.fired() == []
    else:
        assert story.newest(Action.KILL).rule == "uncommanded sink"


@AIRCRAFT
@pytest.mark.parametrize("target", [0.0, -9.0])
def test_nor_does_one_that_stands(profile, target):
    """Given a speed of exactly 0 from before it sinks on, with 9 m/s, to the ground."""
    story, height, sank = Story(shipped(profile)).ready(), 110.0, 0.0
    for k in range(140):
        sank = min(9.0, max(0.0, 0.3 * (k - 40)))
        height -= EVERY * sank
        parts = {"height": height, "pressure": pressure_at(height + 0.1 * (k % 3)), "tilt": 8.0}
        parts |= {"acceleration": 9.8 + 0.1 * (k % 3), "target_vertical_speed": target * (k > 40)}
        report = story.told(**parts).state
        story.at(
            story.t + EVERY,
            story.heartbeat(),
            i.VehicleReport(replace(report, vertical_speed=0.0 if k > 30 else 0.01 * (k % 3))),
        )
    assert bool(story.fired()) is (target == 0.0)
    if story.fired():
        assert story.newest(Action.KILL).rule == "uncommanded sink"
        assert story.when(Action.KILL) < 9.0  # it sinks with 5 m/s from 5.7 s on


@AIRCRAFT
def test_a_speed_that_stands_in_a_hover_ends_nothing(profile):
    """Given whole cm/s, and a barometer that errs."""
    story = Story(shipped(profile)).ready()
    for k in range(300):
        parts = {"height": 60.0 + 0.2 * (k % 2), "pressure": pressure_at(60.0 + 0.4 * (k % 3))}
        report = story.told(**parts, target_vertical_speed=0.0, tilt=3.0).state
        told = i.VehicleReport(replace(report, vertical_speed=0.0))
        story.at(story.t + EVERY, story.heartbeat(), told)
    assert story.fired() == []


def speeding_up(by: float, lags: float) -> Story:
    """A descent begins with so much, m/s^2, or a fall beyond it, and the attitude turns over at
    once. lags: m/s by which the vehicle is slower than its command; negative: faster."""
    story = Story(shipped("multirotor")).ready().fly(2.0, target_vertical_speed=0.0)
    for k in range(1, 25):
        speed = -0.05 * k * by
        told = {"height": 50.0 - 0.5 * by * (0.05 * k) ** 2, "vertical_speed": speed}
        tilt = min(60.0 * k, 168.0 + 0.1 * (k % 3))
        told |= {"acceleration": 9.8 - by + 0.1 * (k % 3), "tilt": tilt}
        told |= {
            "attitude_error": 167.0,
            "target_vertical_speed": speed - lags * min(1.0, 0.1 * k),
        }
        story.fly(story.t + 0.05, 0.05, **told)
    return story


@pytest.mark.parametrize("by", [2.9, 3.5, 4.5])
def test_an_attitude_that_is_wrong_as_a_descent_begins_ends_no_flight(by):
    """PX4 (MPC_ACC_DOWN_MAX 3) feels 6.8 m/s^2 as it begins one."""
    assert speeding_up(by, 0.5).fired() == []


@pytest.mark.parametrize("by", [4.5, 6.0])
def test_one_that_lies_on_its_back_and_comes_down_faster_than_it_shall_falls(by):
    assert speeding_up(by, -2.0).fired()[:1] == ["KILL"]


# -- the last command of an autopilot that falls silent ------------------------------------------


def silent(
    story: Story,
    seconds: float,
    told: Callable[[float], dict[str, float]],
    target: float = -8.9,
) -> Story:
    """An odometry reports on (told: t s after the silence began); of the autopilot nothing new,
    and after a while what it reported is gone."""
    began = story.t
    while story.t < began + seconds and not story.fired():
        t = story.t + 0.1 - began
        state = VehicleState(
            link_state=LinkState.OK if t < 2.5 else LinkState.LOST,
            armed=Armed.ARMED,
            armed_age=t + 0.1,
            landed_state=LandedState.IN_AIR,
            landed_state_age=t + 0.1,
            target_vertical_speed=target if t < 3.0 else math.nan,
            target_age=t + 0.1 if t < 3.0 else math.nan,
            tilt=math.radians(5.0 + 0.01 * (story.t % 7)),
            attitude_age=0.0,
            height_age=0.0,
            vertical_speed_age=0.0,
            **told(t),
        )
        story.at(story.t + 0.1, story.heartbeat(), i.VehicleReport(state))
    return story


def descending(target: float = -8.9) -> Story:
    """It comes down with 8.9 m/s, as it was commanded or not."""
    story = Story(shipped("multirotor")).ready().fly(2.0, height=160.0)
    for step in range(1, 21):
        sink = {"height": 160.0 - 0.89 * step, "vertical_speed": -8.9}
        story.fly(story.t + 0.1, 0.1, target_vertical_speed=target, **sink)
    return story


def sinks_on(t: float) -> dict[str, float]:
    wanders = 0.01 * (t * 10 % 3)
    return {"height": 142.2 - 8.9 * t + wanders, "vertical_speed": -8.9 + wanders}


def test_one_that_sinks_on_as_it_was_commanded_when_its_autopilot_fell_silent_does_not_fall():
    assert silent(descending(), 8.0, sinks_on).fired() == []


def test_one_whose_motors_stop_in_that_silence_falls():
    def stops(t: float) -> dict[str, float]:
        if t <= 1.0:
            return sinks_on(t)
        fell = t - 1.0
        speed = -8.9 - 8.0 * fell
        return {"height": 133.3 - 8.9 * fell - 4.0 * fell**2, "vertical_speed": speed}

    story = silent(descending(), 5.0, stops)
    assert story.fired() == ["KILL"]
    assert story.t < 4.0 + 1.0 + 2.5, "as soon as the silence counts"


def test_what_its_autopilot_commanded_before_it_commanded_nothing_hides_no_fall():
    """A mode without targets for a second, in which it sinks on; then the silence."""
    story = descending()
    for step in range(1, 11):
        sink = {"height": 142.2 - 0.89 * step, "vertical_speed": -8.9}
        story.fly(story.t + 0.1, 0.1, **sink)
    assert silent(story, 5.0, lambda t: sinks_on(t + 1.0), math.nan).fired() == ["KILL"]


def test_nor_does_what_a_hover_was_commanded():
    assert silent(descending(-0.1), 5.0, sinks_on, -0.1).fired() == ["KILL"]
