"""When the core wakes, what it says, what a late update counts."""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from story import (
    FLYING,
    IDLING,
    LINK,
    SINKS,
    STANDING,
    START,
    Story,
    changed,
    parachute,
    rule,
    with_rules,
)

from chute_ros.model import Action, Armed, Decision, LandedState, Outcome
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.conditions.link import LinkCondition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.counter import RuleEvidence
from chute_ros.supervisor.link_evidence import LinkEvidence, LinkJudgement, LinkLimits
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import Measured
from chute_ros.supervisor.measurements import STANDARD_LIMITS
from chute_ros.supervisor.pending import Ask, Pending
from chute_ros.supervisor.rules import Profile
from chute_ros.supervisor.state import State
from chute_ros.supervisor.wakes import next_deadline

K, D = Action.KILL, Action.DEPLOY
BLOCK, RELEASE = Action.FLIGHT_BLOCK, Action.FLIGHT_BLOCK_RELEASE
UPF = "upf_can"
NOW = 100.0

# -- when it wakes -------------------------------------------------------------------------------

#: Nothing is known and nothing is under way: it never wakes by itself.
QUIET = State(epoch=7, started_at=0.0, stage=Stage.IN_FLIGHT)
SETTINGS = SupervisorConfig(
    deploy_links=(LINK, UPF),
    link_limits=MappingProxyType({UPF: LinkLimits(0.2, 0.7, 2.0, startup_grace=30.0)}),
    kill_timeout=6.0,
    deploy_timeout=8.0,
    ladder_step_timeout=2.0,
    report_wait=0.5,
    resend_interval=0.1,
    vehicle_state_age=2.5,
    profile=Profile(
        "tested",
        (
            rule(SINKS, hold=1.0),
            rule(DeviceCondition(DeviceFact.ASKS_FOR_KILL), action=K, name="asked"),
        ),
        landed_hold=5.0,
    ),
)


def sent(action: Action, decided_at: float, sent_at: float, *reported: str) -> Pending:
    decision = Decision(7, 1, action, "r", (), (LINK,))
    outcomes = MappingProxyType(dict.fromkeys(reported, frozenset({Outcome.SENT})))
    return Pending(decision, (LINK,), decided_at, sent_at, outcomes)


def heard(at: float, **parts: float) -> MappingProxyType[str, LinkEvidence]:
    return MappingProxyType({UPF: LinkEvidence(heard=at, **parts)})


@pytest.mark.parametrize(
    ("known", "wakes"),
    [
        ({}, math.inf),
        # What ends just now has been looked at in this update.
        ({"links": heard(NOW)}, 100.2),
        ({"links": heard(99.8)}, 100.5),
        ({"links": heard(99.0, regained_at=99.5)}, 101.5),
        ({"stage": Stage.STARTUP, "started_at": 95.0}, 105.0),
        ({"stage": Stage.STARTUP, "started_at": 85.0}, 115.0),
        ({"stage": Stage.READY, "started_at": 95.0}, math.inf),
        ({"stage": Stage.DEPLOYED, "stage_since": 99.75, "deploy_tokens": (5,)}, 100.25),
        ({"stage": Stage.DEPLOYED, "stage_since": 99.75}, math.inf),
        ({"stage": Stage.FAULT, "stage_since": 99.75, "deploy_tokens": (5,)}, 107.75),
        ({"block": sent(BLOCK, 90.0, 99.95)}, 100.95),
        ({"block": sent(BLOCK, 90.0, 99.95, LINK)}, math.inf),
        ({"kill": sent(K, 99.0, 99.95)}, 100.05),
        ({"kill": sent(K, 99.0, 99.95, LINK)}, 105.0),
        ({"deploys": (sent(D, 99.0, 99.95, LINK),)}, 101.0),
        ({"deploys": (sent(D, 99.0, 99.95, LINK),) * 2}, 107.0),
        ({"deploys": (sent(D, 99.0, 99.95), sent(D, 99.0, 99.98, LINK))}, 100.05),
        ({"deploys": (sent(D, 99.0, 99.95, LINK), sent(D, 99.0, 99.98))}, 100.08),
        ({"stage": Stage.KILLING, "deploy_rule": "r", "deploy_due": 100.3}, 100.3),
        ({"stage": Stage.KILLING, "deploy_due": 100.3}, math.inf),
        ({"stage": Stage.DEPLOYING, "deploy_rule": "r", "deploy_due": 100.3}, math.inf),
        ({"alarm_at": 101.25}, 101.25),
        ({"asks": MappingProxyType({"a": Ask(99.5, LINK, "why")})}, 100.5),
        ({"airborne": True, "down_since": 99.0}, 104.0),
        ({"airborne": False, "down_since": 99.0}, math.inf),
        # The earliest of several.
        ({"alarm_at": 101.25, "links": heard(NOW), "kill": sent(K, 99.0, 99.95)}, 100.05),
    ],
)
def test_it_wakes_when_the_first_time_is_over(known, wakes):
    state = changed(QUIET, **known)
    assert next_deadline(SETTINGS, state, NOW) == pytest.approx(wakes, abs=1e-9)


