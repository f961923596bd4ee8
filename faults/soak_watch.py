"""Sees the vehicle through ROS: is it whole, what was decided, which heartbeats were missed."""

from __future__ import annotations

import math
import time
from collections import Counter
from typing import Any

import rclpy
from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    ParachuteStatus,
    SafetyDecision,
    SafetyState,
    SupervisorLease,
    VehicleState,
)
from chute_msgs.srv import Arm, Deploy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from chute_ros.model import Action
from chute_ros.ros import qos
from chute_ros.ros.middleware import set_up_middleware

#: Diagnostics come once a second.
_FRESH = 2.5  # s
_STATE_FRESH = 1.5  # s, it is said each second at the latest
_HEARTBEAT = 0.1  # s
_LINK_OK, _LINK_REGAINED = 1, 4
#: What stays shown for long after it was, though all is well: it is counted, not waited for.
_AFTERGLOW = ("internal errors 0,", "recording,", "heard; a wall clock was set")
#: And so it was set up.
_MEANT = "Enable APS is off: it deploys only by command"
_LASTING_TASKS = ("vehicle service", "decisions")


class Watch:
    """One node of ours beside the vehicle's. names: of its nodes, without the namespace."""

    def __init__(self, namespace: str, links: tuple[str, ...], supervisors: tuple[str, ...]):
        self._namespace = namespace.lstrip("/")
        self._links, self._supervisors = links, supervisors
        self.safety = SafetyState()
        self.vehicle = VehicleState()
        self.parachutes: dict[str, ParachuteStatus] = {}
        self.decisions: dict[tuple[int, int], tuple[float, SafetyDecision]] = {}
        self.reports: list[tuple[float, ActionReport]] = []
        self._claims: dict[str, tuple[float, SupervisorLease]] = {}
        self._tasks: dict[str, tuple[float, DiagnosticStatus]] = {}
        self._safety_at = -math.inf
        self._beats: dict[str, float] = {}
        self.heartbeats_missed: Counter[str] = Counter()
        #: The longest time between two heartbeats of one node, s, since it was set to 0.
        self.longest_gap = 0.0
        set_up_middleware()
        # An interrupt is ours: what was set up must be taken down.
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node("watch", namespace=namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        subscribe = self.node.create_subscription
        subscribe(SafetyState, "safety/state", self._safety, qos.LATCHED)
        subscribe(VehicleState, "vehicle/state", self._vehicle, qos.newest(qos.STATUS))
        subscribe(ParachuteStatus, "parachute/status", self._parachute, qos.newest(qos.STATUS))
        subscribe(SafetyDecision, "safety/decision", self._decision, qos.DECISION)
        subscribe(ActionReport, "safety/action", self._report, qos.DECISION)
        subscribe(SupervisorLease, "safety/lease", self._claim, qos.newest(qos.STATUS))
        subscribe(LinkHeartbeat, "safety/heartbeat", self._beat, qos.newest(qos.reliable(50)))
        subscribe(DiagnosticArray, "/diagnostics", self._diagnostics, qos.reliable(50))
        self.arm = self.node.create_client(Arm, "safety/arm")
        self.deploy = self.node.create_client(Deploy, "safety/deploy")
        self.reset = self.node.create_client(Trigger, "safety/reset")

    def spin(self, seconds: float = 0.02) -> None:
        """Take what comes, for so long at most."""
        self._executor.spin_once(timeout_sec=seconds)

    def close(self) -> None:
        """Leave ROS."""
        self.node.destroy_node()
        rclpy.shutdown()

    def diagnostics_after(self, when: float) -> bool:
        """Every node has told its diagnostics since."""
        names = (*self._links, *self._supervisors)
        told = {name.partition(":")[0] for name, (at, _) in self._tasks.items() if at > when}
        return all(f"{self._namespace}/{name}" in told for name in names)

    def complaints(self) -> list[str]:
        """Why it is not whole; empty: it is."""
        now = time.monotonic()
        said = []
        if now - self._safety_at > _STATE_FRESH:
            said.append("safety/state is silent")
        state = self.safety
        for link, judged, healthy in zip(
            state.links, state.link_states, state.devices_healthy, strict=True
        ):
            if judged not in (_LINK_OK, _LINK_REGAINED):
                said.append(f"{link} is judged {judged}")
            elif not healthy:
                said.append(f"{link} is not healthy")
        if not self._one_leads(now):
            said.append("not one leads and the others follow it")
        for name, (at, status) in self._tasks.items():
            node, _, task = name.partition(": ")
            if task in _LASTING_TASKS or now - at > _FRESH or status.message == _MEANT:
                continue
            if status.level != DiagnosticStatus.OK and not status.message.startswith(_AFTERGLOW):
                said.append(f"{node.rpartition('/')[2]}: {task}: {status.message}")
        if not self.diagnostics_after(now - _FRESH):
            said.append("a node tells no diagnostics")
        return said

    def mistakes(self) -> list[str]:
        """What nodes say went wrong inside themselves."""
        said = []
        for name, (_, status) in self._tasks.items():
            values = {one.key: one.value for one in status.values}
            for key in ("internal errors", "exceptions in the link's thread"):
                if values.get(key, "0") != "0":
                    said.append(
                        f"{name}: {key}: {values[key]} {values.get('newest internal error', '')}"
                    )
        return said

    def recording_lost(self) -> int:
        """Entries that are missing in the black boxes of the supervisors that run."""
        return sum(
            int(one.value)
            for name, (_, status) in self._tasks.items()
            if name.endswith("black box")
            for one in status.values
            if one.key.startswith(("entries left out", "entries lost"))
        )

    def expect(self, name: str) -> None:
        """It starts anew: what it said is of before."""
        self._tasks = {
            key: value
            for key, value in self._tasks.items()
            if not key.startswith(f"{self._namespace}/{name}:")
        }

    def decided(self, action: Action, since: float) -> list[tuple[float, SafetyDecision]]:
        """Decisions for this action, in their order."""
        return [
            (at, one)
            for at, one in self.decisions.values()
            if at >= since and one.action == int(action) and not one.shadow
        ]

    def unanswered(self, since: float, until: float) -> int:
        """Decisions of that time that no device node reported on."""
        answered = {(one.epoch, one.id) for _, one in self.reports}
        return sum(
            since <= at < until and key not in answered for key, (at, _) in self.decisions.items()
        )

    def _one_leads(self, now: float) -> bool:
        if len(self._supervisors) == 1:
            return True
        fresh = [one for at, one in self._claims.values() if now - at < 1.0]
        leading = [one.name for one in fresh if one.leading]
        followers = [one for one in fresh if not one.leading and one.leader in leading]
        return len(leading) == 1 and len(followers) == len(self._supervisors) - 1

    # -- topics ---------------------------------------------------------------------------------

    def _safety(self, message: SafetyState) -> None:
        self.safety, self._safety_at = message, time.monotonic()

    def _vehicle(self, message: VehicleState) -> None:
        self.vehicle = message

    def _parachute(self, message: ParachuteStatus) -> None:
        self.parachutes[message.link] = message

    def _decision(self, message: SafetyDecision) -> None:
        self.decisions.setdefault((message.epoch, message.id), (time.monotonic(), message))

    def _report(self, message: ActionReport) -> None:
        self.reports.append((time.monotonic(), message))

    def _claim(self, message: SupervisorLease) -> None:
        self._claims[message.name] = (time.monotonic(), message)

    def _beat(self, message: LinkHeartbeat) -> None:
        now = time.monotonic()
        before = self._beats.get(message.link)
        if before is not None:
            self.longest_gap = max(self.longest_gap, now - before)
            self.heartbeats_missed[message.link] += max(0, round((now - before) / _HEARTBEAT) - 1)
        self._beats[message.link] = now

    def _diagnostics(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        for status in message.status:
            if status.name.startswith(self._namespace):
                self._tasks[status.name] = (now, status)


def ready(client: Any) -> bool:
    """The service is offered."""
    return bool(client.service_is_ready())
