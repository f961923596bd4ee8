"""The safety supervisor in ROS: a supervisor's runtime, its topics, services, files and timer.

One loop does it all: every message and request goes to the runtime; one timer, set to when that
has something to do, wakes it when nothing comes. What a turn does with its outputs and fails is
reported; the process goes on, and the next turn tries anew.
"""

from __future__ import annotations

import math
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import count
from typing import Any

from builtin_interfaces.msg import Time
from chute_msgs.msg import (
    LinkHeartbeat,
    SafetyDecision,
    SafetyState,
    SafetySummary,
    SupervisorLease,
)
from chute_msgs.srv import Arm
from rclpy.task import Future

from chute_ros import model
from chute_ros.errors import NameTakenError
from chute_ros.protocol.events import Notice
from chute_ros.ros import messages, qos
from chute_ros.ros.flight_recorder import FlightRecorder
from chute_ros.ros.link_log import log_notice
from chute_ros.ros.suite_node import SuiteNode
from chute_ros.ros.supervisor_health import Health
from chute_ros.ros.supervisor_inputs import SupervisorInputs
from chute_ros.ros.supervisor_memory import SupervisorMemory
from chute_ros.ros.supervisor_messages import (
    CANNOT_BE_FULFILLED,
    decisions_task,
    state_message,
    summary_message,
)
from chute_ros.ros.supervisor_parameters import (
    PARAMETERS,
    config_from,
    lease_from,
)
from chute_ros.ros.supervisor_services import SupervisorServices
from chute_ros.ros.vehicle_sources import VehicleSources
from chute_ros.runtime.arming import Answered
from chute_ros.runtime.supervisor import (
    HEARTBEAT_INTERVAL,
    FinishedTurn,
    Start,
    SupervisorRuntime,
)
from chute_ros.runtime.topics import LeaseClaim, PastDecision, SafetyTold, SupervisorBeat
from chute_ros.supervisor import inputs
from chute_ros.supervisor.state_text import MODES

#: A turn so long (s) before a deadline of the core finds the processor awake and its caches filled
#: when the deadline has come (docs/evidence/speed.md). It is seldom reached: what comes moves it
#: on.
EARLY = 0.0012
#: No turn by the clock sooner (s): a deadline that stays where it is must not take the processor.
SHORTEST_SLEEP = 0.0001


