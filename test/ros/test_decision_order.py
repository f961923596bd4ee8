"""A node that hung finds decisions that were said again and again."""

import pytest
from chute_msgs.msg import SafetyDecision
from node_bench import Bench, stamped

from chute_ros.links.mavlink.node import MavlinkParachuteNode
from chute_ros.model import Action, Decision
from chute_ros.ros import qos


class Hung:
    """A node that does not look at what comes, until it does."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.done: list[tuple[int, Action]] = []
        self.node = bench.add(MavlinkParachuteNode, connection="udpin:127.0.0.1:0")
        bench.executor.remove_node(self.node)
        self.carrier = self.node.runtime.decisions
        self.carrier._carry_out = self._carry_out
        # After it: what this one has heard, it has been given as well.
        self._heard = bench.follow(SafetyDecision, "safety/decision", qos.newest(qos.DECISION))
        self._publisher = bench.client.create_publisher(
            SafetyDecision, "safety/decision", qos.DECISION
        )
        bench.until(lambda: self._publisher.get_subscription_count() == 2, "both listen")

    def _carry_out(self, decision: Decision) -> None:
        if decision.action is Action.NONE:
            raise ZeroDivisionError
        self.done.append((decision.id, decision.action))

    def told(
        self, *decisions: tuple[int, Action] | tuple[int, Action, int], epoch: int = 1
    ) -> None:
        """Each with its number, what it wants, and its epoch where that is another."""
        for number, action, *other in decisions:
            message = SafetyDecision(id=number, action=int(action), targets=["mavlink_parachute"])
            message.epoch = other[0] if other else epoch
            self._publisher.publish(stamped(self.bench.client, message))
        last = decisions[-1][0]
        self.bench.until(lambda: self._heard and self._heard[-1].id == last, "it was given them")

    def goes_on(self) -> None:
        self.bench.executor.add_node(self.node)
        self.bench.until(lambda: self.done, "it acts")


def test_the_kill_comes_before_the_deploy_whichever_was_said_again_first(bench):
    hung = Hung(bench)
    again = ((8, Action.DEPLOY), (7, Action.KILL))
    hung.told(*again * 3, (9, Action.FLIGHT_BLOCK))
    hung.goes_on()
    assert hung.done == [(7, Action.KILL), (8, Action.DEPLOY), (9, Action.FLIGHT_BLOCK)]
    assert hung.carrier.counts()["decisions: the same as one already acted on"] == 4


def test_those_of_a_supervisor_that_is_deposed_do_not_get_before_its_successors(bench):
    hung = Hung(bench)
    hung.told((1, Action.FLIGHT_BLOCK_RELEASE), (9, Action.DEPLOY, 1), epoch=2)
    hung.goes_on()
    assert hung.done == [(1, Action.FLIGHT_BLOCK_RELEASE)]
    assert hung.carrier.counts()["decisions: older than one already seen"] == 1


def test_one_that_fails_keeps_no_other_back(bench):
    hung = Hung(bench)
    hung.told((1, Action.NONE), (2, Action.KILL), (3, Action.DEPLOY))
    with pytest.raises(ZeroDivisionError):
        hung.goes_on()
    assert hung.done == [(2, Action.KILL), (3, Action.DEPLOY)]


def test_of_more_than_the_queue_holds_the_newest_are_left(bench):
    hung = Hung(bench)
    hung.told(*((number, Action.FLIGHT_BLOCK) for number in range(1, 61)))
    hung.goes_on()
    assert [number for number, _ in hung.done] == list(range(11, 61))