@pytest.mark.parametrize(
    "stage", [Stage.STARTUP, Stage.BLOCKED, Stage.READY, Stage.ARMED, Stage.LANDED]
)
def test_on_the_ground_it_wakes_when_the_vehicle_state_is_just_too_old(stage):
    vehicle = replace(STANDING, armed_age=0.5)
    state = replace(
        QUIET,
        stage=stage,
        started_at=-99.0,
        heard=replace(QUIET.heard, vehicle=vehicle, vehicle_received=NOW),
    )
    wakes = next_deadline(SETTINGS, state, NOW)
    if stage is Stage.BLOCKED:
        assert math.isinf(wakes), "it is blocked already"
        return
    assert wakes == pytest.approx(102.0, abs=1e-5)
    assert flight.fresh(SETTINGS, state, 0.5, 102.0), "at its limit it still counts"
    assert not flight.fresh(SETTINGS, state, 0.5, wakes)


def test_it_wakes_just_after_a_rule_is_fulfilled():
    counting = MappingProxyType({"tested": RuleEvidence(0.25, holds=True)})
    wakes = next_deadline(SETTINGS, replace(QUIET, rules=counting), NOW)
    assert 100.75 < wakes < 100.75001


# -- a late update -------------------------------------------------------------------------------


def counting() -> Story:
    """In flight, sinking since t = 0; the rule has counted nothing yet. Two links are heard."""
    config = with_rules(rule(SINKS, hold=9.0), late_after=0.25, deploy_links=(LINK, UPF))
    story = Story(config).flying()
    released = story.report(RELEASE, Outcome.CONFIRMED), story.report(RELEASE, Outcome.SENT, UPF)
    beats = story.heartbeat(), story.heartbeat(UPF)
    story.at(0.0, *released, *beats, story.told(vertical_speed=-13.0))
    return story


def judged(story: Story, link: str) -> LinkJudgement:
    """What it thinks of this link in its newest update."""
    evidence = story.state.heard.links[link]
    return evidence.judged(story.config.limits(link), story.state.own.updated_at)


def test_a_late_update_holds_no_silence_against_anybody_and_counts_nothing_for_it():
    """The first deadline is at 0.5: until then a heartbeat is young. What still waits to be read
    has the limit of 0.25 s to come."""
    story = counting()
    story._update((), 0.8125)
    assert {link: one.heard for link, one in story.state.heard.links.items()} == {
        LINK: START + 0.5625,
        UPF: START + 0.5625,
    }
    assert story.state.rule("tested").level == pytest.approx(0.5)
    assert story.state.own.late_count == 1
    assert story.alarms() == [
        "an update came 0.31 s late (limit 0.25 s): silence meanwhile does not count"
    ]
    story._update((), 4.0)
    assert story.state.own.late_count == 2


@given(hang=st.floats(1.0, 3.0), beat=st.floats(0.0, 0.09))
def test_after_a_hang_of_its_own_the_first_word_of_one_makes_no_other_stale(hang, beat):
    """Given two links that are heard, when it hangs and reads what waits, one after another."""
    story = counting()
    story.at(beat, story.heartbeat())
    story.at(0.1, story.heartbeat(UPF))
    story._update((story.told(vertical_speed=0.0),), 0.1 + hang)
    assert [judged(story, one) for one in (LINK, UPF)] == [LinkJudgement.OK] * 2
    story.at(0.11 + hang, story.heartbeat(UPF))
    story.at(0.12 + hang, story.heartbeat())
    assert [judged(story, one) for one in (LINK, UPF)] == [LinkJudgement.OK] * 2


