"""The loop closed: core, wires that lose and delay, and device nodes behind their gates."""

import heapq
import itertools
import random
from collections.abc import Callable
from dataclasses import dataclass, field

from hypothesis import given, settings
from hypothesis import strategies as st
from story import FLYING, LINK, START, parachute

from chute_ros.model import Action, Decision, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.decision_gate import DecisionGate, DecisionVerdict
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.state import State
from chute_ros.supervisor.wakes import next_deadline

K, D = Action.KILL, Action.DEPLOY
HEAL = 2.0  # s after START: from then on nothing is lost and nobody restarts
CONFIG = SupervisorConfig(kill_links=(LINK,), deploy_links=(LINK, "upf_can"))
#: What a device needs from the order to its own status, s.
DEVICE_DELAY = 0.15
#: What a node needs to start again, s: longer than any decision lives.
DOWN = 0.7


@dataclass
class Node:
    """A device node: its gate, and what its device did."""

    link: str
    seq: int = 0
    gate: DecisionGate = field(init=False)
    acted: list[tuple[float, Action]] = field(default_factory=list)
    confirmed: set[Action] = field(default_factory=set)
    #: The device: its parachute is out.
    released: bool = False
    up_at: float = 0.0
    reports: dict[tuple[int, int], i.ActionReport] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.restart(0.0)

    def restart(self, up_at: float) -> None:
        self.up_at = up_at
        self.gate = DecisionGate(self.link, max_decision_age=0.5)
        self.seq = 0
        self.reports = {}


class Loop:
    """Events in the order of their time. Chance is seeded, so that a failure is repeatable."""

    def __init__(self, seed: int, loss: float, slowness: float, restarts: list[float]) -> None:
        self.chance = random.Random(seed)
        self.loss, self.slowness = loss, slowness
        self.now = START
        self.state = State(epoch=7, started_at=START)
        self.nodes = {link: Node(link) for link in CONFIG.links}
        self.events: list[tuple[float, int, Callable[[], None]]] = []
        self.number = itertools.count()
        self.newest_arrival: dict[str, float] = {}
        self.answers: dict[int, i.Finish] = {}
        for node in self.nodes.values():
            self.at(START, lambda node=node: self.beat(node))
        for number, time in enumerate(restarts):
            node = list(self.nodes.values())[number % len(self.nodes)]
            back = START + time + DOWN
            self.at(START + time, lambda node=node, back=back: node.restart(back))
        self.feed(i.VehicleReport(FLYING))

    def at(self, time: float, do: Callable[[], None]) -> None:
        heapq.heappush(self.events, (time, next(self.number), do))

    def send(self, wire: str, do: Callable[[], None]) -> None:
        """One message: lost, or later; never before one that was sent earlier."""
        healed = self.now >= START + HEAL
        if not healed and self.chance.random() < self.loss:
            return
        delay = 0.002 if healed else self.chance.random() * self.slowness
        arrival = max(self.now + delay, self.newest_arrival.get(wire, 0.0))
        self.newest_arrival[wire] = arrival
        self.at(arrival, do)

    def run(self, until: float) -> None:
        while True:
            event = self.events[0][0]
            wake = min(event, next_deadline(CONFIG, self.state, self.now))
            if wake > until:
                return
            self.now = max(self.now, wake)
            if wake < event:
                self.feed()
            else:
                heapq.heappop(self.events)[2]()

    def feed(self, *inputs: i.Input) -> None:
        self.state, outputs = update(CONFIG, self.state, inputs, self.now)
        for output in outputs:
            if isinstance(output, i.Finish):
                assert output.token not in self.answers
                self.answers[output.token] = output
            elif isinstance(output, i.Decide):
                for node in self.nodes.values():
                    self.hand_down(node, output.decision)

    def hand_down(self, node: Node, decision: Decision) -> None:
        sent = self.now
        self.send(f"to {node.link}", lambda: self.receive(node, decision, self.now - sent))

    def receive(self, node: Node, decision: Decision, age: float) -> None:
        if self.now - age < node.up_at:
            return  # the decisions' topic keeps nothing for who comes later
        verdict = node.gate.judge(decision, age)
        number = (decision.epoch, decision.id)
        if verdict is DecisionVerdict.ACT:
            node.acted.append((self.now, decision.action))
            if decision.action is D:
                assert D not in node.confirmed, "fired again after its confirmation was heard"
            self.report(node, decision, Outcome.SENT)
            gate = node.gate
            self.at(self.now + DEVICE_DELAY, lambda: self.effect(node, gate, decision))
        elif verdict is DecisionVerdict.REPEATED and number in node.reports:
            report = node.reports[number]
            self.send(f"from {node.link}", lambda: self.hear(report, node))
        elif verdict is DecisionVerdict.OLDER:
            self.report(node, decision, Outcome.FAILED)

    def effect(self, node: Node, gate: DecisionGate, decision: Decision) -> None:
        if gate is node.gate:
            node.released |= decision.action is D
            self.report(node, decision, Outcome.CONFIRMED)

    def report(self, node: Node, decision: Decision, outcome: Outcome) -> None:
        report = i.ActionReport(
            decision.epoch,
            decision.id,
            node.link,
            outcome,
            outcome.name,
            node.gate.newest_epoch,
            node.gate.newest_id,
        )
        node.reports[decision.epoch, decision.id] = report
        self.send(f"from {node.link}", lambda: self.hear(report, node))

    def hear(self, report: i.ActionReport, node: Node) -> None:
        deploy = self.state.deploy
        self.feed(report)
        ours = deploy is not None and (report.epoch, report.id) == deploy.number
        if ours and report.outcome is Outcome.CONFIRMED:
            node.confirmed.add(D)

    def beat(self, node: Node) -> None:
        beat = i.LinkHeartbeat(node.link, LinkState.OK, True, node.seq)
        node.seq += self.now >= node.up_at
        if self.now >= node.up_at:
            status = parachute(node.link, "1", node.released, ())
            self.send(f"from {node.link}", lambda: self.feed(beat))
            self.send(f"from {node.link}", lambda: self.feed(status))
        self.at(self.now + 0.1, lambda: self.beat(node))


