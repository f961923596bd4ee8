"""The single steps, word for word and at their limits."""

from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from story import FLYING, LINK, STANDING, Story, changed, parachute

from chute_ros.model import Action, Decision, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor import sending
from chute_ros.supervisor.answers import answer_all, deploy_details, end_kill, give_up_waiting
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.machine import Stage, StageEvent
from chute_ros.supervisor.pending import Pending
from chute_ros.supervisor.sending import (
    fire,
    kill_failed,
    pending_in,
    put,
    renew,
    renew_missing,
    renew_not_begun,
    send_again,
)
from chute_ros.supervisor.state import State
from chute_ros.supervisor.turn import Turn

K, D = Action.KILL, Action.DEPLOY
BLOCK = Action.FLIGHT_BLOCK
UPF = "upf_can"
BOTH = (LINK, UPF)
TWO = SupervisorConfig(
    kill_links=BOTH, deploy_links=BOTH, deploy_ladder=(Rung(UPF, "1/162"), Rung(LINK))
)


def steps(config: SupervisorConfig = TWO, now: float = 100.0, **known: Any) -> Turn:
    return Turn(config, changed(State(epoch=7, started_at=0.0), **known), now)


def decided(number: int, action: Action, *targets: str, **known: Any) -> Pending:
    """Decided at 90.0."""
    decision = Decision(7, number, action, "tested", ("why",), targets or BOTH, device="1/162")
    return Pending(decision, targets or BOTH, 90.0, 90.0, **known)


#: A kill that is still meant, and one that is not: deploy_timeout is 8 s.
OLD, YOUNG = decided(1, K), replace(decided(1, K), decided_at=92.5)


def reports(**outcomes: Outcome) -> MappingProxyType[str, frozenset[Outcome]]:
    links = {"a": LINK, "b": UPF}
    return MappingProxyType({links[name]: frozenset({one}) for name, one in outcomes.items()})


# -- moving --------------------------------------------------------------------------------------


def test_a_move_is_said_with_its_reason_and_without_one():
    one = steps()
    one.move(StageEvent.LINKS_HEALTHY)
    one.move(StageEvent.KILL, "smoke")
    one.move(StageEvent.KILL, "smoke again")
    assert (one.state.stage, one.state.stage_since) == (Stage.KILLING, 100.0)
    assert one.outputs == [
        i.LogMessage("STARTUP -> READY: every required link is healthy"),
        i.LogMessage("READY -> KILLING: a kill was decided (smoke)"),
    ]


# -- deciding ------------------------------------------------------------------------------------


def test_a_shadow_names_all_that_it_would_have_sent():
    one = steps(mode=i.Mode.SHADOW, next_id=4)
    fire(one, K, "tested", ("why",))
    fire(one, D, "tested", ("why",))
    assert one.outputs == [
        i.Decide(Decision(7, 4, K, "tested", ("why",), BOTH, True)),
        i.Decide(Decision(7, 5, D, "tested", ("why",), (UPF,), True, "1/162")),
    ]
    assert (one.state.killing.kill, one.state.deploying.deploys) == (None, ())


def test_a_step_of_the_deploy_goes_to_its_link_and_device_alone():
    one = steps(stage=Stage.DEPLOYING, kill=decided(1, K), next_id=4)
    fire(one, D, "tested", ("why",))
    decision = Decision(7, 4, D, "tested", ("why",), (UPF,), False, "1/162")
    assert one.outputs == [i.Decide(decision)]
    assert one.state.deploying.deploys == (Pending(decision, (UPF,), 100.0, 100.0),)
    fire(one, D, "tested", ("not yet",))
    assert [d.decision.targets for d in one.state.deploying.deploys] == [(UPF,), (LINK,)]


@pytest.mark.parametrize(
    "known",
    [{"leading": False}, {"mode": i.Mode.INHIBITED}, {"stage": Stage.KILLING}, {"kill": None}],
)
def test_no_deploy_leaves_without_its_kill_its_stage_its_mode_and_the_lead(known):
    one = steps(**{"stage": Stage.DEPLOYING, "kill": decided(1, K), **known})
    fire(one, D, "tested", ("why",))
    assert one.outputs == []


def test_a_kill_goes_to_every_link_that_stops_motors_and_to_no_device():
    one = steps(next_id=4)
    fire(one, K, "tested", ("why",))
    decision = Decision(7, 4, K, "tested", ("why",), BOTH, False, "")
    assert one.outputs == [i.Decide(decision)]
    assert one.state.killing.kill == Pending(decision, BOTH, 100.0, 100.0)


@pytest.mark.parametrize("known", [{"leading": False}, {"mode": i.Mode.INHIBITED}])
def test_no_kill_leaves_from_one_that_follows_or_is_inhibited(known):
    one = steps(**known)
    fire(one, K, "tested", ("why",))
    assert one.outputs == []