def test_after_a_hang_of_its_own_who_stays_silent_is_stale_as_soon_as_it_had_the_time():
    story = counting()
    story._update((story.heartbeat(UPF),), 3.0)
    story.at(3.2, story.heartbeat(UPF))
    assert judged(story, LINK) is LinkJudgement.OK
    story.at(3.3, story.heartbeat(UPF))
    assert judged(story, LINK) is LinkJudgement.STALE


def test_one_that_is_as_late_as_allowed_is_not_late():
    story = counting()
    story._update((), 0.75)
    assert {one.heard for one in story.state.heard.links.values()} == {START}
    assert story.state.rule("tested").level == pytest.approx(0.75)
    assert (story.state.own.late_count, story.alarms()) == (0, [])


# -- one that follows ----------------------------------------------------------------------------


def test_who_waits_at_one_that_steps_down_is_told_why():
    story = Story().flying()
    story.at(0.1, i.KillRequest(5, "operator", "stop"))
    story.at(0.2, i.StepDown("it was stopped"))
    text = "another supervisor decides, call again: it was stopped"
    assert story.answers(5) == [i.Finish(5, False, False, text)]
    assert story.state.own.leading is False


def test_what_is_decided_anew_after_a_takeover_says_so():
    story = Story().flying()
    story.at(0.1, i.KillRequest(5, "operator", "stop"))
    story.follows()
    story.at(0.2, i.TakeOver(9))
    kill = story.newest(K)
    assert (kill.epoch, kill.reasons) == (
        9,
        ("operator: stop", "decided anew by the supervisor that leads now"),
    )


def test_one_that_follows_knows_since_when_it_is_down_and_what_its_rules_counted():
    """So that one that takes over need not begin to count."""
    story = Story(with_rules(rule(SINKS, hold=9.0))).flying()
    story.follows()
    story.fly(0.5, vertical_speed=-13.0)
    assert story.state.rule("tested").level == pytest.approx(0.45)
    story.at(0.6, story.told(vertical_speed=0.0, landed_state=LandedState.ON_GROUND))
    assert story.state.flight.down_since == START + 0.6
    assert story.state.stage is Stage.IN_FLIGHT


# -- in the air or down --------------------------------------------------------------------------


@pytest.mark.parametrize("blocked", [False, True])
def test_taking_off_before_it_may_is_an_alarm_in_these_words(blocked):
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False))
    if blocked:
        story.at(11.0, story.heartbeat(healthy=False), i.VehicleReport(STANDING))
    before = story.state.stage.name
    assert before == ("BLOCKED" if blocked else "STARTUP")
    t = story.t + 1.0
    story.at(t, story.heartbeat(healthy=False), i.VehicleReport(FLYING))
    early = "took off before this supervisor was ready, or this supervisor started in flight"
    assert story.alarms() == ["took off although BLOCKED" if blocked else early]
    # The device node undoes arming on the ground while blocked; one wrong landed state in the air
    # must not make it stop the motors.
    assert story.decisions()[-1].action is RELEASE
    assert story.state.flight.airborne_since == START + t


def test_from_startup_flight_is_blocked_just_when_the_time_of_the_slowest_link_is_over():
    limits = MappingProxyType({UPF: LinkLimits(startup_grace=20.0)})
    story = Story(SupervisorConfig(deploy_links=(LINK, UPF), link_limits=limits))
    story.at(19.9)
    assert story.state.stage is Stage.STARTUP
    story.at(20.0)
    assert story.state.stage is Stage.BLOCKED
    assert "STARTUP -> BLOCKED: " in story.said()
    assert story.said().endswith(f"({'; '.join(story.newest(BLOCK).reasons)})")


