"""Care for our autopilot without a request: messages asked for, arming undone.

Its settings are read and told, how long it takes to answer is measured, its heartbeats are had
sooner, its arming is undone while flight is blocked, and its question whether it may arm is
answered.

HEARTBEAT, which says armed, is asked for more often than once a second (SET_MESSAGE_INTERVAL), but
of PX4, which by its source ignores that. While flight is blocked a heartbeat that is old is asked
for one by one: an arming that is seen a second later has taken off.

PX4 with COM_ARM_AUTH_REQ 1 asks the system COM_ARM_AUTH_ID whether it may arm
(MAV_CMD_ARM_AUTHORIZATION_REQUEST), and arms only if COMMAND_ACK says ACCEPTED, for result_param2
seconds (COM_ARM_AUTH_MET 0: the arming that asked; 1: the next one). Sources: MAVLink common.xml;
PX4 ArmAuthorization.cpp.
"""

from __future__ import annotations

import math
from typing import Any

from chute_ros.links.mavlink.protocol import goals
from chute_ros.links.mavlink.protocol.announcements import Announcements
from chute_ros.links.mavlink.protocol.autopilot import AutopilotTracker
from chute_ros.links.mavlink.protocol.commands import CommandTransactions, MavCommand
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.devices import Devices
from chute_ros.links.mavlink.protocol.firmware import Firmware
from chute_ros.links.mavlink.protocol.flight_block import FlightBlock
from chute_ros.links.mavlink.protocol.kill import KillPlan, kill_plan
from chute_ros.links.mavlink.protocol.setup_check import Setup, SetupNews, setup_of
from chute_ros.links.mavlink.protocol.wire import Outbox
from chute_ros.model import Armed
from chute_ros.protocol.events import Severity
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.requests import Requests

#: How often it is looked whether there is something new to say of its set-up, s.
_SETUP_EVERY = 0.5
#: An answer whether it may arm is sent again after this, s: PX4 drops one that bears the time of
#: its question, which in its simulator, whose clock goes in steps, is every quick one.
_ANSWER_AGAIN = 0.05
_NO_ANSWER = (math.inf, (0, 0))
#: An authorization holds for so long, s: short where the arming that asks is the one that arms.
_AT_ONCE, _TWO_STEPS = 1, 5
#: Wanted between two heartbeats, s.
HEARTBEAT_INTERVAL = 0.2
#: Older than this it is asked for while flight is blocked, and not more often, s.
_OLD = 0.3
#: The interval is asked for again after so long, s, so often at most for each autopilot.
_ASK_AGAIN, _MOST_ASKED = 2.0, 3
#: What its settings mean is said to the ground station so.
_FOR_THE_PILOT: dict[Severity, int] = {
    Severity.INFO: dialect.MAV_SEVERITY_INFO,
    Severity.WARNING: dialect.MAV_SEVERITY_WARNING,
    Severity.ERROR: dialect.MAV_SEVERITY_CRITICAL,
}


