"""The one gate before a deploy: every reason against it in its words, and nothing else refuses."""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from story import (
    DOWN,
    LINK,
    SINKS,
    STANDING,
    TILTS,
    Story,
    changed,
    parachute,
    rule,
    shipped,
    with_rules,
)

from chute_ros.model import Action, Armed, Decision, LandedState, LinkState, Outcome
from chute_ros.supervisor import gate
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.base import Finding
from chute_ros.supervisor.conditions.link import LinkCondition
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import Measured
from chute_ros.supervisor.pending import Pending
from chute_ros.supervisor.rules import BelowMinimum, Profile
from chute_ros.supervisor.state import State
from chute_ros.supervisor.yaml_lines import ANY

K, D = Action.KILL, Action.DEPLOY


def asked(story: Story, force: bool = False, token: int = 5) -> str:
    """A person asks for a deploy; the refusal, or nothing."""
    story.at(story.t, i.DeployRequest(token, force, "it falls"))
    answers = story.answers(token)
    return answers[0].message if answers else ""


# -- a person ------------------------------------------------------------------------------------


def test_in_flight_a_person_is_never_refused():
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
def test_no_measurement_refuses_a_person_in_flight(told):
    profile = {"minimum_height": 10.0, "below_minimum": BelowMinimum.NOTHING}
    story = Story(with_rules(profile=profile)).flying()
    story.fly(0.5, **told)
    assert asked(story) == ""
    story.at(1.1)
    assert story.fired() == ["KILL", "DEPLOY"]


def test_a_person_is_never_slower_than_a_rule():
    by_rule = Story(with_rules(rule(SINKS))).flying()
    by_rule.fly(0.1, every=0.1, vertical_speed=-14.0)
    by_person = Story(with_rules(rule(SINKS))).flying()
    by_person.at(0.1, i.DeployRequest(5, False, "it falls"))
    for story in (by_rule, by_person):
        story.at(5.0)
        assert story.fired() == ["KILL", "DEPLOY"]
    assert by_person.when(K) <= by_rule.when(K)
    assert by_person.when(D) <= by_rule.when(D)


def test_a_person_and_a_rule_at_once_are_one_deploy():
    story = Story(with_rules(rule(SINKS))).flying()
    story.at(0.1, i.DeployRequest(5, False, "it falls"), story.told(vertical_speed=-14.0))
    story.at(0.7)
    assert story.fired() == ["KILL", "DEPLOY"]
    assert story.newest(D).rule == "operator"


def test_a_kill_is_refused_to_nobody_in_any_stage():
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
    one = rule(*conditions, states=tuple(Stage), **settings)
    return Story(with_rules(one, profile=profile))


def denied(story: Story, why: str) -> None:
    assert "DEPLOY" not in story.fired()
    assert "wants a deploy" in story.said()
    assert f": denied, {why}" in story.said()


@pytest.mark.parametrize("armed", [Armed.DISARMED, Armed.ARMED])
def test_a_rule_never_deploys_on_the_ground(armed):
    story = wants()
    story.at(0.0, story.heartbeat(), i.VehicleReport(STANDING))
    story.fly(20.0, vertical_speed=-14.0, landed_state=LandedState.ON_GROUND, armed=armed)
    assert story.fired() == []
    denied(story, "the vehicle is READY, not in flight")


OFF = {"armed": Armed.DISARMED, "landed_state": LandedState.ON_GROUND}
LIES: dict[str, Any] = {"tilt": 90.0, "vertical_speed": 0.0}


