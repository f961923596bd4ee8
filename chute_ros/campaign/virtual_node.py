"""A device node's runtime and its link in a process that may hang or die, on a wire."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from chute_ros.campaign.bus import Bus, Plug, Spoil
from chute_ros.campaign.ros import Process, Ros
from chute_ros.model import Decision
from chute_ros.protocol.dronecan.allocation import KeepTable
from chute_ros.protocol.events import Notice
from chute_ros.runtime.device import DeviceRuntime
from chute_ros.runtime.topics import ParachuteTold, SafetyPicture, SupervisorBeat, VehicleTold
from chute_ros.supervisor.decision_gate import DecisionVerdict

_HEARTBEAT_INTERVAL = 0.1  # s


@dataclass(frozen=True)
class Acted:
    """A decision that the gate of a node let through."""

    at: float
    node: str
    decision: Decision


class VirtualNode(Plug):
    """The shell of a runtime in virtual time, of which both turns are one. make_link: its link,
    make_runtime: what it gets with this shell, both anew with each start."""

    link: Any

    def __init__(
        self,
        bus: Bus,
        process: Process,
        ros: Ros,
        make_link: Callable[[], Any],
        make_runtime: Callable[[VirtualNode], DeviceRuntime[Any]],
        spoil: Spoil | None = None,
    ) -> None:
        super().__init__(bus, process.name, make_link(), spoil=spoil)
        self.process, self._ros = process, ros
        self._make_link, self._make_runtime = make_link, make_runtime
        self.acted: list[Acted] = []
        #: How often it ordered a release that it knew had happened.
        self.ordered_again = 0
        self._begin(0.0)
        ros.subscribe(Decision, process, self._decide)
        ros.subscribe(SupervisorBeat, process, self._supervisor)
        ros.subscribe(SafetyPicture, process, self._safety)

    def _begin(self, now: float) -> None:
        self.runtime = self._make_runtime(self)
        self._delivered: list[Any] = []
        self.knows_release = False
        self._beat_at = now

    def start_again(self, now: float) -> None:
        """It was killed."""
        self.link = self._make_link()
        self.waiting.clear()
        self._begin(now)
        self.update(now)
        self._ros.world.stir(self)

    @abstractmethod
    def is_release(self, data: bytes) -> bool:
        """These bytes order a release."""

    # -- the runtime's shell ---------------------------------------------------------------------

    def in_link(self, function: Callable[[Any, float], None]) -> None:
        """Have function(link, now) called."""
        function(self.link, self._ros.world.now)

    at_turns_end = in_link

    def deliver(self, events: list[Any]) -> None:
        """Have the runtime take them with the next flush."""
        self._delivered += events

    def publish(self, message: Any) -> int:
        """On its topic, or where it is kept."""
        if isinstance(message, ParachuteTold):
            message = message.report
            self.knows_release |= message.status.deployed
        elif isinstance(message, VehicleTold):
            message = message.report
        elif isinstance(message, KeepTable):
            self.link.table_kept(message.number, self._ros.world.now)
        return self._ros.publish(self.process, message)

    def log(self, notice: Notice) -> None:
        """Nobody reads it."""

    def behind(self) -> float:
        """A processor that is short makes a whole process stand still here."""
        return 0.0

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
            self.runtime.beat(now)
            self.flush()

    def next_deadline(self) -> float:
        """Of both."""
        due: float = min(self.link.next_deadline(), self._beat_at)
        return max(due, self.asleep_until())

    def flush(self) -> None:
        """Send frames, and have the runtime take what happened."""
        frames = self.link.take_output()
        if self.knows_release:
            self.ordered_again += sum(map(self.is_release, frames))
        self.send(frames)
        runtime, now = self.runtime, self._ros.world.now
        events, self._delivered = [*self._delivered, *self.link.take_events()], []
        runtime.in_turn(events)
        for event, following in zip_longest(events, events[1:]):
            # Of two pictures one right after the other the node's inbox keeps the second.
            if not isinstance(event, runtime.REPLACED) or type(following) is not type(event):
                runtime.take(event, now)

    # -- what comes ------------------------------------------------------------------------------

    def arm(self, arm: bool, triggers: int, answered: Callable[[bool, str], None]) -> None:
        """Its arm service is called."""
        if self._ros.world.now < self.asleep_until():
            return

        def finished(end: Any) -> None:
            answered(end.finished.success, end.finished.message)

        self.runtime.arm(arm, triggers, finished)
        self.after()

    def after(self) -> None:
        """What came may have something to send, and another deadline."""
        self.flush()
        self._ros.world.stir(self)

    def _decide(self, decision: Decision, difference: float, now: float) -> None:
        verdicts = self.runtime.decisions.verdicts
        before = verdicts[DecisionVerdict.ACT]
        self.runtime.heard_decisions(((decision, difference),), now)
        if verdicts[DecisionVerdict.ACT] > before:
            self.acted.append(Acted(now, self.name, decision))
        self.after()

    def _supervisor(self, beat: SupervisorBeat, difference: float, now: float) -> None:
        self.runtime.heard_supervisor(beat, difference, now)

    def _safety(self, one: SafetyPicture, difference: float, now: float) -> None:
        self.runtime.heard_picture(one, difference, now)
        self.after()
