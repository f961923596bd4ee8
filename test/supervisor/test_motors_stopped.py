"""What hangs on its motors falls without them: a kill in the air brings the deploy at once."""

import math

import pytest
from story import DOWN, Story, falling, pressure_at, shipped

from chute_ros.model import Action, Armed, LandedState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.contradictions import GRAVITY

D = Action.DEPLOY


def killed(profile: str, height: float, kill_only: bool = False) -> Story:
    story = Story(shipped(profile)).ready().fly(2.0, height=height)
    story.at(2.0, i.KillRequest(1, "operator", "flies away", kill_only))
    story.at(2.05, story.report(Action.KILL, Outcome.CONFIRMED))
    return story


def test_a_confirmed_kill_of_a_multirotor_is_followed_by_the_deploy_at_once():
    story = killed("multirotor", 50.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.newest(D).rule == "motors stopped in flight"
    assert story.when(D) == pytest.approx(2.05)


def test_one_that_is_not_confirmed_is_not():
    story = Story(shipped("multirotor")).ready().fly(2.0)
    story.at(2.0, i.KillRequest(1, "operator", "flies away"))
    story.fly(2.4)
    assert story.fired() == ["KILL"]


@pytest.mark.parametrize(("profile", "height"), [("fixed_wing", 50.0), ("multirotor", 8.0)])
def test_what_glides_or_is_too_low_is_not(profile, height):
    story = killed(profile, height).fly(2.3, height=height)
    assert story.fired() == ["KILL"]


@pytest.mark.parametrize(("sink", "deploys"), [(5.0, False), (12.0, True)])
def test_an_aeroplane_that_was_killed_glides_or_dives(sink, deploys):
    """Carried in full, as in a glide and as in a spiral."""
    story, off = killed("fixed_wing", 120.0), {"armed": Armed.DISARMED}
    sinking, height = 0.0, 120.0
    for _ in range(80):
        sinking = min(sinking + 0.3, sink)
        height -= 0.05 * sinking
        story.fly(story.t + 0.05, vertical_speed=-sinking, height=height, **off)
    assert story.fired() == ["KILL", "DEPLOY"][: 2 if deploys else 1]
    if deploys:
        assert story.newest(D).rule == "killed and falling"
        assert story.when(D) - 2.05 < 3.0


def test_a_person_may_ask_for_the_kill_alone():
    story = killed("multirotor", 50.0, kill_only=True).fly(2.3)
    off = {"armed": Armed.DISARMED, "landed_state": LandedState.ON_GROUND}
    story.fall(3.8, height=50.0, **off)
    assert story.fired() == ["KILL"]
    assert "denied, a person asked for the kill alone; safety/deploy releases" in story.said()
    # Then a person sees it fall, and asks for both.
    story.at(3.85, i.KillRequest(2, "operator", "it falls"))
    story.at(3.9, story.report(Action.KILL, Outcome.CONFIRMED))
    assert story.fired()[-1] == "DEPLOY"


@pytest.mark.parametrize("failed", [True, False])
def test_a_kill_alone_that_came_to_nothing_holds_back_no_deploy_of_a_later_fall(failed):
    """Given an autopilot that refuses the kill, or never answers; it hovers on, and falls."""
    story = Story(shipped("multirotor")).ready().fly(2.0, height=60.0)
    story.at(2.0, i.KillRequest(1, "operator", "flies away", kill_only=True))
    if failed:
        story.at(2.1, story.report(Action.KILL, Outcome.FAILED))
    story.fly(12.0, height=60.0)
    assert story.fired() == ["KILL"]
    for k in range(20):
        story.fly(story.t + 0.05, **{**falling(0.05 * k, 60.0), "tilt": 100.0})
    assert "DEPLOY" in story.fired()


def test_a_kill_alone_of_what_falls_is_followed_by_no_deploy_though_nobody_confirms_it():
    """Given an autopilot without power, and a person who wants it to come down as it is."""
    story = Story(shipped("multirotor")).ready().fly(2.0, height=60.0)
    story.at(2.0, i.KillRequest(1, "operator", "nobody below", kill_only=True))
    for k in range(60):
        story.fly(story.t + 0.05, **{**falling(0.05 * k, 160.0), "tilt": 100.0})
    story.at(story.t, story.report(Action.KILL, Outcome.FAILED))
    # Then not in the rest of the fall either.
    for k in range(60, 100):
        story.fly(story.t + 0.05, **{**falling(0.05 * k, 160.0), "tilt": 100.0})
    assert story.alarms()
    assert "DEPLOY" not in story.fired()
    # Given that it is caught and flies on, when it falls anew, then the deploy follows.
    story.fly(story.t + 15.0, height=100.0)
    for k in range(30):
        story.fly(story.t + 0.05, **{**falling(0.05 * k, 100.0), "tilt": 100.0})
    assert "DEPLOY" in story.fired()


UNKNOWN = math.nan


@pytest.mark.parametrize(
    ("height", "by_pressure"), [(UNKNOWN, 60.0), (UNKNOWN, UNKNOWN), (-55.0, -55.0), (3.0, 60.0)]
)
def test_whatever_tells_that_it_is_high_the_deploy_follows_a_confirmed_kill_at_once(
    height, by_pressure
):
    """Given no estimated height, a valley below the take-off, or an estimator that is wrong."""
    story = Story(shipped("multirotor"))
    known = not math.isnan(by_pressure)
    story.ready()
    if known:
        story.at(0.0, story.told(**DOWN, height=0.0, pressure=pressure_at(0.0)))
    for k in range(240):
        up = by_pressure * min(0.05 * k / 6.0, 1.0)
        parts = {"pressure": pressure_at(up)} if known else {}
        told = height if math.isnan(height) else min(height, up) if height > 0.0 else up
        story.fly(story.t + 0.05, height=told, **parts)
    begun = story.t
    story.at(begun, i.KillRequest(1, "operator", "flies away"))
    story.at(begun + 0.05, story.report(Action.KILL, Outcome.CONFIRMED))
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.newest(D).rule == "motors stopped in flight"


@pytest.mark.parametrize("profile", ["multirotor", "fixed_wing"])
def test_disarmed_in_the_air_by_whomever_it_is_deployed(profile):
    story = Story(shipped(profile)).ready().fly(2.0, height=80.0)
    for k in range(50):
        said = {"armed": Armed.DISARMED, "landed_state": LandedState.ON_GROUND}
        story.fly(story.t + 0.05, **{**falling(0.05 * k, 80.0), **said})
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.when(D) - 2.0 < (1.3 if profile == "multirotor" else 2.2)


@pytest.mark.parametrize("told_since", [0.0, 1.2])
def test_a_fall_that_drag_soon_carries_is_seen_as_well(told_since):
    """PX4's SIH: after a disarm by the ground station it sank with 10 m/s, all of its weight
    carried; the half second without force may be lost on its way."""
    story, height = Story(shipped("multirotor")).ready().fly(2.0, height=60.0), 60.0
    said = {"armed": Armed.DISARMED, "landed_state": LandedState.ON_GROUND}
    for k in range(1, 60):
        speed = 10.0 * math.tanh(0.1 * 0.9 * k)
        height -= 0.1 * speed
        parts = {"height": height, "vertical_speed": -speed, "acceleration": 0.98 * speed}
        if 0.1 * k >= told_since:
            story.at(2.0 + 0.1 * k, story.heartbeat(), story.told(**parts, **said))
        else:
            story.at(2.0 + 0.1 * k, story.heartbeat())
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.when(D) - 2.0 < (1.2 if told_since == 0.0 else 3.0)


def test_one_that_descends_fast_and_whose_heartbeat_is_wrong_is_not():
    """What still turns carries: of motors that stop, force is missing at once."""
    story, height = Story(shipped("multirotor")).ready().fly(2.0, height=120.0), 120.0
    for k in range(1, 90):
        speed = min(0.2 * k, 10.0)
        height -= 0.1 * speed
        parts = {"height": height, "vertical_speed": -speed}
        force = GRAVITY if speed == 10.0 else GRAVITY - 2.0
        said = {"armed": Armed.DISARMED} if k > 60 else {}
        story.at(2.0 + 0.1 * k, story.heartbeat(), story.told(**parts, acceleration=force, **said))
    assert story.fired() == []


QUADROTOR, QUADPLANE, UNTOLD = 2, 22, 0


def dropped(mav_type: int, stands_after: float, heard: bool = True, disarms: bool = True) -> Story:
    """Given that it drops as it was commanded, and says after 0.2 s that it is disarmed; from then
    on it says IN_AIR for so long, s, and that it stands. heard: of its landed state."""
    story = Story(shipped("multirotor")).ready().fly(2.0, height=80.0, vehicle_type=mav_type)
    for k in range(1, 14):
        sink, said = 0.98 * k, {} if heard else {"landed_state_age": 0.1 * k}
        if disarms and k > 2:
            said["armed"] = Armed.DISARMED
            if 0.1 * (k - 2) > stands_after:
                said["landed_state"] = LandedState.ON_GROUND
        parts = {"height": 80.0 - 0.05 * sink * k, "vertical_speed": -sink, "acceleration": 0.4}
        told = {"target_vertical_speed": -sink, "attitude_error": 0.5, "vehicle_type": mav_type}
        story.at(2.0 + 0.1 * k, story.heartbeat(), story.told(**parts, **told, **said))
    return story


def test_a_word_of_disarmed_beside_one_of_in_the_air_ends_no_flight():
    """PX4 and ArduCopter say that they stand once they are disarmed in the air."""
    assert dropped(QUADROTOR, math.inf).fired() == dropped(QUADROTOR, 0.0, disarms=False).fired()
    assert dropped(QUADROTOR, math.inf).fired() == []


@pytest.mark.parametrize("stands_after", [0.0, 0.35])
def test_one_that_says_then_that_it_stands_is_released(stands_after):
    story = dropped(QUADROTOR, stands_after)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.newest(D).rule == "disarmed in flight"
    assert story.when(Action.KILL) - 2.2 < stands_after + 0.5


@pytest.mark.parametrize("mav_type", [QUADPLANE, UNTOLD])
def test_the_autopilot_of_a_wing_may_go_on_to_say_in_the_air(mav_type):
    """ArduPlane does."""
    assert dropped(mav_type, math.inf).fired() == ["KILL", "DEPLOY"]


def test_what_it_said_before_is_no_word_against_it():
    """Given an EXTENDED_SYS_STATE that comes no more."""
    story = dropped(QUADROTOR, math.inf, heard=False)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.when(Action.KILL) < 2.9


def test_landed_on_a_roof_and_disarmed_it_is_not():
    story = Story(shipped("multirotor")).ready().fly(2.0, height=30.0)
    said = {"armed": Armed.DISARMED, "landed_state": LandedState.ON_GROUND}
    story.fly(20.0, height=30.0, vertical_speed=0.0, **said)
    assert story.fired() == []
