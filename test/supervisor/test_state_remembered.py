"""What the core remembers."""

import math
from dataclasses import replace
from types import MappingProxyType

import pytest
from story import LINK, changed, parachute

from chute_ros.model import Action, Decision, LinkState, Outcome
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.counter import RuleEvidence
from chute_ros.supervisor.link_evidence import LinkEvidence, LinkLimits
from chute_ros.supervisor.measured import Measured
from chute_ros.supervisor.pending import Pending
from chute_ros.supervisor.state import State

UPF = "upf_can"
BOTH = (LINK, UPF)
NEW = State(epoch=7, started_at=0.0)
STEPS = (Outcome.SENT, Outcome.ACCEPTED, Outcome.CONFIRMED)
TWO = SupervisorConfig(deploy_links=BOTH, resend_interval=0.25)


def pending(action: Action = Action.KILL, **outcomes: set[Outcome]) -> Pending:
    """Decided at 10.0 for both links; a and b: what each has reported."""
    decision = Decision(7, 3, action, "r", (), BOTH)
    links = {"a": LINK, "b": UPF}
    told = {links[name]: frozenset(one) for name, one in outcomes.items()}
    return Pending(decision, BOTH, 10.0, 10.0, MappingProxyType(told))


# -- a decision on its way -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("outcomes", "reached"),
    [
        ({}, []),
        ({"a": {Outcome.FAILED}}, []),
        ({"a": {Outcome.SENT}}, [Outcome.SENT]),
        ({"a": {Outcome.SENT, Outcome.FAILED}}, [Outcome.SENT]),
        ({"a": {Outcome.FAILED}, "b": {Outcome.ACCEPTED}}, [Outcome.SENT, Outcome.ACCEPTED]),
        ({"a": {Outcome.CONFIRMED}, "b": {Outcome.FAILED}}, [*STEPS]),
    ],
)
def test_a_decision_has_got_as_far_as_the_best_link(outcomes, reached):
    one = pending(**outcomes)
    assert [step for step in STEPS if one.reached(step)] == reached
    assert one.confirmed is (Outcome.CONFIRMED in reached)


@pytest.mark.parametrize(
    ("outcomes", "failed", "unreported", "not_begun"),
    [
        ({}, False, BOTH, BOTH),
        ({"a": {Outcome.FAILED}}, False, (UPF,), BOTH),
        ({"a": {Outcome.FAILED}, "b": {Outcome.FAILED}}, True, (), BOTH),
        ({"a": {Outcome.FAILED}, "b": {Outcome.SENT, Outcome.FAILED}}, True, (), (LINK,)),
        ({"a": {Outcome.SENT}, "b": {Outcome.ACCEPTED}}, False, (), ()),
        ({"a": {Outcome.CONFIRMED, Outcome.FAILED}, "b": {Outcome.FAILED}}, False, (), (UPF,)),
    ],
)
def test_who_has_failed_or_not_reported_or_not_begun(outcomes, failed, unreported, not_begun):
    one = pending(**outcomes)
    assert one.all_failed() is failed
    assert one.unreported() == unreported
    assert one.not_begun() == not_begun


@pytest.mark.parametrize("action", [Action.KILL, Action.DEPLOY])
@pytest.mark.parametrize(
    ("sent_at", "then"),
    [(10.0, 10.02), (10.08, 10.1), (10.4, 10.5), (10.9, 11.125), (11.0, 11.25), (90.0, 90.25)],
)
def test_a_kill_and_a_deploy_are_sent_again_soon_at_first(action, sent_at, then):
    one = replace(pending(action), sent_at=sent_at)
    assert one.resend_at(TWO) == pytest.approx(then)
    assert one.resend_at(replace(TWO, resend_interval=0.02)) == pytest.approx(sent_at + 0.02)


def test_a_flight_block_is_sent_again_ever_more_rarely():
    block = pending(Action.FLIGHT_BLOCK)
    for sent_at, then in [(10.0, 10.25), (11.0, 11.25), (12.0, 12.5), (14.0, 15.0), (90.0, 91.0)]:
        assert replace(block, sent_at=sent_at).resend_at(TWO) == then


def test_what_was_reported_last_is_told_in_words():
    assert pending().newest_details() == ""
    assert replace(pending(), details=("a: x", "b: y", "a: z")).newest_details() == "b: y; a: z"


