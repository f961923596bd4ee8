"""Decisions through the gate of a node, and what is reported of them."""

from dataclasses import replace

import pytest
from runtime_shell import Shell

from chute_ros.links.mavlink.runtime import MavlinkRuntime, MavlinkSettings
from chute_ros.model import Action, Decision, Outcome
from chute_ros.protocol.events import Severity
from chute_ros.runtime.decisions import MOST_REPORTS, DecisionCarrier
from chute_ros.runtime.topics import SafetyPicture


class Carried:
    """What a node did, in order. A decision to do nothing fails here."""

    def __init__(self, shell: Shell) -> None:
        self.done: list[int] = []
        self.shell = shell
        self.others: list[int] = []
        self.carrier = DecisionCarrier(
            "upf_can", 0.5, shell, lambda age: age, self._carry_out, self._for_others
        )

    def _carry_out(self, decision: Decision) -> None:
        if decision.action is Action.NONE:
            raise ZeroDivisionError
        self.done.append(decision.id)

    def _for_others(self, decision: Decision) -> None:
        self.others.append(decision.id)

    def hear(self, *told: tuple[int, Action], age: float = 0.01, epoch: int = 8) -> None:
        waiting = [(decision(number, action, epoch), age) for number, action in told]
        self.carrier.heard(waiting, self.shell.now)


def decision(number: int, action: Action, epoch: int = 8) -> Decision:
    return Decision(epoch, number, action, "a rule", ("it fell",), ("upf_can",), False)


def test_what_waited_is_done_in_the_order_in_which_it_was_decided(shell):
    node = Carried(shell)
    node.hear((8, Action.DEPLOY), (7, Action.KILL), (8, Action.DEPLOY))
    assert node.done == [7, 8]


def test_one_that_fails_keeps_no_other_back(shell):
    node = Carried(shell)
    with pytest.raises(ZeroDivisionError):
        node.hear((1, Action.NONE), (2, Action.KILL), (3, Action.DEPLOY))
    assert node.done == [2, 3]


def test_one_that_is_said_again_gets_its_newest_report_again(shell):
    node = Carried(shell)
    node.hear((7, Action.DEPLOY))
    node.hear((7, Action.DEPLOY))
    assert shell.published == [], "it has not got anywhere yet"
    for outcome in (Outcome.SENT, Outcome.CONFIRMED):
        node.carrier.report(decision(7, Action.DEPLOY), outcome, "a test")
    node.hear((7, Action.DEPLOY))
    told = [(one.action, one.report.id, one.report.outcome) for one in shell.published]
    confirmed = (Action.DEPLOY, 7, Outcome.CONFIRMED)
    assert told == [(Action.DEPLOY, 7, Outcome.SENT), confirmed, confirmed]
    assert node.done == [7], "and is done once"


def test_one_of_before_is_answered_with_the_newest_that_was_seen(shell):
    node = Carried(shell)
    node.hear((7, Action.FLIGHT_BLOCK), epoch=16)
    node.hear((9, Action.DEPLOY), epoch=8)
    (told,) = shell.published
    assert (told.report.outcome, told.report.newest_epoch, told.report.newest_id) == (
        Outcome.FAILED,
        16,
        7,
    )


def test_a_late_one_is_complained_of_once_a_second_and_counted_each_time(shell):
    node = Carried(shell)
    for _ in range(25):
        node.hear((7, Action.DEPLOY), age=0.6)
        shell.now += 0.1
    assert node.done == []
    assert node.carrier.counts()["decisions: came too late"] == 25
    assert [one.severity for one in shell.logged] == [Severity.ERROR] * 3


def test_reports_of_long_ago_are_forgotten(shell):
    node = Carried(shell)
    numbers = range(1, MOST_REPORTS + 2)
    for number in numbers:
        node.hear((number, Action.FLIGHT_BLOCK))
        node.carrier.report(decision(number, Action.FLIGHT_BLOCK), Outcome.CONFIRMED, "told")
    assert set(node.carrier._reports) == {(8, number) for number in numbers[1:]}


