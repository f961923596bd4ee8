"""One umbilical seen from the ground: bytes and time in, tokens and events out.

The owner feeds what the transport receives into receive, calls update when next_deadline is due,
writes what take_output gives (one token a write), and publishes what take_events gives. It knows
no serial port and no ROS.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable

from chute_ros.links.umbilical.protocol import line_parser as s
from chute_ros.links.umbilical.protocol.config import DeployStage, UmbilicalConfig
from chute_ros.links.umbilical.protocol.decoder import TelemetryDecoder
from chute_ros.links.umbilical.protocol.events import (
    TelemetryReceived,
    UmbilicalEvent,
    WorkProgress,
)
from chute_ros.links.umbilical.protocol.flight_computer import DEVICE, FlightComputerTracker
from chute_ros.links.umbilical.protocol.heartbeat_hold import HeartbeatHold
from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.links.umbilical.protocol.memory import MemoryWorks, WorkStep
from chute_ros.links.umbilical.protocol.orders import Orders
from chute_ros.links.umbilical.protocol.scheduler import HEARTBEAT, Command, CommandScheduler
from chute_ros.links.umbilical.protocol.stream import DumpBytes, Line, StreamReader
from chute_ros.model import LinkState, TriggerFlags, VehicleState
from chute_ros.protocol.boot_clock import Age
from chute_ros.protocol.events import EventLog, Notice, ParachuteChanged, Severity, VehicleChanged
from chute_ros.protocol.liveness import LinkChange
from chute_ros.protocol.requests import Requests

#: A line that is nothing known is shown to a person at most each so many seconds.
_SHOW_UNKNOWN_EACH = 10.0
_MOST_SHOWN = 60
#: Lines for the log a second, at most.
MOST_TOLD = 50
#: Counted: its clock leapt or ran back, or it ended a flight.
DOUBTED = "record held until the next one agrees"


class UmbilicalLink(EventLog):
    """Follows the flight computer and carries commands to it."""

    def __init__(self, config: UmbilicalConfig, layouts: list[Layout]) -> None:
        super().__init__()
        self.config = config
        self.counts: Counter[str] = Counter()
        self.received_bytes = 0
        self.decoder = TelemetryDecoder(layouts, config.layout, self.counts)
        self.computer = FlightComputerTracker(
            config.telemetry, main_counts=config.deploy is not DeployStage.DROGUE
        )
        self.memory = MemoryWorks(config.memory)
        self.scheduler = CommandScheduler(config.scheduler)
        self._requests = Requests(self.scheduler, config.effect)
        self.orders = Orders(config, self._requests, self.computer, self.decoder, self.memory)
        self._stream: Hashable = None
        self._reader = self._new_reader()
        self._now = 0.0
        self._settled_at = 0.0
        self._first_line = True
        self._show_unknown_at = 0.0
        self._told_since = -math.inf
        self._told = 0
        self._hold = HeartbeatHold(config.heartbeat_in_flight)
        self._output: list[Command] = []
        #: Of the commands that were handed out last the names, by their tokens.
        self._handed_out: dict[bytes, str] = {}

    # -- wire side -------------------------------------------------------------------------------

    def wire_opened(self, now: float) -> None:
        """The port is open: tokens may be written."""
        self.scheduler.wire_opened(now)
        self._drive(now)

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        """The next bytes of this stream; a new stream is a port that was opened anew."""
        self._now = now
        self.received_bytes += len(data)
        if stream != self._stream:
            self._stream, self._reader = stream, self._new_reader()
            self._settled_at = now + self.config.settle_time
            self._first_line = True
        if now < self._settled_at:
            # What waited in the flight computer's queue is of before: it must not pass for fresh.
            self.counts["bytes right after the opening"] += len(data)
            return
        self._heard_in_pause(now)
        for item in self._reader.feed(data):
            if isinstance(item, Line):
                self._line(item.data, now)
            else:
                self.memory.heard(item, now)
        self._heard_in_pause(now)
        self._drive(now)

    def stream_ended(self, stream: Hashable) -> None:
        """The port was closed: what was under way on it is over."""
        self._end_dump("the cable was pulled, or the port closed")
        self._reader, self._stream = self._new_reader(), None
        self.computer.cable_pulled()
        self.orders.wire_closed(self._now)

    def update(self, now: float) -> None:
        """Look at the clock: limits, retries, our own heartbeat."""
        self._now = now
        if self.memory.update(now):
            self._end_dump(self.memory.silent())
        changes, picture_changed = self.computer.update(now, bool(self.pause))
        self._changed(changes)
        if picture_changed:
            self._tell_picture(now)
        self.orders.judge_again(now)
        self._requests.update(now)
        self._drive(now)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        parts = (self.memory, self.computer, self._requests, self._hold)
        return min(part.next_deadline() for part in parts)

    def not_written(self, token: bytes) -> None:
        """The port did not take this token, which take_output handed out."""
        if token != HEARTBEAT.token:
            self.orders.token_not_written(self._handed_out.get(token, ""))

    def take_output(self) -> list[bytes]:
        """Tokens to write, each in a write of its own; each is handed out once."""
        output, self._output = self._output, []
        self._handed_out = {command.token: command.name for command in output}
        return [command.token for command in output]

    def take_events(self) -> list[UmbilicalEvent]:
        """New events, oldest first; each is handed out once."""
        happened = [*super().take_events(), *self.decoder.take_notices()]
        for part in (self.orders, self.memory, self._requests):
            happened += part.take_events()
        return [one for one in happened if not self._is_one_too_many(one)]

    # -- what the node asks for ------------------------------------------------------------------

    def owner_alive(self, until: float) -> None:
        """Our heartbeat may be sent until this time: a hung owner must look dead from outside."""
        self.scheduler.owner_alive(until)

    def command(self, token: int, name: str, force: bool, now: float) -> None:
        """A command of the reference by its name."""
        self.orders.command(token, name, force, now)
        self._drive(now)

    def arm(self, token: int, arm: bool, triggers: int, now: float) -> None:
        """Turn the key: it is for all that the flight computer fires."""
        if triggers not in (0, TriggerFlags.FC):
            self.orders.refuse(token, f"triggers {triggers}: the key has but one, need 0")
            return
        self.command(token, "key_arm" if arm else "key_disarm", False, now)

    def deploy(
        self, token: int, force: bool, now: float, again: bool = False, repeated: bool = False
    ) -> None:
        """Fire what the configuration says. again: though telemetry reports that it is out;
        repeated: the same deploy as the one before."""
        self.orders.deploy(token, force, again, repeated, now)
        self._drive(now)

    def set_target(self, token: int, values: tuple[float, ...], now: float) -> None:
        """Set the landing target: two or four floats, by layout."""
        self.orders.set_target(token, values, now)
        self._drive(now)

    def flight_block(self, reason: str, now: float) -> None:
        """Refuse to launch for reason, or no longer (empty)."""
        self.orders.flight_block(reason, now)
        self._drive(now)

    # -- what the node may look at ---------------------------------------------------------------

    @property
    def pause(self) -> str:
        """Why there is no telemetry now, in words; empty: there should be some.

        In flight only what was asked for from here counts: a line from the wire must not hide
        that the flight computer is lost.
        """
        work = self.memory.work
        if work is None or (work.token == 0 and self.computer.flying):
            return ""
        if work.step is not WorkStep.BEGUN and self.computer.fresh(self._now):
            return ""  # it has not begun, and telemetry still comes
        return self.memory.pause

    def has_parachute(self) -> bool:
        """A deploy need not wait: for telemetry that allows it, unless it is sent in any mode."""
        heard = self.scheduler.is_open and self.computer.record is not None
        return heard or self.config.decided_deploy_forces

    def vehicle_state(self, now: float) -> VehicleState:
        """The picture of the rocket."""
        return self.computer.vehicle_state(now)

    # -- inside ----------------------------------------------------------------------------------

    def _is_one_too_many(self, event: UmbilicalEvent) -> bool:
        """A line for a person, of more than he could read: counted, and left out."""
        if not isinstance(event, (s.LogLine, Notice, WorkProgress)):
            return False
        if isinstance(event, Notice) and event.severity is Severity.ERROR:
            return False
        if self._now >= self._told_since + 1.0:
            self._told_since, self._told = self._now, 0
        self._told += 1
        if self._told <= MOST_TOLD:
            return False
        self.counts["lines for the log beyond fifty a second"] += 1
        return True

    def _new_reader(self) -> StreamReader:
        return StreamReader(self.decoder.is_telemetry, self.counts)

    def _heard_in_pause(self, now: float) -> None:
        """Whatever comes in a pause says that it is there; its silence before says nothing."""
        if self.memory.pause:
            liveness = self.computer.liveness
            if liveness.state is LinkState.OK:
                liveness.last_heard = now
            self._changed(self.computer.alive(now))

    def _end_dump(self, why: str) -> None:
        """Give up the flash dump that is under way, if there is one."""
        for item in self._reader.end_dump():
            if isinstance(item, DumpBytes):
                self.memory.heard(item, self._now)
        self.memory.give_up(why)

    def _line(self, line: bytes, now: float) -> None:
        if self._first_line:
            # It may have begun before the port was opened.
            self._first_line = False
            self.counts["first line after the opening"] += 1
            return
        said, reason = s.recognise(line)
        if reason:
            self.counts[reason] += 1
        if isinstance(said, s.Telemetry):
            self._telemetry(said.body, now)
        elif isinstance(said, s.LogLine):
            self._events.append(said)
        elif isinstance(said, s.StrayMark):
            self.counts["mark of a dump that was not under way"] += 1
        elif isinstance(said, s.FlashUsage):
            self.orders.flash_usage(said, now)
            text = f"flash: {said.used} of {said.total} KB used"
            self.notice(Severity.INFO, text)
        elif isinstance(said, s.ArmingBlocked):
            self.notice(Severity.WARNING, f"flight computer: {said.text}")
            self.orders.arming_blocked(said.text, now)
        elif said is not None:
            self.memory.heard(said, now)
        elif line:
            self._unknown(line, now)

    def _unknown(self, line: bytes, now: float) -> None:
        if now < self._show_unknown_at:
            return
        self._show_unknown_at = now + _SHOW_UNKNOWN_EACH
        text = s.printable(line[:_MOST_SHOWN].decode("utf-8", errors="replace"))
        self.notice(Severity.INFO, f"unknown line: {text!r}")

    def _telemetry(self, body: str, now: float) -> None:
        record = self.decoder.decode(body, now)
        if record is None:
            return
        changes, age = self.computer.heard(record, now)
        if age in (Age.OLD, Age.DOUBTFUL):
            is_old = age is Age.OLD
            self.counts["record older than one before" if is_old else DOUBTED] += 1
            return
        if age is Age.RESTARTED:
            where = " IN FLIGHT" if self.computer.restarted_in_flight else ""
            self.notice(Severity.ERROR, f"flight computer restarted{where}")
            self.memory.restarted()
        self._hold.record(self.computer.flying, now)
        self.memory.telemetry(now)
        self._changed(changes)
        self._events.append(TelemetryReceived(record, self.computer.records))
        self._tell_picture(now)
        self._requests.effects_may_show(now)
        self.orders.judge_again(now)

    def _tell_picture(self, now: float) -> None:
        status, received = self.computer.status(now, self.pause), self.computer.liveness.last_heard
        self._events.append(ParachuteChanged(status, received))
        self._events.append(VehicleChanged(self.computer.vehicle_state(now), now))

    def _changed(self, changes: list[LinkChange]) -> None:
        self.link_changed(DEVICE.replace("_", " "), changes)

    def _drive(self, now: float) -> None:
        # What is over is taken out before the next token leaves.
        sends = self._requests.drive(now)
        self.scheduler.withdraw(lambda command: not self.memory.waits_for(command))
        self.scheduler.heartbeats_held = self._hold.holds(self.decoder.layout, now)
        self.scheduler.send_next(now)
        for send in [*sends, *self._requests.drive(now)]:
            self.memory.token_sent(send.command, now)
            self.orders.token_sent(send.command.name, now)
            self._hold.token_sent(send.command.name, now)
            self._output.append(send.command)
