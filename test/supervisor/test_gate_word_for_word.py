"""The gate word for word and at its limits."""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from story import DOWN, LINK, SINKS, Story, parachute, rule, shipped, with_rules

from chute_ros.model import Action, Armed, Decision, LandedState, LinkState, Outcome
from chute_ros.supervisor import gate
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.base import Finding
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import Measured
from chute_ros.supervisor.pending import Pending
from chute_ros.supervisor.rules import BelowMinimum, Profile
from chute_ros.supervisor.state import HeardHere, State, ThisFlight

HOLDS = Finding(True, lambda: "it sinks")
RULE = rule(SINKS, name="sinks")


def flying(**told: Any) -> Story:
    """In flight; the vehicle says this last."""
    story = Story(with_rules(profile={"landed_hold": 5.0})).fly(0.5)
    assert story.state.stage is Stage.IN_FLIGHT
    story.at(0.6, story.heartbeat(), story.told(**told))
    return story


def against(story: Story) -> str:
    now = story.state.own.updated_at
    return gate.against_rule(story.config, story.state, RULE, (HOLDS,), now)


# -- every word ----------------------------------------------------------------------------------


def test_a_person_hears_why_once_a_parachute_is_out() -> None:
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


def test_a_person_hears_that_nothing_says_where_it_is() -> None:
    config, state = SupervisorConfig(), State(epoch=7, started_at=0.0)
    assert gate.against_person(config, state, False, 1.0) == (
        "the vehicle is STARTUP, not in flight (nothing fresh says whether it is in the air); "
        "force deploys all the same"
    )


@pytest.mark.parametrize("stage", [one for one in Stage if one is not Stage.DEPLOYED])
def test_a_person_needs_no_force_in_flight_and_everywhere_else(stage: Stage) -> None:
    config, state = SupervisorConfig(), State(epoch=7, started_at=0.0, stage=stage)
    flies = stage in (Stage.IN_FLIGHT, Stage.KILLING, Stage.DEPLOYING, Stage.FAULT)
    assert (gate.against_person(config, state, False, 1.0) == "") is flies
    assert gate.against_person(config, state, True, 1.0) == ""


@pytest.mark.parametrize(
    ("told", "why"),
    [
        ({}, ""),
        (
            {"landed_state": LandedState.ON_GROUND},
            "the vehicle says that it stands, and nothing contradicts it",
        ),
        ({"armed": Armed.DISARMED}, "the motors are disarmed, and nothing says that it falls"),
    ],
)
def test_a_rule_hears_why(told: dict[str, Any], why: str) -> None:
    assert against(flying(**told)) == why


def test_a_rule_hears_that_it_has_come_down() -> None:
    story = flying()
    story.at(0.65, story.heartbeat())
    now = story.state.own.updated_at
    state = replace(
        story.state,
        stage=Stage.KILLING,
        killing=replace(story.state.killing, killed_in_flight=True, killed_at=now),
    )
    assert gate.against_rule(story.config, state, RULE, (HOLDS,), now) == ""
    down = flying(landed_state=LandedState.ON_GROUND).state
    down = replace(
        down,
        stage=Stage.KILLING,
        killing=replace(down.killing, killed_in_flight=True),
        flight=replace(down.flight, down_since=900.0),
    )
    down = replace(down, killing=replace(down.killing, killed_at=down.own.updated_at - 59.0))
    assert gate.against_rule(story.config, down, RULE, (HOLDS,), down.own.updated_at) == (
        "the vehicle has come down"
    )


def test_a_rule_hears_that_silence_is_not_enough() -> None:
    story = flying()
    silent = rule(AutopilotCondition(AutopilotFact.LOST), name="lost")
    why = gate.against_rule(
        story.config, story.state, silent, (HOLDS,), story.state.own.updated_at
    )
    assert why == "only silence speaks for it, and silence alone never deploys"


def test_findings_that_do_not_belong_to_the_rule_are_an_error() -> None:
    story = flying()
    with pytest.raises(ValueError):
        gate.against_rule(
            story.config, story.state, RULE, (HOLDS, HOLDS), story.state.own.updated_at
        )


