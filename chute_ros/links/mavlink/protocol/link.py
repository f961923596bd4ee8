"""One MAVLink network seen from the companion computer: bytes and time in, bytes and events out.

The owner feeds what the transport receives into receive, calls update when next_deadline is due,
sends what take_output gives, and publishes what take_events gives. It knows no sockets and no ROS.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable
from dataclasses import replace
from typing import Any

from chute_ros.links.mavlink.protocol import goals
from chute_ros.links.mavlink.protocol.announcements import Announcements
from chute_ros.links.mavlink.protocol.autopilot import AutopilotTracker
from chute_ros.links.mavlink.protocol.autopilot_care import AutopilotCare
from chute_ros.links.mavlink.protocol.commands import (
    Acknowledgement,
    CommandTransactions,
    MavCommand,
)
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.devices import Devices
from chute_ros.links.mavlink.protocol.parachute import ParachuteTracker
from chute_ros.links.mavlink.protocol.setup_check import Setup
from chute_ros.links.mavlink.protocol.wire import Duplicates, FrameReceiver, Outbox, Senders
from chute_ros.model import Armed, LinkState, TriggerFlags, VehicleState
from chute_ros.protocol.events import Event
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import Frame
from chute_ros.protocol.mavlink.signing import Signer, Verifier
from chute_ros.protocol.requests import Requests

#: What a parameter of a command can hold; an hour.
_LONGEST_INTERVAL_US = 3.6e9
#: Frames are numbered with 8 bits, and some of 256 are lost.
_NUMBERS_GO_ROUND = 128


class MavlinkLink:
    """Follows our parachutes and our autopilot and carries requests through to them."""

    def __init__(
        self, config: MavlinkConfig, signer: Signer | None = None, verifier: Verifier | None = None
    ) -> None:
        self.config = config
        self._own_ids = (config.system_id, config.component_id)
        self.counts: Counter[str] = Counter()
        self.received_count = 0
        self._devices = Devices(config)
        self.parachutes = self._devices.parachutes
        self.autopilots = self._devices.autopilots
        commands = CommandTransactions(config.commands, config.effect.effect_timeout)
        self.requests = Requests(commands, config.effect)
        self._inbox = FrameReceiver(verifier, self.counts)
        self._outbox = Outbox(config.system_id, config.component_id, signer)
        window = config.commands.late_ack_window
        self._senders = Senders()
        self._acknowledgements = Duplicates(self._senders, window)
        self._heartbeats = Duplicates(self._senders, window, _NUMBERS_GO_ROUND)
        self._announcements = Announcements()
        #: In which flight, counted by armings, a deploy was decided last.
        self._deploy_decided_in = -1
        self._care = AutopilotCare(
            config, self._devices, self.requests, self._outbox, self._announcements
        )
        self._heartbeat_at = -math.inf
        self._heartbeats_until = -math.inf

    # -- wire side ---------------------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        """Bytes came in: a datagram, or (stream given) the next bytes of that stream."""
        self._frames(self._inbox.feed(data, now, stream), now)

    def stream_ended(self, stream: Hashable) -> None:
        """A stream (None: every stream) was closed: what it left unfinished does not continue."""
        self._inbox.stream_ended(stream)

    def update(self, now: float) -> None:
        """Look at the clock: limits, retries, our own heartbeat."""
        self._frames(self._inbox.update(now), now)
        self._devices.update(now)
        self.requests.update(now)
        self._care.update(now)
        self._look_after_parachutes(now)
        if now >= self._heartbeats_until:
            self._heartbeats_until = -math.inf
        elif self._heartbeat_at <= now:
            self._heartbeat_at = now + self.config.heartbeat_interval
            self._outbox.heartbeat(now)
        self._drive(now)

    def next_deadline(self) -> float:
        """When update has something to do; at the latest at our next heartbeat."""
        parts = (self._inbox, self._devices, self.requests, self._care, self._announcements)
        deadlines = [part.next_deadline() for part in parts]
        if self._heartbeat_at < self._heartbeats_until:
            deadlines.append(self._heartbeat_at)
        return min(deadlines)

    def take_output(self) -> list[bytes]:
        """Frames to send, oldest first; each is handed out once."""
        return self._outbox.take()

    def take_events(self) -> list[Event]:
        """New events, oldest first; each is handed out once."""
        ends = self.requests.take_events()
        self._announcements.heard(ends)
        return self._devices.take_events() + ends

    # -- what the node asks for: every request ends in one RequestFinished with its token ------

    def owner_alive(self, until: float) -> None:
        """Our heartbeat may be sent until this time: a hung owner must look dead from outside."""
        self._heartbeats_until = until

    def set_triggers(self, token: int, arm: int, select: int, device: str, now: float) -> None:
        """Arm and disarm single trigger sources (masks of TriggerFlags)."""
        if self._may_set(token, arm, select):
            parachute = self._target(token, device, now)
            if parachute is not None:
                self._set_triggers(token, arm, select, [parachute], now)

    def arm(self, token: int, arm: bool, triggers: int, now: float) -> None:
        """Arm or disarm the triggers (0: the default ones) of every parachute that is not lost,
        or, if all are, of the first."""
        select = triggers or int(self.config.default_triggers)
        mask = select if arm else 0
        if self._may_set(token, mask, select) and self._target(token, "", now) is not None:
            targets, known = self._devices.to_arm(), self.parachutes.all()
            lost = ", ".join(one.device for one in known if one not in targets)
            remark = f"LOST, and nothing was sent to it: {lost}" if lost else ""
            self._set_triggers(token, mask, select, targets, now, remark)

    def announce(self, text: str) -> None:
        """Have the ground station read this."""
        self._announcements.say(text)

    def deploy_decided(self, now: float) -> None:
        """A parachute is released, on whatever link: a kill that is under way, or comes in this
        flight, may go a way that releases as well."""
        self._deploy_decided_in = self._devices.arming_count()
        self.update(now)

    def deploy(self, token: int, force: bool, now: float, device: str = "") -> None:
        """Release the parachute and see that its own status says so."""
        found = self._devices.to_release(device, now)
        # One on the autopilot itself may be known to nobody here; a name that does not exist is a
        # caller's mistake.
        if found or not device:
            self._deploy_decided_in = self._devices.arming_count()
        if found:
            self.requests.make_way_for_release(now)
            self._announcements.ordered(token, f"DEPLOY of {found[0].device}")
            patience = self.config.effect.effect_timeout
            goal = goals.release(found, force, patience, now, self._devices.motors_remark)
            self._begin(token, goal, now)
        else:
            self._target(token, device, now)  # refuses, with the reason

    def parachute_action(self, token: int, action: int, device: str, now: float) -> None:
        """MAV_CMD_DO_PARACHUTE: disable 0, enable 1, release 2 (the same as deploy)."""
        if action == dialect.PARACHUTE_RELEASE:
            self.deploy(token, False, now, device)
        elif action not in goals.ACTION_NAMES:
            why = f"MAV_CMD_DO_PARACHUTE has no action {action}; nothing was sent"
            self.requests.refuse(token, why)
        elif action == dialect.PARACHUTE_ENABLE or not self._release_under_way(token):
            parachute = self._target(token, device, now)
            if parachute is not None:
                self._begin(token, goals.parachute_action(parachute, action), now)

    def request_message(self, token: int, message_id: int, device: str, now: float) -> None:
        """Ask for one message; it comes as data of the RequestFinished."""
        parachute = self._target(token, device, now)
        if parachute is not None:
            goal, watch = goals.request_message(parachute, message_id)
            self._begin(token, goal, now, watch=watch)

    def set_message_interval(
        self, token: int, message_id: int, interval_us: int, device: str, now: float
    ) -> None:
        """Set a message's interval and read it back; the MESSAGE_INTERVAL comes as data."""
        parachute = self._target(token, device, now)
        if parachute is not None:
            goal = goals.set_message_interval(parachute, message_id, interval_us)
            read_back = goals.read_message_interval(parachute, message_id)
            self._begin(token, goal, now, follow_up=read_back)

    def kill(self, token: int, now: float) -> None:
        """Stop the motors through the autopilot."""
        autopilot = self._devices.chosen_autopilot()
        if autopilot is None:
            why = "no autopilot of ours was received yet; set autopilot_system_id"
            self.requests.refuse(token, why)
            return
        goal = goals.kill(
            autopilot,
            lambda: self._care.plan_of(autopilot),
            self._release_allowed,
            self.config.commands.ack_timeout,
            now,
        )
        if goal is None:
            why = f"no way is allowed: {self._care.plan_of(autopilot).text()}"
            self.requests.refuse(token, why)
        else:
            self._announcements.ordered(token, "KILL")
            self._begin(token, goal, now)

    def flight_block(self, reason: str, now: float) -> None:
        """Block flight for reason, or release the block (empty)."""
        self._care.block.set(reason)
        self._announcements.reason(reason)
        self._look_after_autopilot(now)
        self._drive(now)

    def set_autopilot_message_rate(self, rate: float, now: float) -> None:
        """Ask the autopilot for its messages at this rate from now on, Hz; 0: do not ask."""
        self.config = replace(self.config, autopilot_message_rate=rate)
        autopilot = self._devices.chosen_autopilot()
        if autopilot is not None:
            autopilot.ask_anew()
            self._look_after_autopilot(now)
            self._drive(now)

    # -- what the node may look at -------------------------------------------------------------

    @property
    def sent_count(self) -> int:
        """Frames sent since the start."""
        return self._outbox.sent_count

    def has_parachute(self) -> bool:
        """A device that can deploy was received."""
        return self._devices.can_release()

    def chosen_autopilot(self) -> AutopilotTracker | None:
        """The first autopilot of ours that is not lost, or the first."""
        return self._devices.chosen_autopilot()

    def has_autopilot(self) -> bool:
        """A device that can stop the motors was received."""
        return self.chosen_autopilot() is not None

    def chosen_parachute(self, now: float) -> ParachuteTracker | None:
        """Device for requests without a device: the first that is healthy, or is not lost, or the
        first."""
        return self._devices.chosen_parachute(now)

    def setup(self) -> Setup | None:
        """How our autopilot is set up for a kill and a flight block; None: there is none."""
        autopilot = self._devices.chosen_autopilot()
        return None if autopilot is None else self._care.setup_of(autopilot)

    def vehicle_state(self, now: float) -> VehicleState:
        """The picture of our autopilot's vehicle."""
        return self._devices.vehicle_state(now)

    def held_on_ground(self, now: float) -> bool:
        """Flight is blocked and, as far as is known, our vehicle has not left the ground, whether
        it is armed or not."""
        autopilot = self._devices.chosen_autopilot()
        return autopilot is not None and self._care.block.stands(autopilot, now)

    def doubts(self, now: float) -> list[str]:
        """Why it is doubtful which devices are ours."""
        return self._devices.doubts(now)

    def deaf_parachutes(self, now: float) -> list[str]:
        """Which parachutes of ours do not hear us."""
        return self._devices.deaf_parachutes(now)

    # -- inside ----------------------------------------------------------------------------------

    def _frames(self, frames: list[Frame], now: float) -> None:
        for frame in frames:
            self.received_count += 1
            if (frame.system_id, frame.component_id) == self._own_ids:
                self.counts["frames with our own system and component id"] += 1
            else:
                self._frame(frame, now)
        self._look_after_autopilot(now)
        self._look_after_parachutes(now)
        self._drive(now)

    def _frame(self, frame: Frame, now: float) -> None:
        message, ids = frame.message, (frame.system_id, frame.component_id)
        self._senders.heard(frame)
        self.requests.heard(*ids, message)
        if message.get_type() == "COMMAND_ACK":
            self._acknowledgement(frame, now)
        elif self._care.asks_to_arm(message):
            self._care.authorize(ids, now)
        else:
            copy = message.get_type() == "HEARTBEAT" and self._heartbeats.is_copy(frame, now)
            if copy:
                self.counts["duplicate heartbeats"] += 1
            if self._devices.heard(message, ids, now, copy):
                self.requests.commands.restarted(*ids, now)
        self.requests.effects_may_show(now)

    def _acknowledgement(self, frame: Frame, now: float) -> None:
        message = frame.message
        ours = message.target_system in (0, self.config.system_id)
        if not ours or message.target_component not in (0, self.config.component_id):
            self.counts["acknowledgements for another component"] += 1
        elif self._acknowledgements.is_copy(frame, now):
            self.counts["duplicate acknowledgements"] += 1
        else:
            ack = Acknowledgement(
                frame.system_id, frame.component_id, message.command, message.result
            )
            in_progress = self.requests.commands.acknowledged(ack, now)
            for number in in_progress or ():
                self.requests.in_progress(number, "IN_PROGRESS was the last answer")
            if in_progress is not None:
                for answers in self._devices.answers((frame.system_id, frame.component_id)):
                    answers.answered(now)
            self._devices.answered(ack, now)

    def _release_allowed(self) -> bool:
        """In this flight: one begins as the autopilot is armed."""
        return self._deploy_decided_in == self._devices.arming_count()

    def _may_set(self, token: int, arm: int, select: int) -> bool:
        """These triggers may be set; False: the request is refused."""
        if why := goals.impossible_masks(arm, select):
            self.requests.refuse(token, why)
            return False
        return not (select & ~arm and self._release_under_way(token))

    def _set_triggers(
        self,
        token: int,
        arm: int,
        select: int,
        targets: list[ParachuteTracker],
        now: float,
        remark: str = "",
    ) -> None:
        masks = (TriggerFlags(arm), TriggerFlags(select))
        ways = {
            one.device: goals.set_triggers(one, *masks, now, remark if one is targets[-1] else "")
            for one in targets
        }
        self.requests.begin_all(token, ways, now)
        self._drive(now)

    def _release_under_way(self, token: int) -> bool:
        """A release is under way, which nothing may undo: the request is refused."""
        if not self.requests.under_way(goals.RELEASE):
            return False
        why = "a release is under way; nothing may make a parachute less ready"
        self.requests.refuse(token, why)
        return True

    def _target(self, token: int, device: str, now: float) -> ParachuteTracker | None:
        """The parachute meant; None, and the request refused, if there is none."""
        target = self._devices.target(device, now)
        if target is None:
            known = ", ".join(p.device for p in self.parachutes.all()) or "none"
            what = f"no parachute {device!r}" if device else "no parachute"
            self.requests.refuse(token, f"{what} was received on this link (received: {known})")
        return target

    def _begin(self, token: int, goal: goals.MavlinkGoal, now: float, **then: Any) -> None:
        self.requests.begin(token, goal, now, **then)
        self._drive(now)

    def _look_after_autopilot(self, now: float) -> None:
        """Ask for what it does not send; read its settings; keep a flight block."""
        autopilot = self._devices.chosen_autopilot()
        if autopilot is None or autopilot.liveness.state is not LinkState.OK:
            return
        rate = self.config.autopilot_message_rate
        self._care.look(autopilot, rate > 0, now)
        for ask in autopilot.messages_due(1.0 / rate, now) if rate > 0 else ():
            interval_us = min(ask.interval * 1e6, _LONGEST_INTERVAL_US)
            order = goals.set_interval(autopilot, ask.message_id, interval_us)
            self.requests.commands.send_once(order, now)

    def _look_after_parachutes(self, now: float) -> None:
        """Ask for the status that does not come: a ground station may have switched it off. And
        before flight, whether we are heard."""
        autopilot = self._devices.chosen_autopilot()
        flies = autopilot is not None and autopilot.armed is Armed.ARMED
        for parachute in self.parachutes.all():
            due = parachute.status_due(now)
            if due or (not flies and parachute.question_due(now)):
                self.requests.commands.send_once(goals.request_status(parachute), now)

    def _drive(self, now: float) -> None:
        for send in self.requests.drive(now):
            self._send_command(send.command, send.confirmation, now)
        for text in self._announcements.take(now):
            self._outbox.send(text, now)

    def _send_command(self, command: MavCommand, confirmation: int, now: float) -> None:
        message = dialect.MAVLink_command_long_message(
            command.system_id, command.component_id, command.number, confirmation, *command.params
        )
        self._outbox.send(message, now)
        for answers in self._devices.answers((command.system_id, command.component_id)):
            answers.asked(now)