@pytest.mark.parametrize(
    ("killed", "told", "why"),
    [
        (
            None,
            {"landed_state": LandedState.ON_GROUND},
            "the vehicle says that it stands, and nothing contradicts it",
        ),
        (
            None,
            {"armed": Armed.DISARMED},
            "the motors are disarmed, and nothing says that it falls",
        ),
        ("in flight", OFF, "the vehicle has come down"),
        ("on the ground", OFF, "the vehicle is KILLING, not in flight"),
    ],
)
def test_a_rule_does_not_deploy_one_that_lies_on_the_ground_after_its_flight_or_a_kill(
    killed, told, why
):
    story = wants(conditions=(TILTS,), profile={} if killed else {"landed_hold": 1.0})
    story = story.ready() if killed == "on the ground" else story.flying()
    if killed:
        story.at(0.1, i.KillRequest(1, "operator", "stop"))
        story.fly(0.3, **OFF)
    story.fly(5.0, **LIES, **told)
    assert story.fired() == (["KILL"] if killed else [])
    denied(story, why)


@pytest.mark.parametrize(
    "lie", [{"armed": Armed.DISARMED}, {"landed_state": LandedState.ON_GROUND}]
)
def test_one_that_falls_is_deployed_whatever_it_says(lie):
    story = wants(profile={"landed_hold": 1.0}).flying().fly(0.2, vertical_speed=-14.0, **lie)
    assert story.fired() == ["KILL"]
    assert story.fly(0.7, vertical_speed=-14.0, **lie).fired() == ["KILL", "DEPLOY"]


def test_the_disarming_by_our_own_kill_does_not_stop_the_deploy():
    story = wants(conditions=(TILTS,)).flying().fly(0.1, tilt=90.0)
    story.fly(0.2, **LIES, **OFF)
    story.at(0.25, story.report(K, Outcome.CONFIRMED))
    assert story.fired() == ["KILL", "DEPLOY"]


def test_after_a_kill_in_flight_a_rule_still_deploys_although_the_motors_are_off():
    story = wants().flying()
    story.at(0.1, i.KillRequest(1, "operator", "stop"))
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    story.fly(0.4, vertical_speed=-14.0, armed=Armed.DISARMED)
    assert story.fired() == ["KILL", "DEPLOY"], "the kill is confirmed: the deploy leaves at once"


@pytest.mark.parametrize(
    "silence", [LinkCondition(ANY, (LinkJudgement.LOST,)), AutopilotCondition(AutopilotFact.LOST)]
)
def test_silence_alone_never_deploys_whatever_the_profile_says(silence):
    story = wants(conditions=(silence,)).flying()
    story.at(60.0)
    assert story.fired() == []
    denied(story, "only silence speaks for it, and silence alone never deploys")


@pytest.mark.parametrize(
    ("weight", "needed", "before"),
    [
        # The autopilot is heard.
        (2.0, 3.0, {"vertical_speed": -14.0}),
        # Silence would be enough.
        (9.0, 1.0, {"vertical_speed": -11.0, "link_state": LinkState.LOST}),
    ],
)
def test_silence_and_a_sign_of_falling_deploy_and_neither_alone(weight, needed, before):
    lost = AutopilotCondition(AutopilotFact.LOST, weight=weight)
    story = wants(conditions=(lost, SINKS), needed=needed).flying().fly(1.0, **before)
    assert story.fired() == []
    story.fly(1.2, vertical_speed=-14.0, link_state=LinkState.LOST)
    assert story.fired() == ["KILL"]


@pytest.mark.parametrize(
    ("allowed", "fired"),
    [
        (BelowMinimum.NOTHING, []),
        (BelowMinimum.KILL, ["KILL"]),
        (BelowMinimum.DEPLOY, ["KILL", "DEPLOY"]),
    ],
)
def test_below_the_minimum_height_only_what_the_profile_allows(allowed, fired):
    story = wants(profile={"minimum_height": 10.0, "below_minimum": allowed}).flying()
    story.fly(1.0, vertical_speed=-14.0, height=9.9)
    assert story.fired() == fired
    if allowed is BelowMinimum.NOTHING:
        denied(story, "height 9.9 m is below the minimum 10 m")
    if allowed is BelowMinimum.KILL:
        reasons = "; ".join(story.newest(K).reasons)
        assert "no deploy: height 9.9 m is below the minimum 10 m" in reasons


