"""The safety supervisor: carries its core's decisions out into ROS and the inputs back in.

One loop does it all: every message and request becomes an input of the core; one timer, set to the
core's next deadline, wakes it when nothing comes. Its heartbeat comes from that loop alone.

What goes wrong inside: an input that the core cannot take is left out, reported, and the loop goes
on. If the core fails without any input, or what a turn does with its outputs, the supervisor falls
silent: a standby takes over, and the device nodes do what on_supervisor_lost says.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import count
from operator import attrgetter
from typing import Any

from builtin_interfaces.msg import Time
from chute_msgs.msg import LinkHeartbeat, SafetyDecision, SafetyState

from chute_ros import model
from chute_ros.nodes import messages, qos
from chute_ros.nodes.afterwards import Afterwards
from chute_ros.nodes.device_arming import DeviceArming
from chute_ros.nodes.flight_recorder import FlightRecorder
from chute_ros.nodes.suite_node import SuiteNode
from chute_ros.nodes.supervisor_health import Health
from chute_ros.nodes.supervisor_inputs import SupervisorInputs
from chute_ros.nodes.supervisor_lease import LeaseKeeper
from chute_ros.nodes.supervisor_memory import Memory
from chute_ros.nodes.supervisor_messages import MODES, decisions_task, state_message
from chute_ros.nodes.supervisor_parameters import (
    PARAMETERS,
    blind_rules,
    config_from,
    lease_from,
)
from chute_ros.nodes.supervisor_services import SupervisorServices
from chute_ros.nodes.vehicle_sources import VehicleSources
from chute_ros.supervisor import inputs
from chute_ros.supervisor.core import next_deadline, update
from chute_ros.supervisor.epochs import epoch_above
from chute_ros.supervisor.lease import Event
from chute_ros.supervisor.state import State

HEARTBEAT_INTERVAL = 0.1  # s
STATE_INTERVAL = 1.0  # s, at the latest
#: A turn so long (s) before a deadline of the core finds the processor awake and its caches filled
#: when the deadline has come (docs/speed.md). It is seldom reached: what comes moves it on.
EARLY = 0.0012
#: No turn by the clock sooner (s): a deadline that stays where it is must not take the processor.
SHORTEST_SLEEP = 0.0001


class SafetySupervisorNode(SuiteNode):
    """The node safety_supervisor."""

    def __init__(self, **options: Any) -> None:
        super().__init__("safety_supervisor", PARAMETERS, **options)
        self.config = config_from(self.values)
        lease = lease_from(self.values, self.config, self.get_name())
        now = time.monotonic()
        # Rises from start to start; a device node that knows a higher one makes us go on above it.
        epoch = epoch_above(max(0, int(time.time()) & 0xFFFFFFFF), lease.rank)
        self.state = State(
            epoch, now, mode=inputs.Mode[self.values["mode"]], leading=not lease.standby
        )
        first: tuple[inputs.Input, ...] = ()
        self._memory = Memory(self, self.values, self.config)
        self.at_end.callback(self._memory.close)
        if (before := self._memory.recall()) is not None:
            self.state = before
            if not lease.standby:
                first = (inputs.TakeOver(epoch_above(max(epoch, before.epoch), lease.rank)),)
        self._recorder = FlightRecorder(self, self.values)
        self.at_end.callback(self._recorder.close)
        self._health = Health()
        self._afterwards = Afterwards()
        self.at_end.callback(self._afterwards.look, math.inf)
        self.services_offered = SupervisorServices(self, self.wall, self._turn)
        self._arming = DeviceArming(self, self.config.deploy_links, self._turn)
        self._seq = count()
        self._beat_at = now
        self._state_at = now
        self._published: State | None = None
        self._decision_publisher = self.create_publisher(
            SafetyDecision, "safety/decision", qos.DECISION
        )
        self._state_publisher = self.create_publisher(SafetyState, "safety/state", qos.LATCHED)
        self.lease = LeaseKeeper(
            self,
            lease,
            self.wall,
            lambda: self.state,
            lambda now: self.state.links_heard(self.config, now),
            self._lease_event,
            self._follow,
        )
        self._inputs = SupervisorInputs(
            self, self.config, self.wall, self._recorder, self._health, self._turn
        )
        self._vehicle_sources = VehicleSources(
            self,
            self.values,
            lambda *told: self._turn(inputs.VehicleReport(*told)),
            before=self.state.vehicle.link_state,
        )
        for rule in blind_rules(self.config, self.values["vehicle_sources"]):
            self.get_logger().warning(
                f"rule '{rule}' can never be fulfilled: the autopilot is the only source of "
                "measurements; add imu or odometry to vehicle_sources"
            )
        if self.state.mode in MODES:
            self.get_logger().warning(f"mode is {MODES[self.state.mode]} (parameter mode)")
        if self.lease.leading:
            self.services_offered.open()
        self.create_timer(1.0, self._diagnose, clock=self.steady)
        self._timer = self.create_timer(HEARTBEAT_INTERVAL, self._turn, clock=self.steady)
        self._turn(*first)

    # -- the loop -------------------------------------------------------------------------------

    def _turn(self, *new: inputs.Input) -> None:
        """Give the core what came, do what it says, sleep until its next deadline."""
        now = time.monotonic()
        with self._guarded():
            self._look(new, now)

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """What fails inside is reported; the process goes on, and the next turn tries anew."""
        try:
            yield
        except Exception as error:
            if not self.context.ok():
                raise  # nothing can be told any more
            self._health.failed(error, "a turn was not done to its end")
            self._tell_mistake()

    def _tell_mistake(self) -> None:
        self.get_logger().error(self._health.newest, throttle_duration_sec=1.0)
        self._sleep(time.monotonic() + HEARTBEAT_INTERVAL)

    def _look(self, new: tuple[inputs.Input, ...], now: float) -> None:
        self.lease.look(now)
        outputs = self._update(new, now)
        if outputs is None and new:
            self._end_calls(new)
            outputs = self._update((), now)
        if outputs is None:
            # The core cannot even look at the clock: silence tells everybody.
            self._afterwards.look(now)
            return
        self._carry_out(outputs, now)
        self._arming.give_up(now)
        if now >= self._beat_at:
            self._beat(now)
        self._afterwards.look(now)
        to_tell = self._changed() or now >= self._state_at
        if self.lease.leading and to_tell and not self._afterwards.quiet:
            self._publish_state(now)
        deadline = next_deadline(self.config, self.state, now)
        if deadline - now > 2.0 * EARLY:
            deadline -= EARLY
        self._sleep(min(deadline, self.lease.deadline(now), self._beat_at, self._afterwards.until))

    def _end_calls(self, refused: tuple[inputs.Input, ...]) -> None:
        """Who called must not wait for what the core could not take."""
        text = f"refused: {self._health.newest}"
        for token in (getattr(one, "token", 0) for one in refused):
            self.services_offered.finished(inputs.Finish(token, False, False, text))

    def _update(
        self, new: tuple[inputs.Input, ...], now: float
    ) -> tuple[inputs.Output, ...] | None:
        """One turn of the core, whose decisions leave at once; None: it failed, the state is as
        before, and it was reported."""
        before = self.state
        try:
            self.state, outputs = update(self.config, before, new, now)
        except Exception as error:  # noqa: BLE001 - the loop must go on, and say so
            self._health.refused(error, new)
            self._tell_mistake()
            return None
        decisions = [output for output in outputs if isinstance(output, inputs.Decide)]
        if decisions and self.lease.config.standby:
            # Whoever takes over must know of what left.
            self.lease.tell(now)
        # Before anything is kept or told of it: a device waits for this.
        sent = [self._publish_decision(one.decision) for one in decisions]
        self._recorder.turn(now, new, outputs, before, self.state, self.config)
        for message in sent:
            self._recorder.message("safety/decision", message)
        if decisions:
            self._afterwards.decided(now)
            self._afterwards.tell(partial(self._tell_decisions, decisions))
        return outputs

    def _sleep(self, wake: float) -> None:
        seconds = max(SHORTEST_SLEEP, wake - time.monotonic())
        self._timer.timer_period_ns = int(seconds * 1e9)
        self._timer.reset()

    def _carry_out(self, outputs: tuple[inputs.Output, ...], now: float) -> None:
        """All but the decisions, which have left by now. Answers first: who waits for one must get
        it, whatever fails besides."""
        for output in sorted(outputs, key=lambda one: not isinstance(one, inputs.Finish)):
            if not isinstance(output, inputs.Decide):
                self._do(output, now)

    def _do(self, output: inputs.Output, now: float) -> None:
        if isinstance(output, inputs.Finish):
            self.services_offered.finished(output)
        elif isinstance(output, inputs.ArmDevices):
            self._arming.begin(output, now)
        elif isinstance(output, inputs.Refused):
            self.lease.refused(output.newest_epoch, now)
        else:
            self._afterwards.tell(partial(self._log, output))

    def _log(self, output: inputs.Say) -> None:
        log = self.get_logger()
        log.error(output.text) if output.alarm else log.info(output.text)

    def _publish_decision(self, decision: model.Decision) -> SafetyDecision:
        message = messages.decision(decision, self.stamp())
        self._decision_publisher.publish(message)
        return message

    def _tell_decisions(self, decided: list[inputs.Decide]) -> None:
        self._memory.keep(self.state)
        for output in decided:
            if output.again:
                continue
            decision = output.decision
            shadow = " (SHADOW, not sent)" if decision.shadow else ""
            device = f" device {decision.device}" if decision.device else ""
            self.get_logger().warning(
                f"decision {decision.epoch}.{decision.id} {decision.action.name}{shadow} by rule "
                f"'{decision.rule}' to {', '.join(decision.targets)}{device}: "
                f"{'; '.join(decision.reasons)}"
            )

    # -- the lease ------------------------------------------------------------------------------

    def _lease_event(self, event: Event) -> None:
        with self._guarded():
            self._follow_lease(event, time.monotonic())

    def _follow_lease(self, event: Event, now: float) -> None:
        if self.lease.leading:
            epoch = self.lease.next_epoch()
            self.get_logger().warning(f"leads from now on, epoch {epoch}: {event.value}")
            outputs = self._update((inputs.TakeOver(epoch),), now)
            self.services_offered.open()
        else:
            self.get_logger().warning(f"only looks on from now on: {event.value}")
            outputs = self._update((inputs.StepDown(event.value),), now)
            self.services_offered.close()
        self._carry_out(outputs or (), now)
        self.lease.tell(now)

    def _follow(self, state: State) -> None:
        self.state = state

    # -- outputs --------------------------------------------------------------------------------

    def _beat(self, now: float) -> None:
        self._health.beat_late = now - self._beat_at
        self._beat_at = max(self._beat_at + HEARTBEAT_INTERVAL, now)
        message = LinkHeartbeat(
            link=self.get_name(),
            seq=next(self._seq) % 2**32,
            link_state=LinkHeartbeat.LINK_OK,
            device_healthy=self.lease.leading,
            age=0.0,
            supervisor=True,
        )
        message.header.stamp = self.stamp()
        self.heartbeat_publisher.publish(message)
        self.lease.tell(now)
        self.services_offered.tidy()

    def _changed(self) -> bool:
        before, now = self._published, self.state
        told = attrgetter("stage", "mode", "next_id", "alarms", "device_blocks")
        return before is None or told(before) != told(now)

    def _publish_state(self, now: float) -> None:
        self._published, self._state_at = self.state, now + STATE_INTERVAL
        self._memory.keep(self.state)
        stamp = self.stamp()
        message = state_message(self.config, self.state, now, stamp)
        message.supervisor = self.get_name()
        message.link_stamps = [self._inputs.stamps.get(link, Time()) for link in self.config.links]
        self._state_publisher.publish(message)
        self._recorder.message("safety/state", message)

    def _diagnose(self) -> None:
        name, now = self.diagnostic_name, time.monotonic()
        tasks = [
            decisions_task(name, self.config, self.state, now),
            self._health.task(name, self.state, self.lease, now),
            self._memory.task(name),
            *self._recorder.tasks(),
        ]
        self.diagnostics_publisher.publish(self.stamp(), tasks)

    def destroy_node(self) -> None:
        """The black box ends its file, the memory is written."""
        with ExitStack() as each:  # from the last to the first, each whatever the others raise
            each.callback(super().destroy_node)
            each.callback(self.at_end.close)