WIRES = (
    st.integers(0, 2**32),
    st.sampled_from([0.0, 0.2, 0.5, 0.9, 1.0]),
    st.sampled_from([0.0, 0.05, 0.3, 0.8]),
    st.lists(st.floats(0.0, HEAL), max_size=3),
)


@settings(max_examples=60, deadline=None)
@given(*WIRES, st.floats(0.0, HEAL), st.lists(st.floats(0.0, 6.0), max_size=3))
def test_a_deploy_gets_through_once_the_wires_heal_and_the_motors_are_stopped(
    seed, loss, slowness, restarts, when, kills
):
    loop = Loop(seed, loss, slowness, restarts)
    assert loop.state.stage is Stage.IN_FLIGHT
    loop.at(START + when, lambda: loop.feed(i.DeployRequest(1, False, "it falls")))
    for number, kill in enumerate(kills, start=10):
        loop.at(START + kill, lambda number=number: loop.feed(i.KillRequest(number, "op", "k")))
    # Within the limit from the request on, and shortly after the wires are whole.
    loop.run(START + max(when + CONFIG.kill_to_deploy_delay, HEAL) + 2.5)
    assert loop.state.stage is Stage.DEPLOYED
    assert loop.answers[1].success
    acted = {link: [action for _, action in node.acted] for link, node in loop.nodes.items()}
    assert K in acted[LINK]
    assert any(D in actions for actions in acted.values())
    loop.run(START + 15.0)
    assert all(number in loop.answers for number in range(10, 10 + len(kills)))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.0, 0.4), st.floats(0.0, 2.0))
def test_wires_that_are_only_slow_make_no_device_fire_twice(seed, slowness, when):
    # Reports that come later than decisions are sent again must not multiply them.
    loop = Loop(seed, 0.0, slowness, [])
    loop.at(START + when, lambda: loop.feed(i.DeployRequest(1, False, "it falls")))
    loop.run(START + 6.0)
    assert loop.answers[1].success
    assert any(D in [action for _, action in node.acted] for node in loop.nodes.values())
    for node in loop.nodes.values():
        actions = [action for _, action in node.acted]
        assert actions.count(D) <= 1
        assert actions.count(K) == (node.link in CONFIG.kill_links)


@settings(max_examples=60, deadline=None)
@given(*WIRES)
def test_whatever_the_wires_do_nothing_fires_that_nobody_asked_for(seed, loss, slowness, restarts):
    loop = Loop(seed, loss, slowness, restarts)
    loop.run(START + 5.0)
    for node in loop.nodes.values():
        assert {action for _, action in node.acted} <= {Action.FLIGHT_BLOCK_RELEASE}