@pytest.mark.parametrize("allowed", BelowMinimum)
def test_at_the_minimum_height_and_where_it_is_not_known_it_deploys(allowed):
    profile = {"minimum_height": 10.0, "below_minimum": allowed}
    story = wants(profile=profile).flying().fly(1.0, vertical_speed=-14.0, height=10.0)
    assert story.fired() == ["KILL", "DEPLOY"]
    # Without any height it is taken to be high enough some time after the take-off.
    story = wants(profile=profile).flying().fly(5.2, height=math.nan)
    assert story.fly(6.2, vertical_speed=-14.0, height=math.nan).fired() == ["KILL", "DEPLOY"]


def test_a_vehicle_that_tips_over_before_it_was_ever_high_is_only_killed():
    profile = {"minimum_height": 10.0, "below_minimum": BelowMinimum.KILL}
    story = wants(profile=profile).flying().fly(1.0, vertical_speed=-14.0, height=math.nan)
    assert story.fired() == ["KILL"]
    assert "never seen at the minimum height, 10 m" in "; ".join(story.newest(K).reasons)


def test_a_denial_is_said_once_not_at_each_update_and_again_when_its_reason_changes():
    profile = {"minimum_height": 10.0, "below_minimum": BelowMinimum.NOTHING, "landed_hold": 3.0}
    story = wants(conditions=(TILTS,), profile=profile).flying()
    for n in range(20):
        story.fly(story.t + 0.05, tilt=90.0, height=9.5 - n * 0.1)
    assert story.said().count("wants a deploy") == 1
    story.fly(story.t + 1.0, tilt=90.0, landed_state=LandedState.ON_GROUND)
    assert story.said().count("wants a deploy") == 2


def test_what_was_denied_is_not_done_with_and_deploys_once_it_may():
    profile = {"minimum_height": 10.0, "below_minimum": BelowMinimum.NOTHING}
    story = wants(profile=profile).flying().fly(0.5, vertical_speed=-14.0, height=9.0)
    assert story.fired() == []
    assert story.fly(0.6, vertical_speed=-14.0, height=11.0).fired() == ["KILL"]


def test_the_links_that_a_deploy_needs_are_no_reason_against_it():
    story = Story(SupervisorConfig()).flying()
    story.at(30.0)
    assert (
        story.state.heard.links[LINK].judged(story.config.limits(LINK), 1030.0)
        is LinkJudgement.LOST
    )
    assert asked(story) == ""
    story.at(31.0)
    assert story.fired() == ["KILL", "DEPLOY"]


HOLDS = Finding(True, lambda: "it sinks")
RULE = rule(SINKS, name="sinks")


def flying(**told: Any) -> Story:
    """In flight; the vehicle says this last."""
    story = Story(with_rules(profile={"landed_hold": 5.0})).fly(0.5)
    assert story.state.stage is Stage.IN_FLIGHT
    story.at(0.6, story.heartbeat(), story.told(**told))
    return story


# -- every word ----------------------------------------------------------------------------------