def test_a_rule_on_a_link_that_never_started_wakes_when_the_time_of_that_link_is_over():
    """Given a vehicle that is READY while another parachute, which it may do without, starts."""
    never = LinkCondition(UPF, (LinkJudgement.NEVER_SEEN,))
    watch = rule(never, action=Action.NONE, states=(Stage.READY,))
    limits = MappingProxyType({UPF: LinkLimits(startup_grace=20.0)})
    links = {"required_links": (LINK,), "deploy_links": (LINK, UPF), "link_limits": limits}
    config = with_rules(watch, **links)
    state = replace(QUIET, stage=Stage.READY, stage_since=-60.0)
    assert next_deadline(config, state, 12.0) == 20.0
    assert never.find(config, state, 19.9).holds is False
    assert never.find(config, state, 20.0).holds is True


def test_it_stands_since_its_last_contradiction_and_stays_landed_while_it_is_armed():
    story = Story(with_rules(profile={"landed_hold": 0.2})).flying()
    for t, told, since in (
        (0.1, IDLING, START + 0.1),
        (0.2, IDLING, START + 0.1),
        (0.25, FLYING, math.nan),
        (0.4, IDLING, START + 0.4),
        (0.7, IDLING, START + 0.4),
    ):
        story.at(t, story.heartbeat(), i.VehicleReport(told))
        assert story.state.flight.down_since == pytest.approx(since, abs=0.0, nan_ok=True)
    assert story.state.stage is Stage.LANDED


def test_a_landing_is_noted_with_its_time_and_ends_what_belonged_to_the_flight():
    story = Story(with_rules()).flying()
    story.at(0.1, story.told(reboot_count=1, rebooted_in_flight=True))
    assert story.state.flight.rebooted
    told = {"landed_state": LandedState.ON_GROUND, "vertical_speed": 0.0}
    story.at(0.2, story.heartbeat(), story.told(reboot_count=1, **told))
    state = story.state
    assert state.stage is Stage.LANDED
    assert (state.flight.airborne, state.flight.rebooted) == (False, False)
    assert state.flight.landed_at == pytest.approx(START + 0.2)


@pytest.mark.parametrize(
    ("told", "t", "high"),
    [
        ({"height": 10.0}, 0.1, True),
        ({"height": 9.75}, 0.1, False),
        ({"height": -10.0}, 0.1, False),
        ({"height": 9.75}, 5.0, False),
        ({"height": math.nan}, 4.9, False),
        ({"height": math.nan}, 5.0, True),
    ],
)
def test_a_deploy_is_worth_it_from_the_minimum_height_or_some_time_after_the_take_off(
    told, t, high
):
    story = Story(with_rules(profile={"minimum_height": 10.0})).flying()
    story.noise = -1  # none
    story.at(t, story.told(**told))
    assert story.state.flight.was_high is high


def test_one_that_was_high_stays_worth_it():
    story = Story(with_rules(profile={"minimum_height": 10.0})).fly(1.0, height=50.0)
    story.fly(3.0, height=5.0)
    assert story.state.flight.was_high


@pytest.mark.parametrize("secured", [False, True])
def test_one_that_was_high_has_to_be_so_again_after_the_next_take_off(secured):
    story = Story(with_rules(profile={"minimum_height": 10.0})).ready().fly(1.0, height=50.0)
    armed = Armed.DISARMED if secured else Armed.ARMED
    down: dict[str, Any] = {"landed_state": LandedState.ON_GROUND, "vertical_speed": 0.0}
    story.fly(3.0, height=5.0, armed=armed, **down)
    assert story.state.stage is (Stage.READY if secured else Stage.LANDED)
    story.fly(4.0, height=5.0)
    assert story.state.stage is Stage.IN_FLIGHT
    assert not story.state.flight.was_high


def test_on_the_ground_no_height_is_high():
    story = Story(with_rules(profile={"minimum_height": 10.0})).ready()
    story.at(
        0.1, story.told(height=50.0, armed=Armed.DISARMED, landed_state=LandedState.ON_GROUND)
    )
    assert not story.state.flight.was_high


# -- taking off ----------------------------------------------------------------------------------

HERE, THERE = {"latitude": 48.0, "longitude": 11.0}, {"latitude": 48.5, "longitude": 11.0}


