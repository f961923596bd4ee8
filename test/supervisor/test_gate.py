"""The one gate before a deploy: every reason against it is stated, and nothing else refuses."""

import math
from typing import Any

import pytest
from story import LINK, SINKS, STANDING, TILTS, Story, rule, with_rules

from chute_ros.model import Action, Armed, LandedState, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.link import LinkCondition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.profile_lines import ANY
from chute_ros.supervisor.rules import BelowMinimum

K, D = Action.KILL, Action.DEPLOY
EVERYWHERE = tuple(Stage)


def asked(story: Story, force: bool = False, token: int = 5) -> str:
    """A person asks for a deploy; the refusal, or nothing."""
    story.at(story.t, i.DeployRequest(token, force, "it falls"))
    answers = story.answers(token)
    return answers[0].message if answers else ""


# -- a person ------------------------------------------------------------------------------------


def test_in_flight_a_person_is_never_refused() -> None:
    story = Story().flying()
    assert asked(story) == ""
    assert story.state.stage is Stage.KILLING
    assert asked(story, token=6) == "", "nor while the kill runs"
    story.at(0.1, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYING
    assert asked(story, token=7) == "", "nor while the deploy runs"
    assert story.fired() == ["KILL", "DEPLOY"], "each joins the one under way"
    story.at(0.2, story.report(D, Outcome.FAILED))
    assert story.state.stage is Stage.FAULT
    assert asked(story, token=8) == "", "nor after it failed"


@pytest.mark.parametrize("told", [{"tilt": 0.0}, {"armed": Armed.DISARMED}, {"height": 2.0}])
def test_no_measurement_refuses_a_person_in_flight(told: dict[str, Any]) -> None:
    profile = {"minimum_height": 10.0, "below_minimum": BelowMinimum.NOTHING}
    story = Story(with_rules(profile=profile)).flying()
    story.fly(0.5, **told)
    assert asked(story) == ""
    story.at(1.1)
    assert story.fired() == ["KILL", "DEPLOY"]


def test_on_the_ground_a_person_is_refused_in_words_unless_by_force() -> None:
    story = Story().ready()
    assert asked(story) == (
        "refused: the vehicle is READY, not in flight; force deploys all the same"
    )
    assert story.fired() == []
    assert asked(story, force=True, token=6) == ""
    story.at(0.6)
    assert story.fired() == ["KILL", "DEPLOY"]


def test_where_nothing_says_where_it_is_the_refusal_says_so() -> None:
    story = Story()
    assert "(nothing fresh says whether it is in the air)" in asked(story)


def test_after_a_parachute_is_out_nobody_deploys_again() -> None:
    story = Story().flying()
    asked(story)
    story.at(0.1, story.report(K, Outcome.CONFIRMED))
    story.at(0.2, story.report(D, Outcome.CONFIRMED))
    assert (
        asked(story, force=True, token=6)
        == "refused: every parachute of the ladder is out already"
    )
    assert story.fired() == ["KILL", "DEPLOY"]


@pytest.mark.parametrize("mode", [i.Mode.SHADOW, i.Mode.INHIBITED])
def test_in_another_mode_a_person_is_told_that_nothing_is_sent(mode: i.Mode) -> None:
    story = Story(mode=mode).flying()
    assert asked(story) == f"refused: mode is {mode.name}; nothing is sent"
    story.at(0.0, i.KillRequest(6, "operator", "stop"))
    assert story.answer(6).message == f"refused: mode is {mode.name}; nothing is sent"
    assert all(decision.shadow for decision in story.decisions())


def test_a_person_is_never_slower_than_a_rule() -> None:
    by_rule = Story(with_rules(rule(SINKS))).flying()
    by_rule.fly(0.1, every=0.1, vertical_speed=-14.0)
    by_person = Story(with_rules(rule(SINKS))).flying()
    by_person.at(0.1, i.DeployRequest(5, False, "it falls"))
    for story in (by_rule, by_person):
        story.at(5.0)
        assert story.fired() == ["KILL", "DEPLOY"]
    assert by_person.when(K) <= by_rule.when(K)
    assert by_person.when(D) <= by_rule.when(D)


def test_a_person_and_a_rule_at_once_are_one_deploy() -> None:
    story = Story(with_rules(rule(SINKS))).flying()
    story.at(0.1, i.DeployRequest(5, False, "it falls"), story.told(vertical_speed=-14.0))
    story.at(0.7)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.newest(D).rule == "operator"


def test_a_kill_is_refused_to_nobody_in_any_stage() -> None:
    for stage in Stage:
        story = Story()
        story.state = type(story.state)(epoch=7, started_at=1000.0, stage=stage)
        story.at(0.0, i.KillRequest(1, "operator", "stop"))
        assert story.fired() == ["KILL"], stage
        assert story.answers(1) == []


# -- a rule --------------------------------------------------------------------------------------


def wants(**settings: Any) -> Story:
    """In flight, with one rule that wants a deploy wherever it is let."""
    profile = settings.pop("profile", {})
    conditions = settings.pop("conditions", (SINKS,))
    one = rule(*conditions, states=EVERYWHERE, **settings)
    return Story(with_rules(one, profile=profile))


def denied(story: Story, why: str) -> None:
    assert "DEPLOY" not in story.fired()
    assert "wants a deploy" in story.said()
    assert why in story.said()


def test_a_rule_deploys_in_flight() -> None:
    story = wants().flying().fly(0.7, vertical_speed=-14.0)
    assert story.fired() == ["KILL", "DEPLOY"]


@pytest.mark.parametrize("armed", [Armed.DISARMED, Armed.ARMED])
def test_a_rule_never_deploys_on_the_ground(armed: Armed) -> None:
    story = wants()
    story.at(0.0, story.heartbeat(), i.VehicleReport(STANDING))
    story.fly(20.0, vertical_speed=-14.0, landed_state=LandedState.ON_GROUND, armed=armed)
    assert story.fired() == []
    denied(story, "the vehicle is READY, not in flight")


def test_a_rule_does_not_deploy_one_that_stands_after_its_flight() -> None:
    story = wants(conditions=(TILTS,), profile={"landed_hold": 1.0}).flying()
    story.fly(5.0, tilt=90.0, vertical_speed=0.0, landed_state=LandedState.ON_GROUND)
    assert story.fired() == []
    denied(story, "the vehicle says that it stands, and nothing contradicts it")


def test_a_rule_does_not_deploy_one_that_is_disarmed_and_does_not_fall() -> None:
    story = wants(conditions=(TILTS,)).flying()
    story.fly(5.0, tilt=90.0, vertical_speed=0.0, armed=Armed.DISARMED)
    assert story.fired() == []
    denied(story, "the motors are disarmed, and nothing says that it falls")


@pytest.mark.parametrize(
    "lie", [{"armed": Armed.DISARMED}, {"landed_state": LandedState.ON_GROUND}]
)
def test_one_that_falls_is_deployed_whatever_it_says(lie: dict[str, Any]) -> None:
    story = wants(profile={"landed_hold": 1.0}).flying().fly(0.2, vertical_speed=-14.0, **lie)
    assert story.fired() == ["KILL"]
    assert story.fly(0.7, vertical_speed=-14.0, **lie).fired() == ["KILL", "DEPLOY"]


def test_the_disarming_by_our_own_kill_does_not_stop_the_deploy() -> None:
    story = wants(conditions=(TILTS,)).flying().fly(0.1, tilt=90.0)
    off = {"armed": Armed.DISARMED, "landed_state": LandedState.ON_GROUND}
    story.fly(0.2, tilt=90.0, vertical_speed=0.0, **off)
    story.at(0.25, story.report(K, Outcome.CONFIRMED))
    assert story.fired() == ["KILL", "DEPLOY"]


def test_after_a_kill_in_flight_a_rule_still_deploys_although_the_motors_are_off() -> None:
    story = wants().flying()
    story.at(0.1, i.KillRequest(1, "operator", "stop"))
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    story.fly(0.4, vertical_speed=-14.0, armed=Armed.DISARMED)
    assert story.fired() == ["KILL", "DEPLOY"], "the kill is confirmed: the deploy leaves at once"


def test_after_a_kill_in_flight_one_that_has_come_down_is_not_deployed() -> None:
    story = wants(conditions=(TILTS,)).flying()
    story.at(0.1, i.KillRequest(1, "operator", "stop"))
    off = {"armed": Armed.DISARMED, "landed_state": LandedState.ON_GROUND}
    story.fly(0.3, **off)
    story.fly(3.0, tilt=90.0, **off)
    denied(story, "the vehicle has come down")


def test_after_a_kill_on_the_ground_a_rule_does_not_deploy() -> None:
    story = wants(conditions=(TILTS,)).ready()
    story.at(0.1, i.KillRequest(1, "operator", "stop"))
    off = {"armed": Armed.DISARMED, "landed_state": LandedState.ON_GROUND}
    story.fly(3.0, tilt=90.0, **off)
    denied(story, "the vehicle is KILLING, not in flight")


@pytest.mark.parametrize(
    "silence",
    [LinkCondition(ANY, (LinkJudgement.LOST,)), AutopilotCondition(AutopilotFact.LOST)],
)
def test_silence_alone_never_deploys_whatever_the_profile_says(silence: Any) -> None:
    story = wants(conditions=(silence,)).flying()
    story.at(60.0)
    assert story.fired() == []
    denied(story, "only silence speaks for it, and silence alone never deploys")


def test_silence_and_a_sign_of_falling_deploy() -> None:
    lost = AutopilotCondition(AutopilotFact.LOST, weight=2.0)
    story = wants(conditions=(lost, SINKS), needed=3.0).flying()
    story.fly(1.0, vertical_speed=-14.0)
    assert story.fired() == [], "the autopilot is heard"
    story.fly(1.2, vertical_speed=-14.0, link_state=LinkState.LOST)
    assert story.fired() == ["KILL"]


def test_one_that_is_lost_while_silence_would_be_enough_needs_the_sign_all_the_same() -> None:
    lost = AutopilotCondition(AutopilotFact.LOST, weight=9.0)
    story = wants(conditions=(lost, SINKS), needed=1.0).flying()
    story.fly(1.0, link_state=LinkState.LOST, vertical_speed=-11.0)
    assert story.fired() == []
    story.fly(1.2, link_state=LinkState.LOST, vertical_speed=-13.0)
    assert story.fired() == ["KILL"]


@pytest.mark.parametrize(
    ("allowed", "fired"),
    [
        (BelowMinimum.NOTHING, []),
        (BelowMinimum.KILL, ["KILL"]),
        (BelowMinimum.DEPLOY, ["KILL", "DEPLOY"]),
    ],
)
def test_below_the_minimum_height_only_what_the_profile_allows(
    allowed: BelowMinimum, fired: list[str]
) -> None:
    story = wants(profile={"minimum_height": 10.0, "below_minimum": allowed}).flying()
    story.fly(1.0, vertical_speed=-14.0, height=9.9)
    assert story.fired() == fired
    if allowed is BelowMinimum.NOTHING:
        denied(story, "height 9.9 m is below the minimum 10 m")
    if allowed is BelowMinimum.KILL:
        reasons = "; ".join(story.newest(K).reasons)
        assert "no deploy: height 9.9 m is below the minimum 10 m" in reasons


@pytest.mark.parametrize("allowed", BelowMinimum)
def test_at_the_minimum_height_and_where_it_is_not_known_it_deploys(allowed: BelowMinimum) -> None:
    profile = {"minimum_height": 10.0, "below_minimum": allowed}
    story = wants(profile=profile).flying().fly(1.0, vertical_speed=-14.0, height=10.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    # Without any height it is taken to be high enough some time after the take-off.
    story = wants(profile=profile).flying().fly(5.2, height=math.nan)
    assert story.fly(6.2, vertical_speed=-14.0, height=math.nan).fired() == ["KILL", "DEPLOY"]


def test_a_vehicle_that_tips_over_before_it_was_ever_high_is_only_killed() -> None:
    profile = {"minimum_height": 10.0, "below_minimum": BelowMinimum.KILL}
    story = wants(profile=profile).flying().fly(1.0, vertical_speed=-14.0, height=math.nan)
    assert story.fired() == ["KILL"]
    assert "never seen at the minimum height, 10 m" in "; ".join(story.newest(K).reasons)


def test_a_denial_is_said_once_not_at_each_update_and_again_when_its_reason_changes() -> None:
    profile = {"minimum_height": 10.0, "below_minimum": BelowMinimum.NOTHING, "landed_hold": 3.0}
    story = wants(conditions=(TILTS,), profile=profile).flying()
    for n in range(20):
        story.fly(story.t + 0.05, tilt=90.0, height=9.5 - n * 0.1)
    assert story.said().count("wants a deploy") == 1
    story.fly(story.t + 1.0, tilt=90.0, landed_state=LandedState.ON_GROUND)
    assert story.said().count("wants a deploy") == 2


def test_what_was_denied_is_not_done_with_and_deploys_once_it_may() -> None:
    profile = {"minimum_height": 10.0, "below_minimum": BelowMinimum.NOTHING}
    story = wants(profile=profile).flying().fly(0.5, vertical_speed=-14.0, height=9.0)
    assert story.fired() == []
    assert story.fly(0.6, vertical_speed=-14.0, height=11.0).fired() == ["KILL"]


def test_a_rule_is_not_acted_on_by_one_that_follows_or_is_inhibited() -> None:
    story = wants().flying()
    story.at(0.1, i.ModeRequest(1, i.Mode.INHIBITED, force=True))
    story.fly(3.0, vertical_speed=-14.0)
    assert story.fired() == []
    assert "wants a deploy" not in story.said()


def test_the_links_that_a_deploy_needs_are_no_reason_against_it() -> None:
    story = Story(SupervisorConfig()).flying()
    story.at(30.0)
    assert (
        story.state.heard.links[LINK].judged(story.config.limits(LINK), 1030.0)
        is LinkJudgement.LOST
    )
    assert asked(story) == ""
    story.at(31.0)
    assert story.fired() == ["KILL", "DEPLOY"]