def test_a_kill_of_one_that_stood_or_of_another_stage_excuses_nothing() -> None:
    state = flying(armed=Armed.DISARMED).state
    config, now = with_rules(), state.own.updated_at
    killed = replace(
        state,
        stage=Stage.KILLING,
        killing=replace(state.killing, killed_in_flight=True, killed_at=now - 59.9),
    )
    assert gate.against_rule(config, killed, RULE, (HOLDS,), now) == ""
    long_ago = replace(killed, killing=replace(killed.killing, killed_at=now - 60.0))
    standing = replace(killed, killing=replace(killed.killing, killed_standing=True))
    earlier = replace(killed, stage=Stage.IN_FLIGHT)
    for one in (standing, earlier, long_ago):
        assert gate.against_rule(config, one, RULE, (HOLDS,), now) == (
            "the motors are disarmed, and nothing says that it falls"
        )


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
def test_a_step_is_out_if_all_that_it_means_are(
    deployed: dict[str, bool], device: str, out: bool
) -> None:
    state = seen(**deployed)
    assert gate.out_already(state, Rung("upf_can", device)) is out
    assert not gate.out_already(state, Rung(LINK, device)), "the other link has said nothing"


def test_a_step_whose_node_confirmed_is_out_and_no_other() -> None:
    decision = Decision(7, 1, Action.DEPLOY, "r", (), ("upf_can",), device="2")
    sent = Pending(decision, ("upf_can",), 0.0, 0.0)
    told = MappingProxyType({"upf_can": frozenset({Outcome.CONFIRMED})})
    confirmed = replace(sent, outcomes=told)
    state = State(epoch=7, started_at=0.0)
    assert not gate.out_already(
        replace(state, deploying=replace(state.deploying, deploys=(sent,))), Rung("upf_can", "2")
    )
    state = replace(state, deploying=replace(state.deploying, deploys=(confirmed,)))
    assert gate.out_already(state, Rung("upf_can", "2"))
    assert not gate.out_already(state, Rung("upf_can", "1"))
    assert not gate.out_already(state, Rung(LINK, "2"))


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
def test_too_low_to_the_last_bit(height: float, minimum: float, was_high: bool, why: str) -> None:
    story = Story(with_rules())
    story.noise = -1  # none
    story.at(0.1, story.told(height=height, link_state=LinkState.OK))
    profile = replace(
        story.config.profile, minimum_height=minimum, below_minimum=BelowMinimum.KILL
    )
    config = replace(story.config, profile=profile)
    state = replace(story.state, flight=replace(story.state.flight, was_high=was_high))
    assert state.measured("height").value == height
    assert gate.too_low(config, state, state.own.updated_at) == why
    anywhere = replace(profile, below_minimum=BelowMinimum.DEPLOY)
    assert gate.too_low(replace(config, profile=anywhere), state, state.own.updated_at) == ""


@pytest.mark.parametrize(
    ("armed", "took_off", "height", "held_back"),
    [
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
    ],
)
def test_what_is_low_above_home_may_be_high_above_the_ground_of_this_flight(
    armed: float, took_off: float, height: float, held_back: bool
) -> None:
    now = 1000.0
    profile = Profile("tested", (), minimum_height=10.0, below_minimum=BelowMinimum.KILL)
    known = MappingProxyType({"height": Measured(height, now, now, 9)})
    state = State(
        epoch=7,
        started_at=0.0,
        flight=ThisFlight(was_high=True, armed_height=armed, took_off_height=took_off),
        heard=HeardHere(measurements=known),
    )
    assert bool(gate.too_low(SupervisorConfig(profile=profile), state, now)) is held_back


def test_one_that_flies_from_a_ground_below_home_is_deployed() -> None:
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


# -- a height that has jumped --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("passed", "before", "held_back"),
    [(9.99, 60.0, False), (10.0, 60.0, True), (9.99, 5.0, True), (9.99, 4.0, True)],
)
def test_a_height_that_jumped_down_holds_nothing_back_for_its_time(
    passed: float, before: float, held_back: bool
) -> None:
    now = 1000.0
    profile = Profile("tested", (), minimum_height=10.0, below_minimum=BelowMinimum.KILL)
    config = SupervisorConfig(profile=profile)
    height = Measured(5.0, now, now, 9, jumped_at=now - passed, before_jump=before)
    state = State(
        7,
        0.0,
        flight=ThisFlight(was_high=True),
        heard=HeardHere(measurements=MappingProxyType({"height": height})),
    )
    assert bool(gate.too_low(config, state, now)) is held_back