class AutopilotCare:
    """Looks after the autopilot that the link has chosen."""

    def __init__(
        self,
        config: MavlinkConfig,
        devices: Devices,
        requests: Requests[CommandTransactions],
        outbox: Outbox,
        announcements: Announcements,
    ) -> None:
        self.block = FlightBlock(config.takeoff_height)
        self._config, self._devices = config, devices
        self._requests, self._outbox, self._announcements = requests, outbox, announcements
        self._heartbeats = _HeartbeatWatch()
        self._news = SetupNews()
        self._told_at = self._now = -math.inf
        #: The request that disarms. Ours count down from -1: they never meet one of the owner's.
        self._disarming = 0
        #: When to answer once more whether an autopilot may arm, and which.
        self._answer_again = _NO_ANSWER

    def plan_of(self, autopilot: AutopilotTracker) -> KillPlan:
        """Which ways to stop its motors are tried, and in which order."""
        return kill_plan(self._config.kill_method, autopilot.vehicle_type, autopilot.settings)

    def setup_of(self, autopilot: AutopilotTracker) -> Setup:
        """How it is set up for a kill and a flight block."""
        return setup_of(autopilot, self.plan_of(autopilot), self._config.system_id)

    def look(self, autopilot: AutopilotTracker, faster: bool, now: float) -> None:
        """It may have said something. faster: it may be asked for other intervals."""
        self._now = now
        self.block.observe(autopilot, now)
        self._settings(autopilot, now)
        if (question := autopilot.round_trip.question(now)) is not None:
            self._outbox.send(question, now)
            autopilot.answers.asked(now)
        if autopilot.known_to_answer and autopilot.answers.due(autopilot.liveness.since, now):
            self._requests.commands.send_once(goals.request_heartbeat(autopilot), now)
        if autopilot.armed is not Armed.ARMED or self.block.stands(autopilot, now):
            self._announcements.reason_stands(autopilot.liveness.since, now)
        undone = bool(self.block.reason) and self._config.disarm_when_blocked
        for ask in self._heartbeats.due(autopilot, faster, undone, now):
            self._requests.commands.send_once(ask, now)
        if self._disarming in self._requests:
            self._still_wanted(autopilot, now)
        elif self._config.disarm_when_blocked and self.block.disarm_due(autopilot, now):
            self._disarm(autopilot, now)

    def asks_to_arm(self, message: Any) -> bool:
        """It is a command to us that asks whether the autopilot may arm."""
        if message.get_type() != "COMMAND_LONG":
            return False
        config = self._config
        for_us = message.target_component in (0, config.component_id)
        for_us = for_us and message.target_system == config.system_id
        return bool(for_us and message.command == dialect.MAV_CMD_ARM_AUTHORIZATION_REQUEST)

    def authorize(self, asking: tuple[int, int], now: float) -> None:
        """The autopilot with these ids asks whether it may arm."""
        if self._devices.autopilots.get(*asking) is None:
            return
        self._answer(asking, now)
        self._answer_again = (now + _ANSWER_AGAIN, asking)
        if reason := self.block.reason:
            self._devices.notice(Severity.WARNING, f"arming denied, flight blocked: {reason}")
            self._announcements.say(f"{reason}: flight blocked, arming denied")

    def update(self, now: float) -> None:
        """Look at the clock."""
        at, asking = self._answer_again
        if now >= at:
            self._answer_again = _NO_ANSWER
            self._answer(asking, now)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        return self._answer_again[0]

    def _answer(self, asking: tuple[int, int], now: float) -> None:
        autopilot = self._devices.autopilots.get(*asking)
        assert autopilot is not None
        result, reason, seconds = dialect.MAV_RESULT_ACCEPTED, 0, _TWO_STEPS
        if autopilot.settings.get("COM_ARM_AUTH_MET") == 0:
            seconds = _AT_ONCE
        if self.block.reason:
            result, seconds = dialect.MAV_RESULT_DENIED, 0
            reason = dialect.MAV_ARM_AUTH_DENIED_REASON_GENERIC
        answer = dialect.MAVLink_command_ack_message(
            dialect.MAV_CMD_ARM_AUTHORIZATION_REQUEST, result, reason, seconds, *asking
        )
        self._outbox.send(answer, now)

    def _settings(self, autopilot: AutopilotTracker, now: float) -> None:
        settings = autopilot.settings
        if settings.complete and now >= self._told_at + _SETUP_EVERY:
            self._told_at = now
            for severity, text in self._news.news(autopilot.device, self.setup_of(autopilot)):
                self._devices.notice(severity, text)
                self._announcements.say(text, _FOR_THE_PILOT[severity])
        if name := settings.due(now):
            ids, encoded = (autopilot.system_id, autopilot.component_id), name.encode()
            self._outbox.send(dialect.MAVLink_param_request_read_message(*ids, encoded, -1), now)
            autopilot.answers.asked(now)

    def _still_wanted(self, autopilot: AutopilotTracker, now: float) -> None:
        if not self.block.stands(autopilot, now):
            why = "flight is no longer blocked, or the vehicle is not known to be on the ground"
        elif self._requests.under_way(goals.FORCED) and not self.block.may_force(now):
            why = "it is no longer known that the vehicle has not left the ground"
        else:
            return
        self._requests.abandon(self._disarming, why, now)

    def _disarm(self, autopilot: AutopilotTracker, now: float) -> None:
        reason = self.block.reason
        if self.block.worth_telling():
            text = f"autopilot armed while flight is blocked ({reason}): disarming"
            self._devices.notice(Severity.WARNING, text)
            self._announcements.say(f"{reason}: flight blocked, disarming")
        self._disarming -= 1
        patience = self._config.commands.ack_timeout
        goal = goals.disarm_on_ground(
            autopilot, lambda: self.block.may_force(self._now), patience, now
        )
        self._requests.begin(self._disarming, goal, now)


class _HeartbeatWatch:
    """What to ask an autopilot for, to have its heartbeats sooner."""

    def __init__(self) -> None:
        self._asked = self._polled = -math.inf
        #: Which start of which autopilot.
        self._asked_of = ("", 0)
        self._times_asked = 0

    def due(
        self, autopilot: AutopilotTracker, rate_too: bool, blocked: bool, now: float
    ) -> list[MavCommand]:
        """Commands to send once now. rate_too: other intervals may be asked for."""
        this_start = (autopilot.device, autopilot.reboot_count)
        if this_start != self._asked_of:
            self._asked_of, self._times_asked, self._asked = this_start, 0, -math.inf
        due: list[MavCommand] = []
        if autopilot.liveness.age(now) <= _OLD:
            return due
        obeys = autopilot.settings.firmware is not Firmware.PX4
        again = self._times_asked < _MOST_ASKED and now >= self._asked + _ASK_AGAIN
        if rate_too and obeys and again:
            self._asked, self._times_asked = now, self._times_asked + 1
            message_id = dialect.MAVLINK_MSG_ID_HEARTBEAT
            due.append(goals.set_interval(autopilot, message_id, HEARTBEAT_INTERVAL * 1e6))
        if blocked and now >= self._polled + _OLD:
            self._polled = now
            due.append(goals.request_heartbeat(autopilot))
        return due