def test_a_decision_is_known_by_epoch_and_number():
    assert pending().number == (7, 3)


# -- what is known -------------------------------------------------------------------------------


def test_what_was_never_told_is_nothing():
    assert repr(NEW.measured("height")) == repr(Measured())
    assert repr(NEW.evidence(LINK)) == repr(LinkEvidence())
    assert NEW.rule("tested") == RuleEvidence()
    assert NEW.deploy is None


def test_what_was_told_is_that():
    height, rule = Measured(value=5.0, measured_at=1.0), RuleEvidence(level=1.0)
    links = {LINK: LinkEvidence(heard=1.0)}
    state = changed(NEW, rules={"tested": rule}, measurements={"height": height}, links=links)
    assert state.measured("height") is height
    assert state.evidence(LINK).heard == 1.0
    assert state.rule("tested") is rule


def test_a_link_is_heard_as_long_as_its_own_limits_say():
    limits = MappingProxyType({UPF: LinkLimits(lost_after=4.0)})
    config = SupervisorConfig(deploy_links=(*BOTH, "umbilical"), link_limits=limits)
    heard = {LINK: LinkEvidence(heard=10.0), UPF: LinkEvidence(heard=10.0)}
    state = changed(NEW, links=heard)
    counts = [state.links_heard(config, now) for now in (10.9, 11.0, 13.9, 14.0)]
    assert counts == [2, 1, 1, 0]


@pytest.mark.parametrize(
    ("passed", "count"), [(0.0, 2), (2.5, 2), (2.51, 1)], ids=["now", "at its limit", "old"]
)
def test_a_vehicle_that_is_heard_counts_as_one_more(passed, count):
    config = SupervisorConfig(vehicle_state_age=2.5)
    now = 10.0 + passed
    state = changed(NEW, links={LINK: LinkEvidence(heard=now)}, vehicle_received=10.0)
    assert state.links_heard(config, now) == count


def test_the_newest_heartbeat_is_that_of_any_link():
    assert math.isnan(NEW.newest_heartbeat())
    heard = {"a": LinkEvidence(), "b": LinkEvidence(heard=12.0), "c": LinkEvidence(heard=11.0)}
    state = changed(NEW, links=heard)
    assert state.newest_heartbeat() == 12.0


def test_the_newest_step_of_the_ladder_is_the_last():
    first, second = pending(Action.DEPLOY), replace(pending(Action.DEPLOY), decided_at=12.0)
    assert changed(NEW, deploys=(first, second)).deploy is second


def test_the_ladder_is_that_of_the_order_and_without_one_that_of_the_settings():
    assert NEW.ladder(TWO) == (Rung(LINK), Rung(UPF))
    assert changed(NEW, deploy_ladder=(Rung(UPF),)).ladder(TWO) == (Rung(UPF),)


# -- parachutes that are out ---------------------------------------------------------------------


def out(heard: float, released_at: float) -> State:
    """Device 33 of the second link is out; its node was heard, and said so, at these times."""
    status = parachute(UPF, "33", True).status
    evidence = LinkEvidence(
        heard, LinkState.OK, released_at=released_at, devices=MappingProxyType({"33": status})
    )
    return changed(NEW, links={UPF: evidence})


@pytest.mark.parametrize(
    ("heard", "released_at", "counts"),
    [(9.0, 3.0, True), (5.0, 8.0, True), (5.0, 6.0, False), (5.0, 5.9, False)],
)
def test_a_parachute_counts_while_its_node_is_heard_or_has_just_told_it(
    heard, released_at, counts
):
    limits = MappingProxyType({UPF: LinkLimits(stale_after=2.0, lost_after=4.0)})
    config = SupervisorConfig(deploy_links=BOTH, link_limits=limits)
    state = out(heard, released_at)
    assert state.released(config) == {(UPF, "33")}
    assert bool(state.newly_released(config, 10.0)) is counts
    before = changed(state, released_before=frozenset({(UPF, "33")}))
    assert not before.newly_released(config, 10.0)


def test_a_parachute_of_a_link_that_deploys_nothing_is_not_looked_at():
    assert out(9.0, 9.0).released(SupervisorConfig()) == frozenset()
