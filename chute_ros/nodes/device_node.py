"""What every device node does: its link's thread, heartbeats, decisions, reports, diagnostics.

One thread at a time has the link, its own or the executor's: the link's turn (transport/loop.py).
Events go to the executor through an inbox and a guard condition. The heartbeat makes one round:
the executor's timer asks the link's own thread, whose answer, a summary, is an event that the
executor publishes. A hang of either is silence.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from chute_msgs.msg import (
    LinkHeartbeat,
    ParachuteStatus,
    SafetyRequest,
    SafetyState,
)
from chute_msgs.srv import Arm, Deploy
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future

from chute_ros import model
from chute_ros.nodes import diagnostics, messages, qos
from chute_ros.nodes.decision_carrier import DecisionCarrier
from chute_ros.nodes.inbox import Inbox
from chute_ros.nodes.link_log import UselessWire, log_event
from chute_ros.nodes.parameters import Parameter
from chute_ros.nodes.request_desk import CallFailed, RequestDesk
from chute_ros.nodes.suite_node import SuiteNode
from chute_ros.nodes.supervisor_watch import (
    BLOCK_FLIGHT,
    WATCH_PARAMETERS,
    SupervisorWatch,
)
from chute_ros.protocol.events import (
    DeviceLinkChanged,
    Notice,
    ParachuteChanged,
    RequestFinished,
    RequestReport,
    VehicleChanged,
)
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.wire_events import LoopFault, WireChange, WireTrouble

COMMON_PARAMETERS = (
    Parameter(
        "max_decision_age",
        0.5,
        "a decision of the supervisor that is older is not acted on, s",
        0.05,
        10.0,
    ),
    Parameter(
        "heartbeat_rate",
        10.0,
        "rate of safety/heartbeat, Hz; below 4 Hz the supervisor's heartbeat_stale_after or "
        "link_limits must allow for it",
        1.0,
        100.0,
    ),
    *WATCH_PARAMETERS,
)
#: Our own link's heartbeat stops when the executor was silent for this long, s.
OWNER_SILENCE = 1.0


@dataclass(frozen=True)
class Summary:
    """The answer of the link to the executor's heartbeat."""

    link_state: model.LinkState
    device_healthy: bool
    age: float
    details: Any
    #: Why the device is not healthy, in words.
    reasons: tuple[str, ...] = ()


@dataclass(frozen=True)
class CarriedOut:
    """The link has done what a decision wants."""

    decision: model.Decision
    text: str


def _old(status: DiagnosticStatus) -> DiagnosticStatus:
    status.level = diagnostics.STALE
    status.message = f"not known now; was: {status.message}"
    return status


def block_reason(decision: model.Decision) -> str:
    """Why this decision keeps the vehicle on the ground; empty: it lets it go."""
    if decision.action is model.Action.FLIGHT_BLOCK_RELEASE:
        return ""
    return "; ".join(decision.reasons) or decision.rule