class SafetySupervisorNode(SuiteNode):
    """The node safety_supervisor, which is the shell of its runtime."""

    def __init__(self, **options: Any) -> None:
        super().__init__("safety_supervisor", PARAMETERS, **options)
        self.config = config_from(self.values)
        lease = lease_from(self.values, self.config, self.get_name())
        self._memory = SupervisorMemory(self, self.values, self.config)
        self.at_end.callback(self._memory.close)
        start = Start(
            # Rises from start to start; a device node that knows a higher one makes us go on
            # above it.
            max(0, int(time.time()) & 0xFFFFFFFF),
            secrets.token_hex(8),
            self._memory.recall(),
            self._memory.released.before,
            self._memory.armed.before,
            inputs.Mode[self.values["mode"]],
        )
        self._recorder = FlightRecorder(self, self.values)
        self.at_end.callback(self._recorder.close)
        self._health = Health()
        self._seq = count()
        #: Decisions that have left and are not in the black box yet.
        self._unrecorded: list[SafetyDecision] = []
        self.services_offered = SupervisorServices(self, self.wall, self._ask)
        self._arm_clients = {
            link: self.create_client(Arm, f"{link}/arm") for link in self.config.deploy_links
        }
        self._decision_publisher = self.create_publisher(
            SafetyDecision, "safety/decision", qos.DECISION
        )
        self._history_publisher = self.create_publisher(
            SafetyDecision, "safety/history", qos.HISTORY
        )
        self._state_publisher = self.create_publisher(SafetyState, "safety/state", qos.LATCHED)
        self._summary_publisher = self.create_publisher(
            SafetySummary, "safety/summary", qos.LATCHED
        )
        self._lease_publisher = self.create_publisher(SupervisorLease, "safety/lease", qos.STATUS)
        self._carriers: dict[type, Callable[[Any, Time], None]] = {
            model.Decision: self._publish_decision,
            PastDecision: self._publish_past,
            SafetyTold: self._publish_state,
            SupervisorBeat: self._publish_beat,
            LeaseClaim: self._publish_claim,
        }
        self.runtime = SupervisorRuntime(self.config, lease, self, start, time.monotonic())
        self.at_end.callback(self.runtime.afterwards.look, math.inf)
        self.create_subscription(
            SupervisorLease, "safety/lease", self._claim, qos.newest(qos.STATUS)
        )
        SupervisorInputs(self, self._recorder, self._health, self._run)
        self._vehicle_sources = VehicleSources(
            self,
            self.values,
            lambda report, now: self._turn(report),
            before=self.runtime.state.heard.vehicle.link_state,
        )
        for rule in self.config.blind_rules:
            self.get_logger().info(f"rule '{rule}' {CANNOT_BE_FULFILLED}")
        mode = self.runtime.state.mode
        if mode in MODES:
            self.get_logger().warning(f"mode is {MODES[mode]} (parameter mode)")
        if self.runtime.lease.leading:
            self.services_offered.open()
        self.create_timer(1.0, self._diagnose, clock=self.steady)
        self._timer = self.create_timer(HEARTBEAT_INTERVAL, self._turn, clock=self.steady)
        self._turn()

    # -- the loop -------------------------------------------------------------------------------

    def _turn(self, *new: inputs.Input) -> None:
        self._run(lambda now: self.runtime.turn(new, now))

    def _run(self, step: Callable[[float], None]) -> None:
        """Have step(now) done, and sleep until the runtime has something to do."""
        with self._guarded():
            step(time.monotonic())
            runtime, now = self.runtime, time.monotonic()
            due = runtime.core_due
            if due - now > 2.0 * EARLY:
                due -= EARLY
            self._sleep(min(due, runtime.due))

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        try:
            yield
        except NameTakenError:
            raise
        except Exception as error:
            if not self.context.ok():
                raise  # nothing can be told any more
            self._health.failed(error, "a turn was not completed")
            self._tell_mistake()

    def _tell_mistake(self) -> None:
        self.get_logger().error(self._health.newest, throttle_duration_sec=1.0)
        self._sleep(time.monotonic() + HEARTBEAT_INTERVAL)

    def _sleep(self, wake: float) -> None:
        seconds = max(SHORTEST_SLEEP, wake - time.monotonic())
        self._timer.timer_period_ns = int(seconds * 1e9)
        self._timer.reset()

    # -- the runtime's shell ---------------------------------------------------------------------

    def publish(self, message: Any) -> int:
        """On its topic; its stamp, ns."""
        now = self.wall.now()
        self._carriers[type(message)](message, now.to_msg())
        return int(now.nanoseconds)

    def log(self, notice: Notice) -> None:
        """At the level that it deserves."""
        log_notice(self.get_logger(), notice)

    def say(self, said: inputs.LogMessage) -> None:
        """A text of the core for a person."""
        log = self.get_logger()
        log.error(said.text) if said.alarm else log.info(said.text)

    def record(self, turn: FinishedTurn) -> None:
        """In the black box, with the decisions that left."""
        self._recorder.turn(turn.now, turn.new, turn.outputs, turn.before, turn.after, self.config)
        sent, self._unrecorded = self._unrecorded, []
        for message in sent:
            self._recorder.message("safety/decision", message)

    def keep(self, state: Any) -> None:
        """For a start anew."""
        self._memory.keep(state)

    def offer(self, offered: bool) -> None:
        """The services are there only while it leads."""
        if offered:
            self.services_offered.open()
        else:
            self.services_offered.close()

    def failed(self, error: Exception, new: tuple[inputs.Input, ...]) -> str:
        """The core could not take this."""
        self._health.refused(error, new)
        self._tell_mistake()
        return self._health.newest

    def arm(self, link: str, order: inputs.ArmDevices, answered: Answered) -> str:
        """Call a device node's arm service."""
        client = self._arm_clients[link]
        if not client.service_is_ready():
            return f"its service {link}/arm is not there"

        def done(future: Future) -> None:
            answer = future.result()
            self._run(lambda now: answered(answer.success, answer.message, now))

        request = Arm.Request(arm=order.arm, triggers=order.triggers)
        client.call_async(request).add_done_callback(done)
        return ""

    # -- what comes, and what is published ------------------------------------------------------

    def _ask(
        self, make: Callable[[int], inputs.Input], answered: Callable[[inputs.Finish], None]
    ) -> None:
        self._run(lambda now: self.runtime.ask(make, answered, now))

    def _claim(self, message: SupervisorLease) -> None:
        claim = messages.lease_claim_from(message)
        self._run(lambda now: self.runtime.claim(claim, now))

    def _publish_decision(self, decision: model.Decision, stamp: Time) -> None:
        message = messages.decision(decision, stamp)
        self._decision_publisher.publish(message)
        self._unrecorded.append(message)

    def _publish_past(self, past: PastDecision, stamp: Time) -> None:
        """With the stamp of when it was decided."""
        decided = self.wall_at(past.decided_at)
        self._history_publisher.publish(messages.decision(past.decision, decided))

    def _publish_beat(self, beat: SupervisorBeat, stamp: Time) -> None:
        message = LinkHeartbeat(
            link=beat.name,
            seq=next(self._seq) % 2**32,
            link_state=LinkHeartbeat.LINK_OK,
            device_healthy=beat.leading,
            age=0.0,
            supervisor=True,
        )
        message.header.stamp = stamp
        self.heartbeat_publisher.publish(message)
        self.services_offered.tidy()

    def _publish_state(self, told: SafetyTold, stamp: Time) -> None:
        message = state_message(self.config, told, stamp)
        self._state_publisher.publish(message)
        self._summary_publisher.publish(summary_message(self.config, told, message))
        self._recorder.message("safety/state", message)

    def _publish_claim(self, told: LeaseClaim, stamp: Time) -> None:
        self._lease_publisher.publish(messages.lease_claim(told, stamp))

    def _diagnose(self) -> None:
        name, now, runtime = self.diagnostic_name, time.monotonic(), self.runtime
        tasks = [
            decisions_task(name, self.config, runtime.state, now),
            self._health.task(name, runtime, now),
            self._memory.task(name),
            *self._recorder.tasks(),
        ]
        self.diagnostics_publisher.publish(self.stamp(), tasks)

    def destroy_node(self) -> None:
        """The black box ends its file, the memory is written."""
        with ExitStack() as each:  # from the last to the first, each whatever the others raise
            each.callback(super().destroy_node)
            each.callback(self.at_end.close)