def at_home(story: Story) -> tuple[float, float] | None:
    """Rounded, as what is told is noisy."""
    home = story.state.flight.home
    return home and (round(home[0], 3), round(home[1], 3))


def test_home_is_where_it_took_off_and_anew_after_it_was_secured():
    down: dict[str, Any] = {"landed_state": LandedState.ON_GROUND, "armed": Armed.DISARMED}
    story = Story(with_rules()).ready().fly(0.5, **HERE)
    assert at_home(story) == (48.0, 11.0)
    story.fly(1.0, **THERE)
    assert at_home(story) == (48.0, 11.0)
    assert story.state.measured("distance_from_home").value > 50_000.0
    story.fly(3.0, **THERE, **down)
    assert story.state.stage is Stage.READY
    story.at(3.05, story.heartbeat(), story.told(**THERE))
    assert story.state.stage is Stage.IN_FLIGHT
    assert at_home(story) == (48.5, 11.0)
    told = story.state.heard.measurements
    assert "distance_from_home" not in told, "it was that from another place"
    assert "height" in told


def test_a_bounce_keeps_home_and_how_far_it_is():
    story = Story(with_rules()).ready().fly(0.5, **HERE)
    story.fly(1.0, **THERE, landed_state=LandedState.ON_GROUND, vertical_speed=0.0)
    assert story.state.stage is Stage.LANDED
    story.at(1.05, story.heartbeat(), story.told(**THERE))
    assert story.state.stage is Stage.IN_FLIGHT
    assert at_home(story) == (48.0, 11.0)
    assert story.state.measured("distance_from_home").value > 50_000.0


ALARM = rule(SINKS, action=Action.NONE, states=(Stage.IN_FLIGHT,))
WISH = rule(DeviceCondition(DeviceFact.ASKS_FOR_KILL), action=K, states=(Stage.IN_FLIGHT,))


@pytest.mark.parametrize("secured", [False, True])
def test_what_was_said_of_a_flight_is_said_again_in_the_next_but_not_after_a_bounce(secured):
    story = Story(with_rules(ALARM)).ready()
    armed = Armed.DISARMED if secured else Armed.ARMED
    for start in (0.0, 2.0):
        story.fly(start + 1.0, vertical_speed=-13.0)
        told = {"landed_state": LandedState.ON_GROUND, "vertical_speed": 0.0}
        story.fly(start + 2.0, armed=armed, **told)
        assert story.state.stage is (Stage.READY if secured else Stage.LANDED)
    assert len(story.alarms()) == (2 if secured else 1)


@pytest.mark.parametrize("stage", [Stage.READY, Stage.LANDED])
def test_what_a_device_wished_before_the_flight_is_not_done_in_it_unless_it_bounced(stage):
    story = Story(with_rules(WISH)).ready()
    if stage is Stage.LANDED:
        story.at(0.1, i.VehicleReport(FLYING))
        story.at(0.2, i.VehicleReport(IDLING))
    story.at(0.3, i.KillRequest(0, "upf_can 33", "launching"))
    assert story.state.stage is stage
    story.at(0.4, i.VehicleReport(FLYING))
    assert story.fired() == (["KILL"] if stage is Stage.LANDED else [])


def test_who_has_flown_before_is_no_longer_taken_to_have_been_released_before():
    """A landed state that was wrong, while the canopy opened: it is out in this flight."""
    story = Story().flying()
    story.at(0.1, i.VehicleReport(IDLING))
    story.at(0.2, parachute(deployed=True), i.VehicleReport(IDLING))
    assert story.state.stage is Stage.LANDED
    story.at(0.3, story.heartbeat(), i.VehicleReport(FLYING))
    assert story.state.stage is Stage.DEPLOYED
    assert story.fired() == ["KILL"]


@pytest.mark.parametrize("known", [True, False])
def test_what_was_out_on_the_ground_says_nothing_of_the_flight_where_it_is_known_to_stand(known):
    story = Story(SupervisorConfig(require_vehicle_state=False))
    standing = [i.VehicleReport(STANDING)] if known else []
    story.at(0.0, story.heartbeat(), parachute(deployed=True), *standing)
    story.at(10.0, story.heartbeat(), *standing)
    assert story.state.stage is Stage.BLOCKED
    story.at(10.1, story.heartbeat(), i.VehicleReport(FLYING))
    assert story.state.stage is (Stage.IN_FLIGHT if known else Stage.DEPLOYED)