class DeviceNode(SuiteNode, ABC):
    """Base of the nodes that speak to a device. The subclass makes self.loop and calls begin."""

    #: Events that may be left out where the executor does not keep up.
    PICTURES: tuple[type, ...] = (ParachuteChanged, VehicleChanged)
    #: Events that need only be told of, within a heartbeat's interval.
    UNHURRIED: tuple[type, ...] = ()
    #: What this node says to its device keeps a vehicle on the ground.
    BLOCKS_FLIGHT = True

    def __init__(self, name: str, parameters: tuple[Parameter, ...], **options: Any) -> None:
        # Before ROS knows the node, as at_end.
        self.loop: WireLoop[Any] | None = None
        super().__init__(name, (*COMMON_PARAMETERS, *parameters), **options)
        self.add_on_set_parameters_callback(self._parameters_set)
        # Decisions are as old as the watch of the supervisor tells.
        limit = self.values["max_decision_age"]
        self._supervisor = SupervisorWatch(limit, self.values["supervisor_lost_after"], self.wall)
        self.decisions = DecisionCarrier(self, limit, self._supervisor.age, self.carry_out)
        self.wire_text = "not opened yet"
        #: What is wrong with the wire while it is open; empty: nothing is known to be.
        self.wire_trouble = ""
        # A service that awaits the device must not keep the other callbacks from running.
        self._service_group = ReentrantCallbackGroup()
        guard = self.create_guard_condition(self._drain)
        # An autopilot tells its measurements one right after the other; each picture has all.
        self.inbox = Inbox(
            self._take, guard.trigger, self.PICTURES, (VehicleChanged,), self.UNHURRIED
        )
        self.desk = RequestDesk(self.in_link, self.deliver, self.decisions.report)
        #: The newest picture of each device.
        self.statuses: dict[str, model.ParachuteStatus] = {}
        self._received_at = (0, 0.0)
        #: Why flight is blocked by decision; empty: it is not.
        self._decided_block = ""
        self._loop_faults = 0
        self._useless_wire = UselessWire()
        self._summary: Summary | None = None
        self._status_publisher = self.create_publisher(
            ParachuteStatus, "parachute/status", qos.STATUS
        )
        self._request_publisher = self.create_publisher(
            SafetyRequest, "safety/request", qos.STATUS
        )

    def begin(self) -> None:
        """Start the link's thread and everything that reacts to it."""
        assert self.loop is not None
        self.decisions.begin()
        self.create_subscription(
            LinkHeartbeat, "safety/heartbeat", self._supervisor.heartbeat, qos.newest(qos.STATUS)
        )
        self.create_subscription(SafetyState, "safety/state", self._safety_state, qos.LATCHED)
        self.serve(Arm, "~/arm", self._arm)
        self.serve(Deploy, "~/deploy", self._deploy)
        period = 1.0 / self.values["heartbeat_rate"]
        self.create_timer(period, self._beat, clock=self.steady)
        self.create_timer(1.0, self._diagnose, clock=self.steady)
        self.loop.start()

    def destroy_node(self) -> None:
        """End the link's thread first: it must not call into a node that is gone; and what is
        left of it once nothing reacts to it any more."""
        if self.loop is not None:
            self.loop.stop()
            self.loop = None
        super().destroy_node()
        self.at_end.close()

    def serve(self, kind: Any, name: str, callback: Any) -> None:
        """Offer a service whose callback may await the device."""
        self.create_service(kind, name, callback, callback_group=self._service_group)

    # -- for the subclass to fill ---------------------------------------------------------------

    @abstractmethod
    def summarise(self, link: Any, now: float) -> Summary:
        """In the link's turn: how the device is."""

    @abstractmethod
    def link_event(self, event: Any) -> None:
        """In the executor: one event that only this kind of link has."""

    @abstractmethod
    def failed_end(self, token: int, text: str) -> Any:
        """The end of a request that could not be begun."""

    @abstractmethod
    def carry_out(self, decision: model.Decision) -> None:
        """In the executor: do what the gate let through."""

    @abstractmethod
    def arm_link(self, link: Any, token: int, request: Arm.Request, now: float) -> None:
        """In the link's turn: begin the arm request."""

    @abstractmethod
    def deploy_link(self, link: Any, token: int, request: Deploy.Request, now: float) -> None:
        """In the link's turn: begin the deploy request."""

    @abstractmethod
    def diagnose(self, summary: Summary) -> list[DiagnosticStatus]:
        """The tasks of the device."""

    def safety_state(self, message: SafetyState) -> None:
        """The supervisor's picture came."""

    def parameter_changed(self, name: str, value: Any) -> None:
        """A changeable parameter has a new value."""

    # -- what the subclass may use ---------------------------------------------------------------

    def request(self, begin: Callable[[Any, int, float], None]) -> Future:
        """Have begin(link, token, now) called in the link's turn; the future is its end."""
        return self.desk.request(begin)

    def carry_out_at_once(
        self, decision: model.Decision, function: Callable[[Any, float], None], text: str
    ) -> None:
        """Have function(link, now) called in the link's turn, and report text once it was."""

        def run(link: Any, now: float) -> None:
            function(link, now)
            self.deliver([CarriedOut(decision, text)])

        self.in_link(run)

    def flight_block(self, reason: str) -> None:
        """Keep a vehicle that stands on the ground for reason, or no longer (empty)."""
        self.in_link(lambda link, now: link.flight_block(reason, now))

    def carry_out_flight_block(
        self, decision: model.Decision, blocked: str, released: str
    ) -> None:
        """What the supervisor decided of it, reported with one of the two texts."""
        self._decided_block = block_reason(decision)
        text = blocked if self._decided_block else released
        reason = self._decided_block
        self.carry_out_at_once(decision, lambda link, now: link.flight_block(reason, now), text)

    def deploy_for(
        self, decision: model.Decision, begin: Callable[[Any, int, float], None]
    ) -> None:
        """Have begin(link, token, now) called for a decision, once a parachute is heard."""
        wait = self.values["give_up_after"]
        self.desk.request_once(decision, begin, lambda link: link.has_parachute(), wait)

    def in_link(self, function: Callable[[Any, float], None]) -> None:
        """Have function(link, now) called in the link's turn."""
        assert self.loop is not None
        self.loop.call(function)

    def publish_status(self, status: model.ParachuteStatus) -> None:
        """On parachute/status."""
        message = messages.parachute_status(status, self.get_name(), self.stamp())
        self._status_publisher.publish(message)

    def ask_supervisor(self, request: int, device: str, reason: str) -> None:
        """On safety/request, on a device's behalf."""
        message = SafetyRequest(
            link=self.get_name(), device=device, request=request, reason=reason
        )
        message.header.stamp = self.stamp()
        self._request_publisher.publish(message)

    def rate(self, received: int) -> float:
        """How often something counted came since this was last asked, 1/s."""
        now = time.monotonic()
        before, when = self._received_at
        self._received_at = (received, now)
        return (received - before) / (now - when) if now > when > 0.0 else 0.0

    def wire_picture(self) -> diagnostics.WirePicture:
        """For the link's task in diagnostics."""
        assert self.loop is not None
        connection = self.values["connection"]
        return diagnostics.WirePicture(
            self.loop.wire.is_open, self.wire_text, connection, self.wire_trouble
        )

    # -- inside ---------------------------------------------------------------------------------

    def deliver(self, events: list[Any]) -> None:
        """In the link's turn: hand events to the executor."""
        self.inbox.put(events)

    def _drain(self) -> None:
        self.inbox.drain()

    def _take(self, event: Any) -> None:
        if isinstance(event, Summary):
            self._publish_heartbeat(event)
        elif isinstance(event, WireChange):
            self.wire_text = event.text
            log = self.get_logger()
            log.info(event.text) if event.is_open else log.warning(event.text)
        elif isinstance(event, WireTrouble):
            self.wire_trouble = event.text
            if event.text:
                self.get_logger().error(event.text)
        elif isinstance(event, LoopFault):
            self._loop_faults += 1
            self.get_logger().error(event.text, throttle_duration_sec=1.0)
        elif isinstance(event, CarriedOut):
            self.decisions.report(event.decision, model.Outcome.CONFIRMED, event.text)
        elif isinstance(event, CallFailed):
            self.desk.report(event.token, model.Outcome.FAILED, event.text)
            self.desk.finished(event.token, self.failed_end(event.token, event.text))
        else:
            self._event(event)

    def _event(self, event: Any) -> None:
        if isinstance(event, ParachuteChanged):
            self.statuses[event.status.device] = event.status
            self.publish_status(event.status)
        elif isinstance(event, RequestReport):
            report = event.report
            self.desk.report(report.token, report.outcome, report.detail)
        elif isinstance(event, RequestFinished):
            self.desk.finished(event.finished.token, event)
        elif isinstance(event, (DeviceLinkChanged, Notice)):
            log_event(self.get_logger(), event)
        else:
            self.link_event(event)

    def _beat(self) -> None:
        def answer(link: Any, now: float) -> None:
            link.owner_alive(now + OWNER_SILENCE)
            self.deliver([self.summarise(link, now)])

        assert self.loop is not None
        self.loop.call_at_turns_end(answer)
        if self.desk.holds:
            self.in_link(self.desk.try_held)
        lost = self._supervisor.look()
        if lost is not None:
            self._supervisor_lost(lost)

    def _supervisor_lost(self, lost: bool) -> None:
        """Nobody would stop the motors: a vehicle that stands stays where it is."""
        log = self.get_logger()
        blocks = self.values["on_supervisor_lost"] == BLOCK_FLIGHT and self.BLOCKS_FLIGHT
        if lost:
            log.error(f"the supervisor is lost: {'flight is blocked' if blocks else 'held'}")
        else:
            log.warning("the supervisor is back")
        if blocks:
            self.flight_block("the supervisor is lost" if lost else self._decided_block)

    def _publish_heartbeat(self, summary: Summary) -> None:
        self._summary = summary
        message = LinkHeartbeat(
            link_state=int(summary.link_state),
            device_healthy=summary.device_healthy,
            reasons=list(summary.reasons),
            age=summary.age,
            behind=self._behind(),
        )
        message.header.stamp = self.stamp()
        self._supervisor.beat(message.header.stamp)
        self.publish_heartbeat(message)

    def _behind(self) -> float:
        """For how long what came may have waited, s: the processor is short."""
        assert self.loop is not None
        now = time.monotonic()
        return max(self.loop.late.most(now), self.inbox.late.most(now))

    def _safety_state(self, message: SafetyState) -> None:
        self._supervisor.picture(message, self.get_name())
        self.safety_state(message)

    async def _arm(self, request: Arm.Request, response: Arm.Response) -> Arm.Response:
        end = await self.request(lambda link, token, now: self.arm_link(link, token, request, now))
        response.success, response.message = end.finished.success, end.finished.message
        self.get_logger().info(messages.answered("~/arm", request, response))
        return response

    async def _deploy(self, request: Deploy.Request, response: Deploy.Response) -> Deploy.Response:
        self.get_logger().warning(f"~/deploy called (force={request.force}): {request.reason!r}")
        end = await self.request(
            lambda link, token, now: self.deploy_link(link, token, request, now)
        )
        finished = end.finished
        response.success, response.accepted = finished.success, finished.accepted
        response.message = finished.message
        self.get_logger().info(messages.answered("~/deploy", request, response))
        return response

    def _parameters_set(self, parameters: list[Any]) -> Any:
        for parameter in parameters:
            self.parameter_changed(parameter.name, parameter.value)
        return SetParametersResult(successful=True)

    def _diagnose(self) -> None:
        name = self.diagnostic_name
        summary = self._summary
        assert self.loop is not None
        silent = time.monotonic() - self.loop.last_run
        statuses = [] if summary is None else self.diagnose(summary)
        if summary is None or silent > OWNER_SILENCE:
            text = f"the link's thread has not run for {silent:.1f} s"
            hangs = diagnostics.status(name, "link", diagnostics.ERROR, text, {}, "")
            # What it said last says nothing of now.
            statuses = [hangs, *(_old(one) for one in statuses if one.name != hangs.name)]
        else:
            self._look_at_wire(summary.link_state, statuses)
        faults = {
            "exceptions in the link's thread": self._loop_faults,
            "pictures left out, as the executor did not keep up": self.inbox.left_out,
            "looked late at what came (s, the most of 5 s)": f"{self._behind():.2f}",
        }
        statuses.append(self._supervisor.task(name, faults | self.decisions.counts()))
        self.diagnostics_publisher.publish(self.stamp(), statuses)

    def _look_at_wire(self, device: model.LinkState, statuses: list[DiagnosticStatus]) -> None:
        assert self.loop is not None
        link = next(one for one in statuses if one.name.endswith(": link"))
        never = device is model.LinkState.NEVER_SEEN
        bad = never and self.loop.wire.is_open and link.level != diagnostics.OK
        self._useless_wire.look(self.get_logger(), link.message if bad else "", time.monotonic())
