"""One MAVLink network seen from the vehicle's companion computer: bytes and time in, bytes and events out.

The owner feeds what the transport receives into receive, calls update when next_deadline is due,
sends what take_output gives and publishes what take_events gives. It knows neither sockets nor ROS.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable
from dataclasses import replace
from typing import Any

from chute_ros.model import Armed, LandedState, LinkState, TriggerFlags, VehicleState
from chute_ros.protocol.liveness import LinkChange
from chute_ros.protocol.mavlink import goals
from chute_ros.protocol.mavlink.autopilot import (
    STREAMED_MESSAGES,
    AutopilotTracker,
    is_autopilot,
)
from chute_ros.protocol.mavlink.commands import Acknowledgement, Command
from chute_ros.protocol.mavlink.config import MavlinkConfig
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.effect import Goal
from chute_ros.protocol.mavlink.events import (
    DeviceLinkChanged,
    Event,
    Notice,
    ParachuteChanged,
    Severity,
    VehicleChanged,
)
from chute_ros.protocol.mavlink.frames import Frame, FrameDecoder, FrameEncoder
from chute_ros.protocol.mavlink.parachute import ParachuteTracker
from chute_ros.protocol.mavlink.requests import Requests
from chute_ros.protocol.mavlink.roster import Roster
from chute_ros.protocol.mavlink.signing import Signer, Verifier

#: Most streams (serial port, TCP connections) that are read at once.
_MOST_STREAMS = 16


class MavlinkLink:
    """Follows our parachutes and our autopilot and carries requests through to them."""

    def __init__(
        self, config: MavlinkConfig, signer: Signer | None = None, verifier: Verifier | None = None
    ) -> None:
        self.config = config
        self.counts: Counter[str] = Counter()
        self.received_count = 0
        self.sent_count = 0
        self.parachutes: Roster[ParachuteTracker] = Roster(
            "parachute", config.parachute_system_id, config.parachute_component_id
        )
        self.autopilots: Roster[AutopilotTracker] = Roster(
            "autopilot", config.autopilot_system_id, config.autopilot_component_id
        )
        self.requests = Requests(config)
        self._encoder = FrameEncoder(config.system_id, config.component_id, signer)
        self._verifier = verifier
        self._datagrams = FrameDecoder(verifier, self.counts)
        self._streams: dict[Hashable, FrameDecoder] = {}
        self._next_internal = -1
        self._blocked = ""
        self._disarming = 0
        self._heartbeat_at = -math.inf
        self._heartbeats_until = -math.inf
        self._output: list[bytes] = []
        self._events: list[Event] = []

    # -- wire side ---------------------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        """Bytes came in: a datagram, or (stream given) the next bytes of that stream."""
        if stream is None:
            frames = self._datagrams.feed_datagram(data, now)
        else:
            if stream not in self._streams and len(self._streams) >= _MOST_STREAMS:
                self._streams.clear()
            decoder = self._streams.setdefault(stream, FrameDecoder(self._verifier, self.counts))
            frames = decoder.feed(data, now)
        for frame in frames:
            self.received_count += 1
            self._frame(frame, now)
        self._drive(now)

    def stream_ended(self, stream: Hashable) -> None:
        """A stream (None: every stream) was closed: what it left unfinished does not continue."""
        if stream is None:
            self._streams.clear()
        else:
            self._streams.pop(stream, None)

    def update(self, now: float) -> None:
        """Look at the clock: limits, retries, our own heartbeat."""
        for parachute in self.parachutes.all():
            changes, picture_changed = parachute.update(now)
            self._changed(f"parachute {parachute.device}", changes)
            if picture_changed:
                self._events.append(ParachuteChanged(parachute.status(now)))
        for autopilot in self.autopilots.all():
            changes = autopilot.liveness.update(now)
            self._changed(f"autopilot {autopilot.device}", changes)
            if changes:
                self._events.append(VehicleChanged(autopilot.vehicle_state(now)))
        self.requests.update(now)
        if self._heartbeat_at <= now < self._heartbeats_until:
            self._heartbeat_at = now + self.config.heartbeat_interval
            self._send_heartbeat(now)
        self._drive(now)

    def next_deadline(self) -> float:
        """When update has something to do; at the latest at our next heartbeat."""
        deadlines = [self.requests.next_deadline()]
        deadlines += [p.next_deadline() for p in self.parachutes.all()]
        deadlines += [a.liveness.next_deadline() for a in self.autopilots.all()]
        if self._heartbeat_at < self._heartbeats_until:
            deadlines.append(self._heartbeat_at)
        return min(deadlines)

    def take_output(self) -> list[bytes]:
        """Frames to send, oldest first; each is handed out once."""
        output, self._output = self._output, []
        return output

    def take_events(self) -> list[Event]:
        """What happened, oldest first; each is handed out once."""
        events, self._events = self._events, []
        return events + self.requests.take_events()

    # -- what the node asks for: every request ends in one RequestFinished with its token ------

    def owner_alive(self, until: float) -> None:
        """Our heartbeat may be sent until this time: a hung owner must look dead from outside."""
        self._heartbeats_until = until

    def set_triggers(self, token: int, arm: int, select: int, device: str, now: float) -> None:
        """Arm and disarm single trigger sources (masks of TriggerFlags)."""
        parachute = self._target(token, device)
        if parachute is not None:
            goal = goals.set_triggers(parachute, TriggerFlags(arm), TriggerFlags(select), now)
            self._begin(token, goal, now)

    def arm(self, token: int, arm: bool, triggers: int, now: float) -> None:
        """Arm or disarm the chosen parachute's triggers (0: the default ones)."""
        select = triggers or int(self.config.default_triggers)
        self.set_triggers(token, select if arm else 0, select, "", now)

    def deploy(self, token: int, force: bool, now: float, device: str = "") -> None:
        """Release the parachute and see that its own status says so."""
        parachute = self._target(token, device)
        if parachute is not None:
            self._begin(token, goals.release(parachute, force), now)

    def parachute_action(self, token: int, action: int, device: str, now: float) -> None:
        """MAV_CMD_DO_PARACHUTE: disable 0, enable 1, release 2 (the same as deploy)."""
        if action == dialect.PARACHUTE_RELEASE:
            self.deploy(token, False, now, device)
        elif self.requests.under_way(goals.RELEASE):
            why = "a release is under way; nothing else may be sent to a parachute"
            self.requests.refuse(token, why)
        else:
            parachute = self._target(token, device)
            if parachute is not None:
                self._begin(token, goals.parachute_action(parachute, action), now)

    def request_message(self, token: int, message_id: int, device: str, now: float) -> None:
        """Ask for one message; it comes as data of the RequestFinished."""
        parachute = self._target(token, device)
        if parachute is not None:
            goal, watch = goals.request_message(parachute, message_id)
            self.requests.begin(token, goal, now, watch)
            self._drive(now)

    def set_message_interval(
        self, token: int, message_id: int, interval_us: int, device: str, now: float
    ) -> None:
        """Set a message's interval and read it back; the MESSAGE_INTERVAL comes as data."""
        parachute = self._target(token, device)
        if parachute is not None:
            goal = goals.set_message_interval(parachute, message_id, interval_us)
            read_back = goals.read_message_interval(parachute, message_id)
            self.requests.begin(token, goal, now, follow_up=read_back)
            self._drive(now)

    def kill(self, token: int, now: float) -> None:
        """Stop the motors through the autopilot."""
        autopilot = self._autopilot()
        if autopilot is None:
            why = "no autopilot of ours was ever heard; set autopilot_system_id"
            self.requests.refuse(token, why)
        else:
            self._begin(token, goals.kill(autopilot, self.config.kill_method, now), now)

    def flight_block(self, reason: str, now: float) -> None:
        """Block flight for reason, or release the block (empty)."""
        if bool(reason) != bool(self._blocked):
            text = f"flight blocked: {reason}" if reason else "flight block released"
            self._announce(text, dialect.MAV_SEVERITY_WARNING, now)
        self._blocked = reason
        self._undo_arming(now)

    def set_autopilot_message_rate(self, rate: float, now: float) -> None:
        """Ask the autopilot for its messages at this rate from now on, Hz; 0: do not ask."""
        self.config = replace(self.config, autopilot_message_rate=rate)
        autopilot = self._autopilot()
        if autopilot is not None:
            self._ask_for_stream(autopilot, now, anew=True)
            self._drive(now)

    # -- what the node may look at -------------------------------------------------------------

    def chosen_parachute(self) -> ParachuteTracker | None:
        """Where requests without a device go: the first parachute that is not lost, or the first."""
        ours = self.parachutes.all()
        alive = [p for p in ours if p.liveness.state is not LinkState.LOST]
        return next(iter(alive or ours), None)

    def vehicle_state(self, now: float) -> VehicleState:
        """The picture of our autopilot's vehicle."""
        autopilot = self._autopilot()
        return VehicleState() if autopilot is None else autopilot.vehicle_state(now)

    def doubts(self) -> list[str]:
        """Why it is doubtful which devices are ours."""
        return [doubt for doubt in (self.parachutes.doubt(), self.autopilots.doubt()) if doubt]

    # -- inside ----------------------------------------------------------------------------------

    def _frame(self, frame: Frame, now: float) -> None:
        message, ids = frame.message, (frame.system_id, frame.component_id)
        if ids == (self.config.system_id, self.config.component_id):
            self.counts["frames with our own system and component id"] += 1
            return
        self.requests.message(*ids, message)
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self._heartbeat(message, ids, now)
        elif kind == "COMMAND_ACK":
            self._acknowledgement(message, ids, now)
        else:
            self._from_parachute(kind, message, ids, now)
            self._from_autopilot(message, ids, now)
        self.requests.effects_may_show(now)

    def _heartbeat(self, message: Any, ids: tuple[int, int], now: float) -> None:
        if message.type == dialect.MAV_TYPE_PARACHUTE:
            if not self.parachutes.admits(*ids):
                return
            parachute = self.parachutes.get(*ids)
            if parachute is None:
                config = self.config
                parachute = ParachuteTracker(*ids, config.parachute_liveness, config.status)
                self.parachutes.add(*ids, parachute)
            self._changed(f"parachute {parachute.device}", parachute.heartbeat(message, now))
            self._events.append(ParachuteChanged(parachute.status(now)))
        elif is_autopilot(message) and self.autopilots.admits(*ids):
            autopilot = self.autopilots.get(*ids)
            if autopilot is None:
                autopilot = AutopilotTracker(*ids, self.config.autopilot_liveness)
                self.autopilots.add(*ids, autopilot)
            changes = autopilot.heartbeat(message, now)
            self._changed(f"autopilot {autopilot.device}", changes)
            self._ask_for_stream(autopilot, now)
            self._undo_arming(now)
            self._events.append(VehicleChanged(autopilot.vehicle_state(now)))

    def _from_parachute(self, kind: str, message: Any, ids: tuple[int, int], now: float) -> None:
        parachute = self.parachutes.get(*ids)
        if parachute is None:
            return
        if kind == "PARACHUTE_STATUS":
            parachute.parachute_status(message, now)
            self._events.append(ParachuteChanged(parachute.status(now)))
        elif kind == "COMPONENT_INFORMATION_BASIC":
            parachute.component_information(message)

    def _from_autopilot(self, message: Any, ids: tuple[int, int], now: float) -> None:
        autopilot = self.autopilots.get(*ids)
        if autopilot is None:
            return
        reboots = autopilot.reboot_count
        changed = autopilot.message(message, now)
        if autopilot.reboot_count > reboots:
            where = "in flight" if autopilot.rebooted_in_flight else "on the ground"
            text = f"autopilot {autopilot.device} restarted {where}"
            self._events.append(Notice(Severity.ERROR, text))
            self._ask_for_stream(autopilot, now)
        if changed:
            self._events.append(VehicleChanged(autopilot.vehicle_state(now)))

    def _acknowledgement(self, message: Any, ids: tuple[int, int], now: float) -> None:
        ours = message.target_system in (0, self.config.system_id)
        if not ours or message.target_component not in (0, self.config.component_id):
            self.counts["acknowledgements for another component"] += 1
            return
        ack = Acknowledgement(*ids, message.command, message.result, message.progress)
        self.requests.commands.acknowledged(ack, now)

    def _changed(self, name: str, changes: list[LinkChange]) -> None:
        self._events += [DeviceLinkChanged(name, change) for change in changes]

    def _target(self, token: int, device: str) -> ParachuteTracker | None:
        """The parachute meant; None, and the request refused, if there is none."""
        target = self.parachutes.named(device) if device else self.chosen_parachute()
        if target is None:
            known = ", ".join(p.device for p in self.parachutes.all()) or "none"
            what = f"no parachute {device!r}" if device else "no parachute"
            self.requests.refuse(token, f"{what} was heard on this link (heard: {known})")
        return target

    def _autopilot(self) -> AutopilotTracker | None:
        return next(iter(self.autopilots.all()), None)

    def _begin(self, token: int, goal: Goal, now: float) -> None:
        self.requests.begin(token, goal, now)
        self._drive(now)

    def _undo_arming(self, now: float) -> None:
        """While flight is blocked, an autopilot that arms on the ground is disarmed again."""
        autopilot = self._autopilot()
        if not self._blocked or autopilot is None or not self.config.disarm_when_blocked:
            return
        if autopilot.armed is not Armed.ARMED or self._disarming in self.requests:
            return
        if autopilot.landed_state is LandedState.ON_GROUND:
            text = f"autopilot armed while flight is blocked ({self._blocked}): disarming"
            self._events.append(Notice(Severity.WARNING, text))
            text = f"disarmed, flight blocked: {self._blocked}"
            self._announce(text, dialect.MAV_SEVERITY_CRITICAL, now)
            # Our own requests count down from -1, so that they never meet a token of the owner's.
            self._disarming, self._next_internal = self._next_internal, self._next_internal - 1
            self._begin(self._disarming, goals.disarm_on_ground(autopilot, now), now)

    def _ask_for_stream(
        self, autopilot: AutopilotTracker, now: float, anew: bool = False
    ) -> None:
        if self.config.autopilot_message_rate <= 0:
            return
        if not anew and not autopilot.wants_stream(now):
            return
        interval_us = 1e6 / self.config.autopilot_message_rate
        for message_id in STREAMED_MESSAGES:
            self.requests.commands.send_once(
                goals.command(
                    autopilot, dialect.MAV_CMD_SET_MESSAGE_INTERVAL, float(message_id), interval_us
                ),
                now,
            )

    def _drive(self, now: float) -> None:
        for send in self.requests.drive(now):
            self._send_command(send.command, send.confirmation, now)

    def _send_command(self, command: Command, confirmation: int, now: float) -> None:
        message = dialect.MAVLink_command_long_message(
            command.system_id, command.component_id, command.number, confirmation, *command.params
        )
        self._send(message, now)

    def _send_heartbeat(self, now: float) -> None:
        message = dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_ONBOARD_CONTROLLER,
            dialect.MAV_AUTOPILOT_INVALID,
            0,
            0,
            dialect.MAV_STATE_ACTIVE,
            3,
        )
        self._send(message, now)

    def _announce(self, text: str, severity: int, now: float) -> None:
        """Tell the ground station (STATUSTEXT carries 50 bytes)."""
        self._send(dialect.MAVLink_statustext_message(severity, text.encode()[:50]), now)

    def _send(self, message: Any, now: float) -> None:
        self._output.append(self._encoder.encode(message, now))
        self.sent_count += 1