# -- deciding anew -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stage", "known", "wanted"),
    [
        (Stage.READY, {}, (True, False, False)),
        (Stage.IN_FLIGHT, {}, (True, False, False)),
        (Stage.KILLING, {}, (True, False, False)),
        (Stage.KILLING, {"kill": YOUNG}, (True, True, False)),
        (Stage.KILLING, {"kill": OLD}, (True, False, False)),
        (Stage.KILLING, {"kill": YOUNG, "killed_in_flight": True}, (False, True, False)),
        (Stage.KILLING, {"kill": OLD, "deploy_rule": "tested"}, (False, True, False)),
        (Stage.DEPLOYING, {"kill": OLD, "deploy_rule": "tested"}, (False, True, True)),
        (Stage.DEPLOYED, {"kill": OLD}, (True, True, False)),
        (Stage.FAULT, {"kill": YOUNG, "killed_in_flight": True}, (True, True, False)),
        (Stage.FAULT, {"kill": OLD}, (True, False, False)),
        (Stage.IN_FLIGHT, {"kill": YOUNG}, (True, False, False)),
    ],
)
def test_each_stage_wants_what_still_helps(stage, known, wanted):
    one = steps(stage=stage, deploys=(decided(2, D),), **known)
    assert tuple(sending.wanted(one, slot) for slot in ("block", "kill", 0)) == wanted


def test_what_is_decided_anew_keeps_its_order_and_its_limits():
    kill = decided(1, K, given_up=True, details=("old",))
    one = steps(stage=Stage.KILLING, kill=kill, next_id=4, deploy_rule="tested")
    renew(one, "kill", "it restarted")
    renew(one, "kill", "it restarted")
    decisions = [output.decision for output in one.outputs if isinstance(output, i.Decide)]
    assert decisions == [
        Decision(7, number, K, "tested", ("why", "it restarted"), BOTH, False, "1/162")
        for number in (4, 5)
    ]
    assert one.state.killing.kill == Pending(decisions[1], BOTH, 90.0, 100.0, given_up=True)


@pytest.mark.parametrize(
    "known",
    [
        {"leading": False},
        {"stage": Stage.IN_FLIGHT},
        {"kill": None},
        {"kill": decided(1, K, outcomes=reports(a=Outcome.CONFIRMED))},
    ],
)
def test_a_kill_that_is_done_or_not_wanted_is_not_decided_anew(known):
    one = steps(**{"stage": Stage.KILLING, "kill": decided(1, K), **known})
    renew(one, "kill", "it restarted")
    assert one.outputs == []


def test_a_flight_block_is_decided_anew_also_when_it_was_begun_or_confirmed():
    for outcome in (Outcome.CONFIRMED, Outcome.SENT):
        block = decided(1, BLOCK, outcomes=reports(a=outcome, b=outcome))
        restarted, taken = (steps(stage=Stage.BLOCKED, block=block) for _ in range(2))
        renew(restarted, "block", "it restarted")
        renew_not_begun(taken, "another took over")
        assert len(restarted.outputs) == len(taken.outputs) == 1, outcome


def test_of_the_deploy_only_what_was_not_begun_is_decided_anew():
    begun = reports(b=Outcome.SENT)
    deploys = (decided(2, D, UPF, outcomes=begun), decided(3, D, LINK))
    kill = decided(1, K, outcomes=reports(a=Outcome.SENT, b=Outcome.SENT))
    one = steps(stage=Stage.DEPLOYING, kill=kill, deploys=deploys, next_id=4)
    renew_not_begun(one, "another took over")
    (output,) = one.outputs
    assert isinstance(output, i.Decide)
    assert (output.decision.targets, output.decision.reasons) == (
        (LINK,),
        ("why", "another took over"),
    )
    assert one.state.deploying.deploys[0] == deploys[0]
    assert one.state.deploying.deploys[1].decision == output.decision


def test_those_that_have_not_reported_get_a_new_number_and_the_rest_stays():
    told = reports(a=Outcome.SENT)
    kill = decided(1, K, outcomes=told, details=("a: told",), earlier=frozenset({(7, 0)}))
    one = steps(stage=Stage.KILLING, kill=kill, next_id=4)
    renew_missing(one, "kill", "it saw a newer one first")
    reasons = ("why", "it saw a newer one first")
    decision = Decision(7, 4, K, "tested", reasons, (UPF,), False, "1/162")
    assert one.outputs == [i.Decide(decision)]
    assert one.state.killing.kill == Pending(
        decision, BOTH, 90.0, 100.0, told, ("a: told",), frozenset({(7, 0), (7, 1)})
    )
    follows = steps(stage=Stage.KILLING, kill=kill, leading=False)
    renew_missing(follows, "kill", "it saw a newer one first")
    assert follows.outputs == []


def test_what_is_sent_again_is_the_same():
    kill = decided(1, K)
    one = steps(kill=kill)
    send_again(one, "kill")
    assert one.outputs == [i.Decide(kill.decision, again=True)]
    assert one.state.killing.kill == replace(kill, sent_at=100.0)


