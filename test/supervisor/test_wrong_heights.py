"""Heights that scatter, jump, or stay the same, beside one that is not told at all."""

import math
import random
from dataclasses import replace

import pytest
from combinations import combinations
from story import START, Story, falling, shipped

from chute_ros.supervisor import inputs as i
from chute_ros.supervisor import readings
from chute_ros.supervisor.machine import Stage

SEEDS = pytest.mark.parametrize("seed", range(8))


@pytest.mark.parametrize(("seed", "size"), combinations(range(8), [5.0, 10.0, 30.0]))
def test_noise_on_the_height_is_no_sink_though_nothing_else_tells_a_speed(seed, size):
    chance = random.Random(seed)
    story = Story(shipped("multirotor")).flying().fly(1.0)
    for _ in range(300):
        height = 60.0 + chance.uniform(-size, size)
        story.fly(story.t + 0.1, every=0.1, height=height, vertical_speed=math.nan)
    assert story.fired() == []


@SEEDS
def test_a_fall_that_only_a_barometer_tells_is_seen(seed):
    """Half a metre of noise, as one has; the climb rate stands for the speed."""
    chance = random.Random(seed)
    story = Story(shipped("multirotor")).flying().fly(1.0)
    for step in range(1, 41):
        told = falling(step * 0.1, 120.0)
        story.fly(
            story.t + 0.1,
            every=0.1,
            height=told["height"] + chance.uniform(-0.5, 0.5),
            vertical_speed=math.nan,
            acceleration=told["acceleration"],
        )
    assert story.fired() == ["KILL", "DEPLOY"]


def rate(*heights: float, every: float = 0.1) -> tuple[float, str]:
    story = Story(shipped("multirotor")).flying()
    for height in heights:
        story.fly(story.t + every, every=every, height=height)
    return readings.reading(story.config, story.state, "climb_rate", START + story.t)


@pytest.mark.parametrize("acceleration", [-9.81, 0.0, 50.0, 100.0])
def test_a_climb_rate_that_changes_as_a_vehicle_does_is_none_that_scatters(acceleration):
    way = [acceleration / 2.0 * (step * 0.1) ** 2 for step in range(11)]
    value, why = rate(*way)
    assert why == ""
    assert value == pytest.approx(acceleration * 0.5, abs=abs(acceleration) * 0.2 + 1e-6)


def test_an_upright_sink_is_seen_although_the_height_is_stuck():
    story = Story(shipped("multirotor")).flying().fly(2.0)
    for step in range(1, 151):
        speed = -min(9.81 * step * 0.05, 15.0)
        told = replace(story.told(vertical_speed=speed, tilt=20.0).state, height=50.0)
        story.at(story.t + 0.05, story.heartbeat(), i.VehicleReport(told))
    assert story.fired() == ["KILL", "DEPLOY"]


def test_a_height_that_jumps_down_in_the_fall_holds_no_deploy_back():
    story = Story(shipped("multirotor")).flying().fly(1.0, height=60.0)
    for step in range(1, 41):
        told = falling(step * 0.05, 60.0)
        wrong = 55.0 if step > 4 else 0.0
        story.fly(story.t + 0.05, **{**told, "height": told["height"] - wrong, "tilt": 80.0})
    assert story.fired() == ["KILL", "DEPLOY"]


def test_a_height_that_jumped_long_ago_holds_it_back_again():
    story = Story(shipped("multirotor")).flying().fly(1.0, height=60.0)
    story.fly(14.0, height=5.0)
    story.fly(15.0, height=5.0, vertical_speed=-5.0, tilt=80.0)
    assert story.fired() == ["KILL"]
    assert "below the minimum 10 m" in story.said()


@pytest.mark.parametrize(("unseen", "deploys"), [(0.9, True), (0.4, False)])
def test_one_that_nobody_watched_after_its_take_off_may_be_high(unseen, deploys):
    """The supervisor hung; meanwhile it climbed, and its autopilot started anew."""
    story = Story(shipped("multirotor")).flying().fly(0.3, height=3.0, vertical_speed=8.0)
    again = {"reboot_count": 1, "rebooted_in_flight": True}
    story._update((story.told(**again),), 0.3 + unseen)
    story.fly(story.t + 1.0, vertical_speed=-9.0, tilt=70.0, acceleration=1.0, **again)
    assert story.fired() == (["KILL", "DEPLOY"] if deploys else ["KILL"])
    assert story.state.stage is (Stage.DEPLOYING if deploys else Stage.KILLING)


def test_a_height_that_is_told_no_more_is_unknown_from_then_on_though_nobody_is_heard():
    """The vertical speed stays young: it is told once more, without a height."""
    story = Story(shipped("multirotor")).flying().fly(2.0, vertical_speed=-14.0)
    told = story.told(vertical_speed=-14.0).state
    for step in range(1, 10):
        told = story.told(vertical_speed=-14.0).state
        story.at(2.0 + step / 10, i.VehicleReport(replace(told, height_age=step / 10)))
    assert story.fired() == []
    story.at(3.8)
    assert story.decisions()[-1].rule == "critical sink"


@pytest.mark.parametrize(
    ("size", "wrong", "profile"),
    combinations(
        [0.7, 1.5, 2.5], [{"tilt": 80.0}, {"acceleration": 0.1}], ["multirotor", "fixed_wing"]
    ),
)
def test_one_wrong_sensor_beside_the_noise_of_a_barometer_ends_no_flight(profile, wrong, size):
    chance = random.Random(f"{size}")
    story = Story(shipped(profile)).flying().fly(1.0)
    for _ in range(600):
        story.fly(story.t + 0.1, every=0.1, height=60.0 + chance.uniform(-size, size), **wrong)
    assert story.fired() == []


@pytest.mark.parametrize(("then", "last"), [(6.0, "KILL"), (60.0, "DEPLOY")])
def test_a_glitch_that_is_over_holds_the_deploy_back_as_before(then, last):
    """The height jumps by 40 m and back: what it says then is what it said before."""
    story = Story(shipped("multirotor")).flying().fly(1.0, height=then)
    story.fly(2.0, height=then + 40.0).fly(5.0, height=then)
    story.fall(6.0, then, tilt=80.0)
    assert story.fired()[-1] == last