def test_a_person_hears_why_once_a_parachute_is_out():
    story = flying()
    story.at(0.7, parachute(deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    now = story.state.own.updated_at
    assert gate.against_person(story.config, story.state, False, now) == (
        "a parachute is out already; force releases the next of the ladder"
    )
    assert gate.against_person(story.config, story.state, True, now) == (
        "every parachute of the ladder is out already"
    )
    two = SupervisorConfig(deploy_links=(LINK, "upf_can"))
    assert gate.against_person(two, story.state, True, now) == "", "the second is not"


def test_a_person_hears_that_nothing_says_where_it_is():
    config, state = SupervisorConfig(), State(epoch=7, started_at=0.0)
    assert gate.against_person(config, state, False, 1.0) == (
        "the vehicle is STARTUP, not in flight (nothing fresh says whether it is in the air); "
        "force deploys all the same"
    )


@pytest.mark.parametrize("stage", [one for one in Stage if one is not Stage.DEPLOYED])
def test_a_person_needs_no_force_in_flight_and_everywhere_else(stage):
    config, state = SupervisorConfig(), State(epoch=7, started_at=0.0, stage=stage)
    flies = stage in (Stage.IN_FLIGHT, Stage.KILLING, Stage.DEPLOYING, Stage.FAULT)
    assert (gate.against_person(config, state, False, 1.0) == "") is flies
    assert gate.against_person(config, state, True, 1.0) == ""


def against(config: SupervisorConfig, state: State, findings: tuple[Finding, ...]) -> str:
    return gate.against_rule(config, state, RULE, findings, state.own.updated_at)


def test_only_a_kill_in_this_flight_excuses_motors_that_are_off_and_not_for_long():
    state, config = flying(armed=Armed.DISARMED).state, with_rules()
    off = "the motors are disarmed, and nothing says that it falls"
    now = state.own.updated_at
    killed = changed(state, stage=Stage.KILLING, killed_in_flight=True, killed_at=now - 59.9)
    for one, why in (
        (state, off),
        (killed, ""),
        (changed(killed, killed_at=now - 60.0), off),
        (changed(killed, killed_standing=True), off),
        (changed(killed, stage=Stage.IN_FLIGHT), off),
    ):
        assert against(config, one, (HOLDS,)) == why
    with pytest.raises(ValueError):
        against(config, state, (HOLDS, HOLDS))


def test_one_that_was_killed_in_flight_and_has_come_down_is_not_deployed():
    story = flying()
    assert against(story.config, story.state, (HOLDS,)) == ""
    story.at(0.65, story.heartbeat())
    now = story.state.own.updated_at
    killed = changed(story.state, stage=Stage.KILLING, killed_in_flight=True, killed_at=now)
    assert against(story.config, killed, (HOLDS,)) == ""
    down = flying(landed_state=LandedState.ON_GROUND).state
    down = changed(down, stage=Stage.KILLING, killed_in_flight=True, down_since=900.0)
    down = changed(down, killed_at=down.own.updated_at - 59.0)
    assert against(story.config, down, (HOLDS,)) == "the vehicle has come down"


# -- which parachutes are out --------------------------------------------------------------------


def seen(**deployed: bool) -> State:
    """On the second link these devices (d1 is "1") say that they are released, or not."""
    story = Story(SupervisorConfig(deploy_links=(LINK, "upf_can")))
    reports = [parachute("upf_can", name[1:], out) for name, out in deployed.items()]
    story.at(0.1, *reports)
    return story.state


@pytest.mark.parametrize(
    ("deployed", "device", "out"),
    [
        ({}, "", False),
        ({"d1": True}, "", True),
        ({"d1": True, "d2": False}, "", False),
        ({"d1": True, "d2": True}, "", True),
        ({"d1": True, "d2": False}, "1", True),
        ({"d1": True, "d2": False}, "2", False),
        ({"d1": True, "d2": False}, "3", False),
        ({"d1": True}, "trigger", True),
        ({"d1": False}, "trigger", False),
    ],
)
def test_a_step_is_out_if_all_that_it_means_are(deployed, device, out):
    state = seen(**deployed)
    assert gate.out_already(state, Rung("upf_can", device)) is out
    assert not gate.out_already(state, Rung(LINK, device)), "the other link has said nothing"


def test_a_step_whose_node_confirmed_is_out_and_no_other():
    decision = Decision(7, 1, Action.DEPLOY, "r", (), ("upf_can",), device="2")
    sent = Pending(decision, ("upf_can",), 0.0, 0.0)
    told = MappingProxyType({"upf_can": frozenset({Outcome.CONFIRMED})})
    state = State(epoch=7, started_at=0.0)
    assert not gate.out_already(changed(state, deploys=(sent,)), Rung("upf_can", "2"))
    state = changed(state, deploys=(replace(sent, outcomes=told),))
    for rung in (Rung("upf_can", "2"), Rung("upf_can", "1"), Rung(LINK, "2")):
        assert gate.out_already(state, rung) is (rung == Rung("upf_can", "2"))


# -- the minimum height --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("height", "minimum", "was_high", "why"),
    [
        (10.0, 10.0, True, ""),
        (9.9, 10.0, True, "height 9.9 m is below the minimum 10 m"),
        (-10.0, 10.0, True, "height -10.0 m is below the minimum 10 m"),
        (-10.1, 10.0, True, ""),
        (20.0, 10.0, False, "it was never seen at the minimum height, 10 m"),
        (20.0, 0.5, False, "it was never seen at the minimum height, 0.5 m"),
        (20.0, 0.0, False, ""),
    ],
)
def test_too_low_to_the_last_bit(height, minimum, was_high, why):
    story = Story(with_rules())
    story.noise = -1  # none
    story.at(0.1, story.told(height=height, link_state=LinkState.OK))
    profile = replace(
        story.config.profile, minimum_height=minimum, below_minimum=BelowMinimum.KILL
    )
    config = replace(story.config, profile=profile)
    state = changed(story.state, was_high=was_high)
    assert state.measured("height").value == height
    assert gate.too_low(config, state, state.own.updated_at) == why
    anywhere = replace(profile, below_minimum=BelowMinimum.DEPLOY)
    assert gate.too_low(replace(config, profile=anywhere), state, state.own.updated_at) == ""


def test_one_that_flies_from_a_ground_below_home_is_deployed():
    """Given one that landed 20 m below home, was armed there and flies 28 m above that ground."""
    story = Story(shipped("multirotor")).ready().fly(5.0, height=20.0)
    for step in range(270):
        height = max(20.0 - 0.15 * step, -20.0)
        story.fly(story.t + 0.1, every=0.1, height=height, vertical_speed=-1.5)
    story.fly(42.0, every=0.1, height=-20.0, vertical_speed=0.0, **DOWN)
    story.fly(44.0, height=-20.0, vertical_speed=0.0, landed_state=LandedState.ON_GROUND)
    for step in range(140):
        story.fly(story.t + 0.1, every=0.1, height=-20.0 + 0.2 * step, vertical_speed=1.5)
    assert story.state.flight.took_off_height < -19.0
    story.fall(story.t + 2.0, height=8.0)
    assert story.fired() == ["KILL", "DEPLOY"]


def held_back(height: Measured, **flight: float) -> bool:
    """Is a deploy held back by this height, of 10 m that are needed?"""
    profile = Profile("tested", (), minimum_height=10.0, below_minimum=BelowMinimum.KILL)
    known = MappingProxyType({"height": height})
    state = changed(State(7, 0.0), was_high=True, measurements=known, **flight)
    return bool(gate.too_low(SupervisorConfig(profile=profile), state, 1000.0))


def test_what_is_low_above_home_may_be_high_above_the_ground_of_this_flight():
    for armed, took_off, height, low in (
        (-20.0, -19.0, 8.9, False),
        (-20.0, -10.0, -0.1, True),
        (-20.0, -10.0, 0.0, False),
        (-10.0, -20.0, 0.0, False),
        (-10.0, -20.0, -0.1, True),
        # It counts from where it was armed since it was armed.
        (-20.0, 0.5, 9.0, True),
        (0.0, math.nan, 9.0, True),
        (0.0, 0.5, -5.0, True),
        # On a hill the ground is higher than home.
        (50.0, 50.0, 55.0, False),
    ):
        measured = Measured(height, 1000.0, 1000.0, 9)
        flight = {"armed_height": armed, "took_off_height": took_off}
        assert held_back(measured, **flight) is low, (armed, took_off, height)


def test_a_height_that_jumped_down_holds_nothing_back_for_its_time():
    for passed, before, low in (
        (9.99, 60.0, False),
        (10.0, 60.0, True),
        (9.99, 5.0, True),
        (9.99, 4.0, True),
    ):
        at = 1000.0 - passed
        height = Measured(5.0, 1000.0, 1000.0, 9, jumped_at=at, before_jump=before)
        assert held_back(height) is low, (passed, before)