def test_nor_does_it_after_a_kill_on_the_ground():
    """KILLING is not of the stages in which it is noted: the test is what opened it."""
    story = Story().ready()
    story.at(0.1, i.KillRequest(5, "operator", "test"))
    story.at(0.2, parachute(deployed=True), i.VehicleReport(STANDING))
    assert story.state.stage is Stage.DEPLOYED
    assert story.state.flight.released_before == frozenset()


# -- flight is blocked and released --------------------------------------------------------------

BOTH = SupervisorConfig(kill_links=(LINK, UPF), deploy_links=(LINK, UPF))


def blocks(story: Story) -> list[tuple[Action, tuple[str, ...]]]:
    return [(d.action, d.reasons) for d in story.decisions() if d.action in (BLOCK, RELEASE)]


def test_every_link_is_told_that_flight_is_blocked_or_released_and_why():
    story = Story(BOTH)
    story.at(0.0, story.heartbeat(), i.VehicleReport(STANDING))
    story.at(0.1, story.heartbeat(UPF), story.heartbeat(healthy=False))
    story.at(0.2, i.VehicleReport(FLYING))
    assert blocks(story) == [
        (RELEASE, ("every required link is healthy",)),
        (BLOCK, ("mavlink_parachute: its device is not healthy",)),
        (RELEASE, ("in the air",)),
    ]
    assert {(d.rule, d.targets) for d in story.decisions()} == {("links", (LINK, UPF))}


def test_nothing_is_decided_twice_in_a_flight():
    story = Story().flying().fly(1.0)
    assert blocks(story) == [(RELEASE, ("every required link is healthy",))]
    assert story.alarms() == []


def test_in_shadow_flight_is_only_said_to_be_blocked_once_the_release_has_arrived():
    """One that nobody has confirmed is sent on; a block that was said meanwhile would hide it."""
    story = Story()
    story.at(0.0, story.heartbeat(healthy=False))
    story.at(0.1, story.heartbeat(healthy=False), i.ModeRequest(1, i.Mode.SHADOW, force=False))
    assert [(d.action, d.shadow) for d in story.decisions()] == [(BLOCK, False), (RELEASE, False)]
    story.at(0.2, story.heartbeat(healthy=False))
    assert len(story.decisions()) == 2
    story.at(0.3, story.heartbeat(healthy=False), story.report(RELEASE, Outcome.SENT))
    assert [(d.action, d.shadow) for d in story.decisions()[2:]] == [(BLOCK, True)]
    story.at(5.0, story.heartbeat(healthy=False))
    again = [o.decision for _, o in story.outputs if isinstance(o, i.Decide) and o.again]
    assert not any(d.shadow for d in again), "what is only said is said once"


def killed() -> Story:
    """On the ground, the motors were to be stopped at t = 0.2."""
    story = Story().ready()
    story.at(0.2, story.heartbeat(), i.KillRequest(5, "operator", "test"))
    assert story.state.stage is Stage.KILLING
    return story


@pytest.mark.parametrize("outcome", [Outcome.CONFIRMED, Outcome.FAILED])
def test_after_a_kill_on_the_ground_the_block_waits_for_the_kill_to_end(outcome):
    story = killed()
    story.at(0.3, story.report(K, Outcome.ACCEPTED))
    assert blocks(story)[-1][0] is RELEASE
    story.at(0.4, story.report(K, outcome))
    assert blocks(story)[-1][0] is BLOCK


def test_a_kill_in_flight_is_followed_by_no_block():
    story = Story().flying()
    story.at(0.2, i.KillRequest(5, "operator", "test"))
    story.at(0.3, story.report(K, Outcome.CONFIRMED))
    assert blocks(story)[-1][0] is RELEASE


def test_nor_is_one_that_a_deploy_follows():
    story = Story().ready()
    story.at(0.2, story.heartbeat(), i.DeployRequest(5, True, "test"))
    story.at(0.3, story.report(K, Outcome.FAILED))
    assert story.state.stage is Stage.KILLING
    assert blocks(story)[-1][0] is RELEASE


