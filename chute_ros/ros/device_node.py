"""Base of every device node: a device's runtime in ROS, with the thread of its link.

One thread at a time has the link, its own or the executor's: the link's turn (transport/loop.py).
Events go to the executor, which is the runtime's owner, through an inbox and a guard condition.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Any

from builtin_interfaces.msg import Time
from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    ParachuteStatus,
    SafetyDecision,
    SafetyRequest,
    SafetyState,
)
from chute_msgs.srv import Arm, Deploy
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future

from chute_ros import model
from chute_ros.protocol.events import Notice
from chute_ros.ros import diagnostics, messages, qos
from chute_ros.ros.inbox import Inbox
from chute_ros.ros.link_log import UselessWire, log_notice
from chute_ros.ros.person_requests import PersonRequests, orders
from chute_ros.ros.plain_border import with_plain_texts
from chute_ros.ros.suite_node import SuiteNode
from chute_ros.runtime.device import OWNER_SILENCE, DeviceRuntime, Summary
from chute_ros.runtime.requests import Begin
from chute_ros.runtime.topics import (
    ActionTold,
    DeviceBeat,
    DeviceRequest,
    ParachuteTold,
    SupervisorBeat,
)
from chute_ros.settings import Parameter
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.wire_events import LoopFault, WireChange, WireTrouble


def _old(status: DiagnosticStatus) -> DiagnosticStatus:
    status.level = diagnostics.STALE
    status.message = f"not known now; was: {status.message}"
    return status


class DeviceNode(SuiteNode, ABC):
    """Base of the nodes that speak to a device, and the shell of its runtime. The subclass makes
    the runtime and calls carry with it, makes self.loop, and calls begin."""

    def __init__(self, name: str, parameters: tuple[Parameter, ...], **options: Any) -> None:
        # Before ROS knows the node, as at_end.
        self.loop: WireLoop[Any] | None = None
        super().__init__(name, parameters, **options)
        self.add_on_set_parameters_callback(self._parameters_set)
        self.wire_text = "not opened yet"
        #: What is wrong with the wire while it is open; empty: nothing is known to be.
        self.wire_trouble = ""
        # A service that awaits the device must not keep the other callbacks from running.
        self._service_group = ReentrantCallbackGroup()
        #: The newest picture of each device.
        self.statuses: dict[str, model.ParachuteStatus] = {}
        self._received_at = (0, 0.0)
        self._loop_faults = 0
        self._useless_wire = UselessWire()
        self._drops = diagnostics.RecentDrops()
        #: Who follows what the runtime publishes: (it, its stamp).
        self._followers: dict[type, Callable[[Any, Time], None]] = {}
        self._status_publisher = self.create_publisher(
            ParachuteStatus, "parachute/status", qos.STATUS
        )
        actions = self.create_publisher(ActionReport, "safety/action", qos.DECISION)
        self.follow(DeviceBeat, self._publish_beat)
        self.follow(ActionTold, lambda one, at: actions.publish(messages.action_told(one, at)))
        self._request_publisher = self.create_publisher(
            SafetyRequest, "safety/request", qos.STATUS
        )
        self.follow(DeviceRequest, self._request)
        self.follow(ParachuteTold, self._parachute)
        self._person_requests = PersonRequests(self)

    def carry(self, runtime: DeviceRuntime[Any]) -> None:
        """Be the shell of this runtime; before anything that may bring events."""
        self.runtime = runtime
        guard = self.create_guard_condition(self._drain)
        # An autopilot tells its measurements one right after the other; each picture has all.
        self.inbox = Inbox(
            self._take, guard.trigger, runtime.PICTURES, runtime.REPLACED, runtime.UNHURRIED
        )

    def begin(self) -> None:
        """Start the link's thread and everything that reacts to it."""
        assert self.loop is not None
        self._decisions = self.create_subscription(
            SafetyDecision, "safety/decision", self._decided, qos.newest(qos.DECISION)
        )
        self.create_subscription(
            LinkHeartbeat, "safety/heartbeat", self._heartbeat, qos.newest(qos.STATUS)
        )
        self.create_subscription(SafetyState, "safety/state", self._safety_state, qos.LATCHED)
        self.serve(Arm, "~/arm", self._arm)
        self.serve(Deploy, "~/deploy", self._deploy)
        period = 1.0 / self.runtime.settings.heartbeat_rate
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

    def create_service(self, kind: Any, name: str, callback: Any, **options: Any) -> Any:
        """As of every node of the suite; the record has the calls that order something."""
        if orders(kind):
            callback = self._person_requests.followed(name, callback)
        return super().create_service(kind, name, callback, **options)

    def serve(self, kind: Any, name: str, callback: Any) -> None:
        """Offer a service whose callback may await the device."""
        self.create_service(kind, name, callback, callback_group=self._service_group)

    # -- for the subclass to fill ---------------------------------------------------------------

    @abstractmethod
    def diagnose(self, summary: Summary) -> list[DiagnosticStatus]:
        """The tasks of the device."""

    def parameter_changed(self, name: str, value: Any) -> None:
        """A changeable parameter has a new value."""

    # -- what the subclass may use ---------------------------------------------------------------

    def request(self, begin: Begin) -> Future:
        """Have begin(link, token, now) called in the link's turn; the future is its end."""
        future = Future()
        self.runtime.desk.request(begin, future.set_result)
        return future

    def follow(self, kind: type, follower: Callable[[Any, Time], None]) -> None:
        """Have follower(it, its stamp) called with what the runtime publishes of this kind."""
        self._followers[kind] = follower

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
            self.loop.wire.is_open,
            self.wire_text,
            connection,
            time.monotonic(),
            self._drops,
            self.wire_trouble,
        )

    # -- the runtime's shell ---------------------------------------------------------------------

    def in_link(self, function: Callable[[Any, float], None]) -> None:
        """Have function(link, now) called in the link's turn."""
        assert self.loop is not None
        self.loop.call(function)

    def at_turns_end(self, function: Callable[[Any, float], None]) -> None:
        """The same by the link's own thread, once nothing failed in a turn of it."""
        assert self.loop is not None
        self.loop.call_at_turns_end(function)

    def deliver(self, events: list[Any]) -> None:
        """In the link's turn: hand events to the executor."""
        try:
            self.runtime.in_turn(events)
        finally:
            self.inbox.put(events)

    def publish(self, message: Any) -> int:
        """Give it to whom it is for; its stamp, ns."""
        now = self.wall.now()
        follower = self._followers.get(type(message))
        if follower is not None:
            follower(message, now.to_msg())
        return int(now.nanoseconds)

    def log(self, notice: Notice) -> None:
        """At the level that it deserves."""
        log_notice(self.get_logger(), notice)

    def behind(self) -> float:
        """For how long what came may have waited, s: the processor is short."""
        assert self.loop is not None
        now = time.monotonic()
        return max(self.loop.late.most(now), self.inbox.late.most(now))

    # -- what comes -----------------------------------------------------------------------------

    def _drain(self) -> None:
        self.inbox.drain()

    def _take(self, event: Any) -> None:
        log = self.get_logger()
        if isinstance(event, WireChange):
            self.wire_text = event.text
            log.info(event.text) if event.is_open else log.warning(event.text)
        elif isinstance(event, WireTrouble):
            self.wire_trouble = event.text
            if event.text:
                log.error(event.text)
        elif isinstance(event, LoopFault):
            self._loop_faults += 1
            log.error(event.text, throttle_duration_sec=1.0)
        else:
            self.runtime.take(event, time.monotonic())

    def _decided(self, first: SafetyDecision) -> None:
        """All that wait at once: they are looked at in the order in which they were made."""
        waiting = [
            (messages.decision_from(one), self.difference(one.header.stamp))
            for one in (first, *self._waiting())
        ]
        self.runtime.heard_decisions(waiting, time.monotonic())

    def _waiting(self) -> Iterator[SafetyDecision]:
        """What else has come."""
        with self._decisions.handle:
            for _ in range(qos.DECISION.depth):
                taken = self._decisions.handle.take_message(SafetyDecision, False)
                if taken is None:
                    return
                yield with_plain_texts(taken[0])

    def _heartbeat(self, message: LinkHeartbeat) -> None:
        if message.supervisor:
            beat = SupervisorBeat(message.link, message.device_healthy)
            difference = self.difference(message.header.stamp)
            self.runtime.heard_supervisor(beat, difference, time.monotonic())

    def _safety_state(self, message: SafetyState) -> None:
        difference = self.difference(message.header.stamp)
        picture = messages.safety_picture(message)
        self.runtime.heard_picture(picture, difference, time.monotonic())

    def _publish_beat(self, one: DeviceBeat, stamp: Time) -> None:
        self.heartbeat_publisher.publish(messages.device_beat(one, stamp))

    def _request(self, one: DeviceRequest, stamp: Time) -> None:
        self._request_publisher.publish(messages.device_request(one, stamp))

    def _parachute(self, one: ParachuteTold, stamp: Time) -> None:
        status, at = one.report.status, self.wall_at(one.received)
        self.statuses[status.device] = status
        message = messages.parachute_status(status, one.report.link, at)
        self._status_publisher.publish(message)

    # -- time -----------------------------------------------------------------------------------

    def _beat(self) -> None:
        self.runtime.beat(time.monotonic())

    # -- services -------------------------------------------------------------------------------

    async def _arm(self, request: Arm.Request, response: Arm.Response) -> Arm.Response:
        future = Future()
        self.runtime.arm(request.arm, request.triggers, future.set_result)
        end = await future
        response.success, response.message = end.finished.success, end.finished.message
        self.get_logger().info(messages.answered("~/arm", request, response))
        return response

    async def _deploy(self, request: Deploy.Request, response: Deploy.Response) -> Deploy.Response:
        self.get_logger().warning(f"~/deploy called (force={request.force}): {request.reason!r}")
        future = Future()
        self.runtime.deploy(request.force, future.set_result)
        finished = (await future).finished
        response.success, response.accepted = finished.success, finished.accepted
        response.message = finished.message
        self.get_logger().info(messages.answered("~/deploy", request, response))
        return response

    # -- inside ---------------------------------------------------------------------------------

    def _parameters_set(self, parameters: list[Any]) -> Any:
        for parameter in parameters:
            self.parameter_changed(parameter.name, parameter.value)
        return SetParametersResult(successful=True)

    def _diagnose(self) -> None:
        name, now = self.diagnostic_name, time.monotonic()
        summary = self.runtime.summary
        assert self.loop is not None
        silent = now - self.loop.last_run
        if summary is None and silent <= OWNER_SILENCE:
            return  # it has just started: its first heartbeat is to come
        statuses = [] if summary is None else self.diagnose(summary)
        if summary is None or silent > OWNER_SILENCE:
            text = f"the link's thread has not run for {silent:.1f} s"
            hangs = diagnostics.status(name, "link", diagnostics.ERROR, text, {}, "")
            # What it said last says nothing of now.
            statuses = [hangs, *(_old(one) for one in statuses if one.name != hangs.name)]
        else:
            self._check_wire(summary.link_state, statuses)
        counts = {
            "exceptions in the link's thread": self._loop_faults,
            "statuses left out, executor too slow": self.inbox.left_out,
            "delay behind the wire (s, maximum of 5 s)": f"{self.behind():.2f}",
            **self.runtime.decisions.counts(),
        }
        watch = self.runtime.watch.tell(now)
        statuses.append(diagnostics.supervisor_task(name, watch, counts))
        self.diagnostics_publisher.publish(self.stamp(), statuses)

    def _check_wire(self, device: model.LinkState, statuses: list[DiagnosticStatus]) -> None:
        assert self.loop is not None
        link = next(one for one in statuses if one.name.endswith(": link"))
        never = device is model.LinkState.NEVER_SEEN
        bad = never and self.loop.wire.is_open and link.level != diagnostics.OK
        self._useless_wire.look(self.get_logger(), link.message if bad else "", time.monotonic())
