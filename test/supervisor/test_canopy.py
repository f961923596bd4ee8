"""A canopy that is out and does not carry: the next parachute, or an alarm that does not stop."""

import pytest
from story import LINK, Story, falling, parachute, pressure_at, shipped

from chute_ros.model import Action, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import Rung
from chute_ros.supervisor.machine import Stage

TWO = (Rung(LINK, "1/161"), Rung(LINK, "1/162"))


def under_canopy(
    speed: float, seconds: float, *ladder: Rung, estimator_hovers: bool = False
) -> Story:
    """It tumbled and was deployed; under its canopy it comes down so fast, m/s, which an estimator
    that hovers does not tell."""
    story = Story(shipped("multirotor", deploy_ladder=ladder)).ready()
    story.at(0.0, parachute(device="1/161"), parachute(device="1/162"))
    story.fly(2.0, height=300.0)
    for k in range(40):
        story.fly(story.t + 0.05, **{**falling(0.05 * k, 300.0), "tilt": min(120.0, 10.0 * k)})
        if story.fired():
            break
    story.at(story.t, story.report(Action.KILL, Outcome.CONFIRMED))
    out = ("1/161",) if ladder else ("1/161", "1/162")
    story.at(story.t, *[parachute(device=device, deployed=True) for device in out])
    assert story.state.stage is Stage.DEPLOYED
    now, height = story.state.measured("vertical_speed").value, 290.0
    for k in range(round(seconds / 0.05)):
        now += min(max(-speed - now, -0.5), 0.5)
        height += 0.05 * now
        told = {"height": height, "vertical_speed": now, "tilt": 20.0 + k % 3}
        if estimator_hovers:
            told |= {"height": 290.0, "vertical_speed": 0.0, "pressure": pressure_at(height)}
        story.fly(story.t + 0.05, **told)
    return story


def test_one_that_carries_is_left_alone():
    story = under_canopy(6.0, 20.0, *TWO)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.alarms() == []


def test_one_that_does_not_is_followed_by_the_next_parachute():
    story = under_canopy(22.0, 4.5, *TWO)
    assert story.fired()[:2] == ["KILL", "DEPLOY"]
    assert "canopy does not carry" in {one.rule for one in story.decisions(Action.KILL)}
    story.at(story.t, story.report(Action.KILL, Outcome.CONFIRMED))
    story.fly(story.t + 0.6, vertical_speed=-22.0, height=200.0)
    assert story.newest(Action.DEPLOY).device == "1/162"


def test_without_another_it_is_an_alarm_that_does_not_stop():
    story = under_canopy(22.0, 10.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    said = [one for one in story.alarms() if "the canopy does not carry" in one]
    assert len(said) >= 2
    # Until a person resets it, on the ground.
    down = {"armed": 1, "landed_state": 1, "vertical_speed": 0.0}
    story.fly(story.t + 15.0, height=0.0, **down)
    story.at(story.t, i.ResetRequest(5))
    assert story.answer(5).success
    before = len(story.alarms())
    story.fly(story.t + 5.0, height=0.0, **down)
    assert len(story.alarms()) == before


def test_one_that_came_out_by_itself_after_a_kill_alone_is_followed_by_no_other():
    story = Story(shipped("multirotor", deploy_ladder=TWO)).ready()
    story.at(0.0, parachute(device="1/161"), parachute(device="1/162"))
    story.fly(2.0, height=300.0)
    story.at(2.0, i.KillRequest(1, "operator", "nobody below", kill_only=True))
    story.at(2.05, story.report(Action.KILL, Outcome.CONFIRMED))
    story.at(2.1, parachute(device="1/161", deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    for k in range(120):
        told = {"vertical_speed": -min(0.5 * k, 22.0), "height": 300.0 - 0.05 * k * 20.0}
        story.fly(story.t + 0.05, **told)
    assert story.fired() == ["KILL"]
    assert "denied, a person asked for the kill alone; safety/deploy releases" in story.said()
    # Until that person wants it.
    story.at(story.t, i.DeployRequest(2, True, "the other one"))
    story.fly(story.t + 0.6, vertical_speed=-22.0, height=150.0)
    assert story.fired()[-1] == "DEPLOY"


def test_a_kill_alone_under_a_canopy_keeps_back_no_other():
    """Given a person who stops the motors once a rule has deployed."""
    story = under_canopy(22.0, 2.5, *TWO)
    height = story.state.measured("height").value
    story.at(story.t, i.KillRequest(1, "operator", "the motors run", kill_only=True))
    story.at(story.t, story.report(Action.KILL, Outcome.CONFIRMED))
    for k in range(100):
        told = {"height": height - 1.1 * k, "tilt": 20.0 + k % 3}
        story.fly(story.t + 0.05, vertical_speed=-22.0, **told)
    assert story.newest(Action.DEPLOY).device == "1/162"


@pytest.mark.parametrize("late", [False, True])
def test_one_that_was_ordered_after_a_kill_alone_is_followed_as_any_other(late):
    """Given a person who wants the kill alone, and then the deploy, which may be given up."""
    story = Story(shipped("multirotor", deploy_ladder=TWO)).ready()
    story.at(0.0, parachute(device="1/161"), parachute(device="1/162"))
    story.fly(2.0, height=300.0)
    story.at(2.0, i.KillRequest(1, "operator", "nobody below", kill_only=True))
    story.at(2.05, story.report(Action.KILL, Outcome.CONFIRMED))
    story.at(2.5, i.DeployRequest(2, False, "somebody below"))
    assert story.fired() == ["KILL", "DEPLOY"]
    if late:
        story.at(2.6, story.report(Action.DEPLOY, Outcome.FAILED))
    story.at(2.7, parachute(device="1/161", deployed=True))
    for k in range(120):
        told = {"vertical_speed": -min(0.5 * k, 22.0), "height": 300.0 - 0.05 * k * 20.0}
        story.fly(story.t + 0.05, **told)
    assert story.newest(Action.DEPLOY).device == "1/162"


@pytest.mark.parametrize(("speed", "alarmed"), [(16.0, True), (12.0, True), (6.0, False)])
def test_one_whose_estimator_hovers_under_it_is_an_alarm_by_the_barometer(speed, alarmed):
    story = under_canopy(speed, 6.0, *TWO, estimator_hovers=True)
    said = [one for one in story.alarms() if "sinks fast under a canopy" in one]
    assert bool(said) is alarmed
    assert story.fired() == ["KILL", "DEPLOY"]