# -- killed on the ground, and off all the same --------------------------------------------------


def test_one_that_was_killed_on_the_ground_and_arms_again_is_followed_into_the_air():
    story = killed()
    story.at(0.3, story.report(K, Outcome.CONFIRMED))
    story.at(2.0, i.VehicleReport(FLYING))
    assert story.state.stage is Stage.IN_FLIGHT
    assert story.alarms() == ["took off although KILLING"]
    assert not story.state.killing.killed_in_flight


@pytest.mark.parametrize("deploys", [False, True])
def test_one_whose_kill_has_just_left_has_not_taken_off(deploys):
    """What it says so soon may be from before; and a deploy that is ordered stays ordered."""
    story = killed()
    if deploys:
        story.at(0.25, i.DeployRequest(6, True, "test"))
    story.at(0.6 if deploys else 0.3, i.VehicleReport(FLYING))
    assert story.state.stage is Stage.KILLING


def test_one_that_was_killed_in_flight_does_not_take_off_again():
    story = Story().flying()
    story.at(0.2, i.KillRequest(5, "operator", "stop"))
    story.at(0.3, story.report(K, Outcome.CONFIRMED))
    story.at(3.0, i.VehicleReport(FLYING))
    assert story.state.stage is Stage.KILLING
    assert story.state.killing.killed_in_flight


# -- what is sent again --------------------------------------------------------------------------


def again(story: Story, action: Action) -> list[float]:
    """When this action was sent again, t."""
    return [t for t, _, again in story.sent(action) if again]


def resends(until: float) -> list[float]:
    """When what was decided at t = 1 is, each 20 ms at first and each 0.25 s at last."""
    times, t = [], 1.0
    while (t := t + min(max(0.02, (t - 1.0) / 4.0), 0.25)) < until:
        times.append(t)
    return times


@pytest.mark.parametrize(("kill", "deploy"), [(2.0, 1.0), (1.0, 2.0)])
def test_a_kill_is_sent_again_as_long_as_it_or_the_deploy_can_help(kill, deploy):
    config = SupervisorConfig(kill_timeout=kill, deploy_timeout=deploy, resend_interval=0.25)
    story = Story(config).flying()
    story.at(1.0, i.KillRequest(5, "operator", "stop"))
    story.at(6.0)
    assert again(story, K) == pytest.approx(resends(3.0))


def test_a_deploy_is_sent_again_while_it_goes_on_to_whom_has_not_reported():
    config = SupervisorConfig(deploy_timeout=1.0, resend_interval=0.25)
    story = Story(config).flying()
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.0, story.report(K, Outcome.CONFIRMED))
    story.at(6.0)
    assert again(story, D) == pytest.approx(resends(2.0))
    assert again(story, K) == []


def test_a_block_is_sent_again_only_while_a_node_lives_that_has_not_reported():
    story = Story(BOTH)
    story.at(0.0, story.heartbeat(healthy=False), story.heartbeat(UPF))
    story.at(0.05, story.report(BLOCK, Outcome.SENT))
    story.at(0.9, story.heartbeat(healthy=False))
    story.at(0.999)
    assert again(story, BLOCK), "the second node has not"
    count = len(again(story, BLOCK))
    for tick in range(20):
        story.at(1.0 + tick * 0.5, story.heartbeat(healthy=False))
    assert len(again(story, BLOCK)) == count, "it is not heard any more"
    # For how long a node lives on in silence is its own setting.
    limits = MappingProxyType({LINK: LinkLimits(lost_after=5.0)})
    story = Story(SupervisorConfig(link_limits=limits))
    story.at(0.0, story.heartbeat(healthy=False))
    story.at(9.9)
    assert 4.0 < again(story, BLOCK)[-1] < 5.0


def test_a_value_that_is_no_more_than_nothing_has_no_sign():
    stuck = Measured(value=-0.0, measured_at=100.0, same_since=90.0, count=9)
    assert stuck.unusable(STANDARD_LIMITS["vertical_speed"], 100.0).startswith(
        "stuck at 0 for 10.0 s"
    )