def test_each_step_of_the_ladder_has_its_own_place():
    first, second, third = (decided(number, D) for number in (2, 3, 4))
    one = steps(deploys=(first, second, third))
    assert sending.slots(one) == ("block", "kill", 0, 1, 2)
    changed = replace(second, sent_at=95.0)
    put(one, 1, changed)
    assert one.state.deploying.deploys == (first, changed, third)
    put(one, 3, first)
    assert one.state.deploying.deploys == (first, changed, third, first)
    assert [pending_in(one, slot) for slot in (0, 1, 2)] == [first, changed, third]


# -- in words ------------------------------------------------------------------------------------


def test_the_details_of_every_step_are_told():
    deploys = (decided(2, D, details=("a: x",)), decided(3, D), decided(4, D, details=("b: y",)))
    assert deploy_details(steps(deploys=deploys)) == "a: x; b: y"


def test_an_alarm_is_kept_once_and_the_newest_are_kept():
    one = steps()
    for number in range(20):
        one.alarm(f"alarm {number}")
        one.alarm("alarm 0")
    assert one.outputs[:2] == [i.LogMessage("alarm 0", alarm=True)] * 2
    assert one.state.alarming.alarms[-1] == "alarm 19"
    assert len(one.state.alarming.alarms) == 16


def test_who_waits_for_nothing_is_not_answered():
    one = steps()
    one.finish(0, True, True, "done")
    one.finish(5, True, False, "done")
    assert one.outputs == [i.Finish(5, True, False, "done")]


# -- the end of a kill ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("now", "outcomes", "failed"),
    [
        (95.9, {}, False),
        (96.0, {}, True),
        (91.0, {"a": Outcome.FAILED}, False),
        (91.0, {"a": Outcome.FAILED, "b": Outcome.FAILED}, True),
        (99.0, {"a": Outcome.CONFIRMED}, False),
    ],
)
def test_a_kill_has_failed_when_nobody_is_expected_to_confirm_it_any_more(now, outcomes, failed):
    kill = decided(1, K, outcomes=reports(**outcomes))
    assert kill_failed(steps(now=now), kill) is failed


def test_everyone_who_waits_hears_how_the_kill_went_and_that_it_failed_is_said_once():
    one = steps(now=96.0, kill=decided(1, K), kill_tokens=(5, 6))
    end_kill(one)
    end_kill(one)
    words = "no report within 6.0 s"
    assert one.outputs == [
        i.Finish(5, False, False, words),
        i.Finish(6, False, False, words),
        i.LogMessage(f"the motors may still turn, no kill confirmed: {words}", alarm=True),
    ]
    assert one.state.own.kill_tokens == ()


@pytest.mark.parametrize(
    ("now", "outcomes", "answers"),
    [
        # It was taken and failed; it is confirmed; it is under way.
        (96.0, {"a": Outcome.ACCEPTED}, [i.Finish(5, False, True, "a: ok")]),
        (91.0, {"a": Outcome.CONFIRMED}, [i.Finish(5, True, True, "a: ok")]),
        (91.0, {}, []),
    ],
)
def test_a_kill_is_answered_with_the_words_of_the_links_once_it_has_ended(now, outcomes, answers):
    kill = decided(1, K, outcomes=reports(**outcomes), details=("a: ok",))
    one = steps(now=now, kill=kill, kill_tokens=(5,))
    end_kill(one)
    assert [output for output in one.outputs if isinstance(output, i.Finish)] == answers
    assert len(one.outputs) == (2 if now == 96.0 else len(answers))
    assert one.state.own.kill_tokens == (() if answers else (5,))
    nobody = steps()
    end_kill(nobody)
    assert nobody.outputs == []


# -- nobody waits any more -----------------------------------------------------------------------

WAITING: dict[str, Any] = {
    "kill_tokens": (5,),
    "deploy_tokens": (6,),
    "deploy_rule": "tested",
    "deploy_reasons": ("why",),
}


@pytest.mark.parametrize(
    ("end", "rule", "reasons"), [(answer_all, "tested", ("why",)), (give_up_waiting, "", ())]
)
def test_whoever_waits_is_answered_and_what_was_ordered_stays_unless_it_is_given_up(
    end, rule, reasons
):
    one = steps(**WAITING)
    end(one, "another decides")
    assert one.outputs == [i.Finish(n, False, False, "another decides") for n in (5, 6)]
    assert (one.state.own.kill_tokens, one.state.own.deploy_tokens) == ((), ())
    deploying = one.state.deploying
    assert (deploying.deploy_rule, deploying.deploy_reasons) == (rule, reasons)


def test_what_is_out_on_the_ground_adds_to_what_was():
    story = Story(TWO)
    story.at(0.1, story.heartbeat(), i.VehicleReport(STANDING), parachute(deployed=True))
    story.at(0.2, story.heartbeat(UPF), parachute(UPF, "33", True), i.VehicleReport(STANDING))
    story.at(0.3, parachute(deployed=True, alive=False), i.VehicleReport(FLYING))
    assert story.state.stage is Stage.IN_FLIGHT
    assert story.fired() == []