def test_what_others_carry_out_is_told_if_it_is_young_meant_and_of_who_leads(shell):
    node = Carried(shell)

    def told(number: int, epoch: int = 8, age: float = 0.01, shadow: bool = False) -> list[int]:
        one = replace(
            decision(number, Action.DEPLOY, epoch), targets=("umbilical",), shadow=shadow
        )
        node.carrier.heard([(one, age)], shell.now)
        return node.others

    assert told(1) == [1]
    assert told(2, age=0.6) == [1], "too late"
    assert told(3, shadow=True) == [1], "only said"
    assert told(4, epoch=7) == [1], "of one that led before"
    assert told(5, epoch=9) == [1, 5]
    assert node.done == []


class GroundStation:
    """A MAVLink link that notes what it is told."""

    def __init__(self) -> None:
        self.decided: list[float] = []
        self.texts: list[str] = []
        self.reasons: list[str] = []
        self.deploy_decided = self.decided.append
        self.announce = self.texts.append

    def flight_block(self, reason: str, now: float) -> None:
        self.reasons.append(reason)


def autopilots_node(shell: Shell) -> MavlinkRuntime:
    shell.link = GroundStation()
    return MavlinkRuntime("mavlink_parachute", MavlinkSettings(expect_parachute=False), shell)


def test_the_autopilots_node_is_told_of_a_deploy_on_another_link(shell):
    """PX4 refuses to disarm in flight; it may be terminated once a deploy is decided. The pilot
    reads of it, whose only way is this node's."""
    node = autopilots_node(shell)
    told = [(1, Action.KILL), (2, Action.FLIGHT_BLOCK), (3, Action.DEPLOY), (3, Action.DEPLOY)]
    for number, action in told:
        node.heard_decisions([(decision(number, action), 0.01)], shell.now)
    assert shell.link.decided == [shell.now]
    assert shell.link.texts == ["DEPLOY by upf_can ordered: a rule"]
    picture = SafetyPicture(False, (), "safety_supervisor", {})
    for one in (picture, *[replace(picture, released=True)] * 3):
        node.heard_picture(one, 0.01, shell.now)
    assert shell.link.texts[1:] == ["DEPLOY by upf_can confirmed"]


def test_the_pilot_reads_each_alarm_of_the_supervisor_once(shell):
    node = autopilots_node(shell)
    picture = SafetyPicture(False, (), "safety_supervisor", {})
    told = [("a 1.5 s",), ("a 1.6 s",), ("a 1.7 s", "b"), (), ("b",)]
    for alarms in told:
        node.heard_picture(replace(picture, alarms=alarms), 0.01, shell.now)
    assert shell.link.texts == ["a 1.5 s", "b", "b"], "after a reset it is a new one"


def test_the_pilot_reads_why_flight_is_blocked_now(shell):
    """Given a block of the first second, when nothing was heard yet, and what is wrong later."""
    node = autopilots_node(shell)
    block = replace(decision(1, Action.FLIGHT_BLOCK), targets=("mavlink_parachute",))
    block = replace(block, reasons=("nothing received",))
    node.heard_decisions([(block, 0.01)], shell.now)
    picture = SafetyPicture(True, (), "safety_supervisor", {})
    low = ("1/161 LOW_POWER 13.1 V",), ("1/161 LOW_POWER 13.0 V",)
    for reasons in (("nothing received",), *low, low[0], ()):
        node.heard_picture(replace(picture, block_reasons=reasons), 0.01, shell.now)
    assert shell.link.reasons == ["nothing received", "1/161 LOW_POWER 13.1 V"]
    release = replace(block, id=2, action=Action.FLIGHT_BLOCK_RELEASE)
    node.heard_decisions([(release, 0.01)], shell.now)
    node.heard_picture(replace(picture, block_reasons=low[0]), 0.01, shell.now)
    assert shell.link.reasons[2:] == [""]
