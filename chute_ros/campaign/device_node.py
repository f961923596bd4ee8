"""What every device node does between its protocol and ROS, with the same gate."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count, zip_longest
from typing import Any

from chute_ros.campaign.bus import Bus, Plug, Spoil
from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.supervisor_host import SafetyPicture, SupervisorBeat
from chute_ros.model import Action, Decision, LinkState, Outcome
from chute_ros.protocol.events import (
    ParachuteChanged,
    RequestFinished,
    RequestReport,
    VehicleChanged,
)
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.clock_steps import ClockSteps
from chute_ros.supervisor.decision_gate import DecisionGate, Verdict

_HEARTBEAT_INTERVAL = 0.1  # s
_MAX_DECISION_AGE = 0.5  # s
_SUPERVISOR_LOST_AFTER = 1.0  # s
_GIVE_UP_AFTER = 5.0  # s
#: Two floats that are the same stamp may differ by this, s.
_SAME_STAMP = 1e-5
#: Our own heartbeat on the wire stops when the node has not beaten for so long, s.
_OWNER_SILENCE = 1.0

Begin = Callable[[int, float], None]
Ready = Callable[[], bool]


@dataclass(frozen=True)
class Acted:
    """A decision that the gate of a node let through."""

    at: float
    node: str
    decision: Decision


@dataclass(frozen=True)
class ActionTold:
    """A report on safety/action, as other nodes hear it."""

    action: Action
    report: i.ActionReport


class DeviceNode(Plug):
    """One node. make_link: its protocol, anew with each start."""

    link: Any

    def __init__(
        self,
        bus: Bus,
        process: Process,
        ros: Ros,
        make_link: Callable[[], Any],
        spoil: Spoil | None = None,
    ) -> None:
        super().__init__(bus, process.name, make_link(), spoil=spoil)
        self.process, self._ros, self._make_link = process, ros, make_link
        self._tokens = count(1)
        self.acted: list[Acted] = []
        #: How often it ordered a release that it knew had happened.
        self.ordered_again = 0
        self._begin(0.0)
        ros.subscribe(Decision, process, self._decide)
        ros.subscribe(SupervisorBeat, process, self._supervisor)
        ros.subscribe(SafetyPicture, process, self._safety)

    def _begin(self, now: float) -> None:
        self._gate = DecisionGate(self.name, _MAX_DECISION_AGE)
        self._seq = count()
        self._decisions: dict[int, Decision] = {}
        self._reports: dict[tuple[int, int], i.ActionReport] = {}
        #: Deploys that wait for a parachute: (token, begin, until).
        self._held: list[tuple[int, Begin, Ready, float]] = []
        self._waiting_callers: dict[int, Callable[[bool, str], None]] = {}
        #: Of each supervisor, and of the one that leads: its clock, and when it was heard.
        self._clocks: dict[str, ClockSteps] = {}
        self._clock = ClockSteps(_MAX_DECISION_AGE / 2)
        #: Stamps of its newest heartbeats, and when they left.
        self._sent: deque[tuple[float, float]] = deque(maxlen=50)
        self._heard, self._lost = math.nan, False
        #: Why flight is blocked by decision; empty: it is not.
        self.decided_block = ""
        self.knows_release = False
        self._beat_at = now

    def start_again(self, now: float) -> None:
        """It was killed."""
        self.link = self._make_link()
        self.waiting.clear()
        self._begin(now)
        self.update(now)
        self._ros.world.stir(self)

    # -- for the subclass ------------------------------------------------------------------------

    @abstractmethod
    def carry_out(self, decision: Decision, now: float) -> None:
        """Do what the gate let through."""

    @abstractmethod
    def summary(self, now: float) -> tuple[LinkState, bool]:
        """How the device is: its link, and whether it is healthy."""

    @abstractmethod
    def is_release(self, data: bytes) -> bool:
        """These bytes order a release."""

    def event(self, event: Any) -> None:
        """One that only this kind of link has."""

    def safety_state(self, one: SafetyPicture, now: float) -> None:
        """The supervisor's picture came."""

    def flight_block(self, reason: str, now: float) -> None:
        """Keep a vehicle that stands on the ground for reason, or no longer (empty)."""
        self.link.flight_block(reason, now)

    # -- time ------------------------------------------------------------------------------------

    def asleep_until(self) -> float:
        return self.process.stopped_until

    def keeps_waiting(self) -> bool:
        return not math.isinf(self.process.stopped_until)

    def update(self, now: float) -> None:
        """The protocol's time, and the heartbeat."""
        super().update(now)
        if now >= max(self._beat_at, self.asleep_until()):
            self._beat_at = now + _HEARTBEAT_INTERVAL
            self._beat(now)

    def next_deadline(self) -> float:
        """Of both."""
        due: float = min(self.link.next_deadline(), self._beat_at)
        return max(due, self.asleep_until())

    def flush(self) -> None:
        """Send frames, and publish what happened."""
        frames = self.link.take_output()
        if self.knows_release:
            self.ordered_again += sum(map(self.is_release, frames))
        self.send(frames)
        events = self.link.take_events()
        for event, following in zip_longest(events, events[1:]):
            if isinstance(event, VehicleChanged) and type(following) is type(event):
                continue  # the next tells all that this one does, as in the node's Inbox
            if isinstance(event, ParachuteChanged):
                self.knows_release |= event.status.deployed
                self.publish(i.ParachuteReport(self.name, event.status))
            elif isinstance(event, VehicleChanged):
                self.publish(i.VehicleReport(event.state))
            elif isinstance(event, RequestReport):
                report = event.report
                if (decision := self._decisions.get(report.token)) is not None:
                    self.report(decision, report.outcome, report.detail)
            elif isinstance(event, RequestFinished):
                self._finished(event)
            else:
                self.event(event)

    def publish(self, message: Any) -> None:
        """On its topic."""
        self._ros.publish(self.process, message)

    # -- requests --------------------------------------------------------------------------------

    def arm(self, arm: bool, triggers: int, answered: Callable[[bool, str], None]) -> None:
        """Its arm service is called."""
        now = self._ros.world.now
        if now < self.asleep_until():
            return
        token = next(self._tokens)
        self._waiting_callers[token] = answered
        self.link.arm(token, arm, triggers, now)
        self._after(now)

    def request_for(self, decision: Decision, begin: Begin, now: float) -> None:
        """Begin a request on behalf of a decision: its steps are reported."""
        token = next(self._tokens)
        self._decisions[token] = decision
        begin(token, now)

    def deploy_for(self, decision: Decision, begin: Begin, now: float) -> None:
        """The same for a deploy, once a parachute is heard."""
        self.request_once(decision, begin, self.link.has_parachute, now)

    def request_once(self, decision: Decision, begin: Begin, ready: Ready, now: float) -> None:
        """The same once there is a device for it: a node that has just started waits for it."""
        token = next(self._tokens)
        self._decisions[token] = decision
        if ready():
            begin(token, now)
        else:
            self._held.append((token, begin, ready, now + _GIVE_UP_AFTER))

    def report(self, decision: Decision, outcome: Outcome, detail: str) -> None:
        """Tell the supervisor how far a decision got."""
        gate = self._gate
        report = i.ActionReport(
            *(decision.epoch, decision.id, self.name, outcome, detail),
            *(gate.newest_epoch, gate.newest_id),
        )
        self._reports[decision.epoch, decision.id] = report
        self.publish(report)
        self.publish(ActionTold(decision.action, report))

    # -- inside ----------------------------------------------------------------------------------

    def _after(self, now: float) -> None:
        self.flush()
        self._ros.world.stir(self)

    def _finished(self, event: RequestFinished) -> None:
        finished = event.finished
        self._decisions.pop(finished.token, None)
        caller = self._waiting_callers.pop(finished.token, None)
        if caller is not None:
            caller(finished.success, finished.message)

    def _decide(self, decision: Decision, difference: float, now: float) -> None:
        verdict = self._gate.judge(decision, self._clock.age(difference))
        if verdict is Verdict.ACT:
            self.acted.append(Acted(now, self.name, decision))
            self.carry_out(decision, now)
            self._after(now)
        elif verdict is Verdict.REPEATED:
            report = self._reports.get((decision.epoch, decision.id))
            if report is not None:
                self.publish(report)
        elif verdict is Verdict.OLDER:
            self.report(decision, Outcome.FAILED, verdict.value)

    def decided_flight_block(self, decision: Decision, now: float) -> None:
        """What the supervisor decided of it."""
        blocks = decision.action is Action.FLIGHT_BLOCK
        self.decided_block = ("; ".join(decision.reasons) or decision.rule) if blocks else ""
        self.flight_block(self.decided_block, now)
        self.report(decision, Outcome.CONFIRMED, "told")

    def _supervisor(self, beat: SupervisorBeat, difference: float, now: float) -> None:
        clock = self._clocks.setdefault(beat.name, ClockSteps(_MAX_DECISION_AGE / 2))
        clock.heard(difference, now)
        if beat.leading:
            self._heard, self._clock = now, clock

    def _safety(self, one: SafetyPicture, difference: float, now: float) -> None:
        clock, heard = self._clocks.get(one.supervisor), one.stamps.get(self.name, math.nan)
        left = [at for stamp, at in self._sent if abs(stamp - heard) < _SAME_STAMP]
        if clock is not None and left:
            clock.answered(difference, now - left[0], now)
        self.safety_state(one, now)

    def _beat(self, now: float) -> None:
        self.link.owner_alive(now + _OWNER_SILENCE)
        held, self._held = self._held, []
        for token, begin, ready, until in held:
            if ready() or now >= until:
                begin(token, now)
            else:
                self._held.append((token, begin, ready, until))
        self._sent.append((now + self.process.clock, now))
        self.publish(i.LinkHeartbeat(self.name, *self.summary(now), next(self._seq)))
        if (lost := now - self._heard > _SUPERVISOR_LOST_AFTER) is not self._lost:
            self._lost = lost
            self.flight_block("the supervisor is lost" if lost else self.decided_block, now)
        self.flush()
