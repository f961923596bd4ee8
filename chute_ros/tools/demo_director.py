"""Sees a simulated flight through ROS as a user would, and plays the operator."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import rclpy
from chute_msgs.msg import ActionReport, ParachuteStatus, SafetyDecision, SafetyState, VehicleState
from chute_msgs.srv import Arm, Deploy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from chute_ros import model
from chute_ros.errors import ChuteError
from chute_ros.interrupts import in_one_piece
from chute_ros.ros import messages, qos, two_clocks
from chute_ros.ros.middleware import set_up_middleware
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.chart import Mark, chart
from chute_ros.tools.processes import Processes


class StepFailedError(ChuteError):
    """A step of the story did not happen in its time."""


class Director:
    """Follows the topics, calls the services, tells the story, and stops it when a step fails."""

    def __init__(self, namespace: str, processes: Processes) -> None:
        self._processes = processes
        self._started = time.monotonic()
        self._wall_ahead = two_clocks.wall_at(0.0) * 1e-9
        #: From then on times count from the failure; NaN: it has not come.
        self.failure_at = math.nan
        self.vehicle = VehicleState()
        #: The newest status of each link's parachute.
        self.parachutes: dict[str, ParachuteStatus] = {}
        #: When a parachute's own status first said deployed; 0: not yet.
        self.deployed_at = 0.0
        self._statuses = 0
        self.safety = SafetyState()
        self.decisions: list[tuple[float, SafetyDecision]] = []
        self.reports: list[tuple[float, ActionReport]] = []
        self.track: list[tuple[float, float]] = []
        set_up_middleware()
        with in_one_piece():
            self._join(namespace)

    def _join(self, namespace: str) -> None:
        rclpy.init(args=[])
        self.node = Node("director", namespace=namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        subscribe = self.node.create_subscription
        subscribe(VehicleState, "vehicle/state", self._vehicle, qos.STATUS)
        subscribe(ParachuteStatus, "parachute/status", self._parachute, qos.STATUS)
        subscribe(SafetyState, "safety/state", self._safety, qos.LATCHED)
        subscribe(SafetyDecision, "safety/decision", self._decision, qos.DECISION)
        subscribe(ActionReport, "safety/action", self._report, qos.DECISION)
        self._arm = self.node.create_client(Arm, "safety/arm")
        self._deploy = self.node.create_client(Deploy, "safety/deploy")

    def close(self) -> None:
        """Leave ROS, which a Ctrl-C has already done."""
        self.node.destroy_node()
        rclpy.try_shutdown()

    # -- telling --------------------------------------------------------------------------------

    def failure_now(self) -> None:
        """From here on times count from the failure."""
        self.failure_at = time.monotonic()

    def say(self, who: str, text: str) -> None:
        """One line of the story, with the time since the failure, or since the start before it."""
        now = time.monotonic()
        clock = f"  {now - self._started:6.2f} s"
        if not math.isnan(self.failure_at):
            clock = f"T+{now - self.failure_at:6.2f} s"
        print(f"{clock}  {who:<17} {text}", flush=True)

    def summarize(
        self, steps: list[tuple[str, float]], since: str, heights: str, marks: list[Mark]
    ) -> None:
        """When each step came, since the failure, and the heights over time as a picture."""
        print(f"\n  since the {since}")
        for name, when in steps:
            print(f"    {when - self.failure_at:7.3f} s  {name}")
        print(f"\n  {heights}")
        for line in chart(self.track, marks, width=64, rows=11):
            print("  " + line)
        print("\nDEMO PASSED: every step happened, the kill before the deploy")

    def _told(self, message: SafetyDecision | ActionReport | ParachuteStatus) -> float:
        """When its node told it. Messages of two topics reach us in either order."""
        return messages.seconds(message.header.stamp) - self._wall_ahead

    # -- awaiting -------------------------------------------------------------------------------

    def until(self, what: str, seconds: float, condition: Callable[[], bool]) -> None:
        """Spin until condition holds; StepFailedError if it does not within seconds."""
        end = time.monotonic() + seconds
        while not condition():
            self._processes.check()
            if time.monotonic() >= end:
                logs = "\n".join(self._processes.tail(name) for name in self._processes.names())
                raise StepFailedError(f"{what}: not within {seconds:g} s\n{logs}")
            with in_one_piece():
                self._executor.spin_once(timeout_sec=0.05)

    def arm(self, seconds: float) -> None:
        """Call safety/arm, again with each new picture of a parachute until it succeeds;
        StepFailedError with the reason if it has not within seconds."""
        end = time.monotonic() + seconds
        while True:
            answer = self.ask_arm()
            self.until("arming is answered", 10.0, answer.done)
            if answer.result().success:
                return
            if time.monotonic() >= end:
                raise StepFailedError(f"arming: {answer.result().message}")
            self.until("a parachute tells its picture", 5.0, self._newer_than(self._statuses))

    def _newer_than(self, statuses: int) -> Callable[[], bool]:
        return lambda: self._statuses > statuses

    def stage(self, stage: Stage) -> Callable[[], bool]:
        """The supervisor says that the vehicle is in this stage."""
        return lambda: self.safety.state == stage

    def all_parachutes(self, condition: Callable[[ParachuteStatus], bool]) -> bool:
        """Every link's parachute that was heard meets condition, and there is one."""
        return bool(self.parachutes) and all(map(condition, self.parachutes.values()))

    def reported(self, action: model.Action, outcome: model.Outcome) -> Callable[[], bool]:
        """A link has reported this outcome of this action."""
        return lambda: bool(self._when(action, outcome))

    def when(self, action: model.Action, outcome: model.Outcome) -> float:
        """When that was first reported."""
        return self._when(action, outcome)[0]

    def _when(self, action: model.Action, outcome: model.Outcome) -> list[float]:
        wanted = (action, outcome)
        return [when for when, one in self.reports if (one.action, one.outcome) == wanted]

    def decided(self, action: model.Action) -> Callable[[], bool]:
        """The supervisor has decided this."""
        return lambda: any(one.action == action for _, one in self.decisions)

    def decision(self, action: model.Action) -> tuple[float, SafetyDecision]:
        """The first that was, and when."""
        return next((when, one) for when, one in self.decisions if one.action == action)

    def ask_arm(self) -> Any:
        """Call safety/arm; the future of its answer."""
        self.until("safety/arm is offered", 10.0, self._arm.service_is_ready)
        return self._arm.call_async(Arm.Request(arm=True, triggers=0))

    def ask_deploy(self, reason: str) -> Any:
        """Call safety/deploy; the future of its answer."""
        return self._deploy.call_async(Deploy.Request(force=False, reason=reason))

    def ask(self, kind: Any, service: str, **fields: Any) -> Any:
        """Call a service of a node; the future of its answer."""
        client = self.node.create_client(kind, service)
        self.until(f"{service} is offered", 20.0, client.service_is_ready)
        return client.call_async(kind.Request(**fields))

    # -- topics ---------------------------------------------------------------------------------

    def _vehicle(self, message: VehicleState) -> None:
        self.vehicle = message
        if message.height == message.height:
            self.track.append((time.monotonic(), message.height))

    def _parachute(self, message: ParachuteStatus) -> None:
        self._statuses += 1
        self.parachutes[message.link] = message
        if message.deployed and not self.deployed_at:
            self.deployed_at = self._told(message)

    def _safety(self, message: SafetyState) -> None:
        self.safety = message

    def _decision(self, message: SafetyDecision) -> None:
        if any((message.epoch, message.id) == (d.epoch, d.id) for _, d in self.decisions):
            return
        self.decisions.append((self._told(message), message))
        action = model.Action(message.action)
        self.say("supervisor", f"{action.name} ({'; '.join(message.reasons)})")

    def _report(self, message: ActionReport) -> None:
        said = (message.epoch, message.id, message.link, message.outcome)
        if any(said == (r.epoch, r.id, r.link, r.outcome) for _, r in self.reports):
            return  # said again, in case that nobody was there to hear it
        self.reports.append((self._told(message), message))
        action, outcome = model.Action(message.action), model.Outcome(message.outcome)
        self.say(message.link, f"{action.name} {outcome.name}: {message.detail}")
