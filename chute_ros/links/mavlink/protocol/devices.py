"""Our parachutes and our autopilot on one MAVLink network: who they are and what they say.

It only listens. What is sent to them, and when, is the business of MavlinkLink.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Generic, TypeVar

from chute_ros.links.mavlink.protocol import results
from chute_ros.links.mavlink.protocol.answers import Answers
from chute_ros.links.mavlink.protocol.autopilot import AutopilotTracker, is_autopilot
from chute_ros.links.mavlink.protocol.commands import Acknowledgement
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.kill import kill_plan
from chute_ros.links.mavlink.protocol.parachute import ParachuteTracker
from chute_ros.model import Armed, LinkState, VehicleState
from chute_ros.protocol.events import EventLog, ParachuteChanged, Severity, VehicleChanged
from chute_ros.protocol.liveness import first_alive, has_room
from chute_ros.protocol.mavlink.dialect import dialect

DeviceT = TypeVar("DeviceT", ParachuteTracker, AutopilotTracker)
Ids = tuple[int, int]

#: More devices of one kind than this are not followed: a flood of made-up ids must not grow us.
MOST_DEVICES = 16


class DeviceFilter(Generic[DeviceT]):
    """Which devices of one kind are ours, by (system id, component id). An id of 0 means any.

    More than one vehicle may be heard. A command that fires goes only to a system that was named
    by a parameter, or, where none was, to the first one heard; a second system then makes the
    choice doubtful, which is said and forbids take-off until the parameter is set.
    """

    def __init__(self, kind: str, system_id: int, component_id: int) -> None:
        self.kind, self.system_id, self.component_id = kind, system_id, component_id
        self.refused_count = 0
        #: The system was named by a parameter, not taken as the first one heard.
        self.fixed = system_id != 0
        self._ours: dict[Ids, DeviceT] = {}
        self._other_systems: set[int] = set()

    def fits(self, system_id: int, component_id: int) -> bool:
        """May a device with these ids be ours, as far as is known?"""
        return self._possible(system_id, component_id) and self.system_id in (0, system_id)

    def admits(self, system_id: int, component_id: int) -> bool:
        """Is a device with these ids ours? If no system was named, the first one heard is."""
        if not self._possible(system_id, component_id):
            return False
        if self.system_id == 0:
            self.system_id = system_id
        if self.system_id != system_id:
            if len(self._other_systems) < MOST_DEVICES:
                self._other_systems.add(system_id)
            return False
        followed = (system_id, component_id) in self._ours or has_room(self._ours, MOST_DEVICES)
        self.refused_count += not followed
        return followed

    def _possible(self, system_id: int, component_id: int) -> bool:
        # A command to system 0 would go to every vehicle.
        return system_id != 0 and self.component_id in (0, component_id)

    def get(self, system_id: int, component_id: int) -> DeviceT | None:
        """The device with these ids, if it is ours and was heard."""
        return self._ours.get((system_id, component_id))

    def add(self, system_id: int, component_id: int, device: DeviceT) -> None:
        """A device that admits let in was received for the first time."""
        self._ours[system_id, component_id] = device

    def all(self) -> list[DeviceT]:
        """Our devices in the order in which they were first heard."""
        return list(self._ours.values())

    def named(self, device: str) -> DeviceT | None:
        """Our device with this name ("1/161")."""
        return next((ours for ours in self._ours.values() if ours.device == device), None)

    def doubt(self) -> str:
        """Why the choice is doubtful; empty: it is not."""
        if self.fixed or not self._other_systems:
            return ""
        systems = sorted({self.system_id, *self._other_systems})
        return (
            f"{self.kind}s of systems {', '.join(map(str, systems))} received, using "
            f"{self.system_id}: set {self.kind}_system_id"
        )


class Devices(EventLog):
    """Follows the devices that are ours, each known by its heartbeat's type and its ids."""

    def __init__(self, config: MavlinkConfig) -> None:
        super().__init__()
        self.parachutes: DeviceFilter[ParachuteTracker] = DeviceFilter(
            "parachute", config.parachute_system_id, config.parachute_component_id
        )
        self.autopilots: DeviceFilter[AutopilotTracker] = DeviceFilter(
            "autopilot", config.autopilot_system_id, config.autopilot_component_id
        )
        #: By their PARACHUTE_STATUS, and not yet by a heartbeat.
        self._unproven: dict[Ids, ParachuteTracker] = {}
        #: By the type in their heartbeat they are something else.
        self._others: set[Ids] = set()
        self._config = config

    # -- who -------------------------------------------------------------------------------------

    def chosen_parachute(self, now: float) -> ParachuteTracker | None:
        """Device for requests without a device: the first that is healthy, or is not lost, or the
        first."""
        return next(iter(self._in_order(now)), None)

    def target(self, device: str, now: float) -> ParachuteTracker | None:
        """The parachute with this name; empty: the chosen one."""
        return self.parachutes.named(device) if device else self.chosen_parachute(now)

    def to_release(self, device: str, now: float) -> list[ParachuteTracker]:
        """Where a release goes, and where to if that one does not do it; device: its name, or
        empty. As long as no heartbeat of a parachute was heard, to the one that says what only a
        parachute does, if all that do are of one system: heartbeats come once a second, and after
        a restart of ours the ground may come before the next that is whole."""
        if self.parachutes.all():
            return [one for one in self._in_order(now) if device in ("", one.device)]
        if not self.can_release():
            return []
        return [one for one in self._unproven.values() if device in ("", one.device)][:1]

    def can_release(self) -> bool:
        """A parachute that a release would go to was received."""
        return bool(self.parachutes.all()) or len({system for system, _ in self._unproven}) == 1

    def _in_order(self, now: float) -> list[ParachuteTracker]:
        """Our parachutes as they are turned to: healthy ones, others that are heard, lost ones;
        among equals whichever was heard first."""

        def rank(one: ParachuteTracker) -> tuple[bool, bool]:
            return one.liveness.state is LinkState.LOST, not one.status(now).healthy

        return sorted(self.parachutes.all(), key=rank)

    def chosen_autopilot(self) -> AutopilotTracker | None:
        """The first autopilot of ours that is not lost, or the first."""
        return first_alive(self.autopilots.all())

    def arming_count(self) -> int:
        """How often an autopilot of ours was seen to arm."""
        return sum(autopilot.arming_count for autopilot in self.autopilots.all())

    def to_arm(self) -> list[ParachuteTracker]:
        """Where an arming without a device goes: all that are not lost, or else the first."""
        known = self.parachutes.all()
        alive = [one for one in known if one.liveness.state is not LinkState.LOST]
        return alive or known[:1]

    def answered(self, ack: Acknowledgement, now: float) -> None:
        """A device answered a command of ours."""
        ids = (ack.system_id, ack.component_id)
        autopilot = self.autopilots.get(*ids)
        if autopilot is not None and ack.result == results.ACCEPTED:
            autopilot.motor_signs.accepted(ack.number, now)
        parachute = self.parachutes.get(*ids) or self._unproven.get(ids)
        if parachute is not None and ack.number == dialect.MAV_CMD_SET_PARACHUTE_ARM:
            parachute.arming_answered(ack.result, now)

    def answers(self, ids: Ids) -> list[Answers]:
        """Of those with these ids, what tells whether they hear us."""
        found = (self.parachutes.get(*ids), self.autopilots.get(*ids))
        return [device.answers for device in found if device is not None]

    def deaf_parachutes(self, now: float) -> list[str]:
        """Which parachutes of ours do not hear us."""
        return [text for one in self.parachutes.all() if (text := one.deaf(now))]

    def motors_remark(self) -> str:
        """What whoever releases a parachute must know of the motors; empty: nothing."""
        autopilot = self.chosen_autopilot()
        if autopilot is None or autopilot.liveness.state is not LinkState.OK:
            return ""
        if autopilot.armed is not Armed.ARMED or autopilot.motors_off:
            return ""
        return f"WARNING: autopilot {autopilot.device} reports armed: the motors may turn"

    def doubts(self, now: float) -> list[str]:
        """Why it is doubtful which devices are ours."""
        parachutes, autopilots = self.parachutes, self.autopilots
        doubts = [parachutes.doubt(), autopilots.doubt()]
        doubts += [parachute.doubt(now) for parachute in parachutes.all()]
        doubts += [autopilot.doubt(now) for autopilot in autopilots.all()]
        alive = [a.device for a in autopilots.all() if a.liveness.state is LinkState.OK]
        if len(alive) > 1:
            doubts.append(
                f"autopilots {', '.join(alive)} are all received: a kill goes to one alone, and "
                "another's motors may turn: set autopilot_component_id, or have the others say "
                "that they are none"
            )
        unset = [f"{one.kind}_system_id" for one in (parachutes, autopilots) if not one.fixed]
        both = parachutes.all() and autopilots.all()
        if both and unset and parachutes.system_id != autopilots.system_id:
            doubts.append(
                f"the parachute is of system {parachutes.system_id}, the autopilot of "
                f"system {autopilots.system_id}: set {' and '.join(unset)}"
            )
        return [doubt for doubt in doubts if doubt]

    # -- what they say ---------------------------------------------------------------------------

    def heard(self, message: Any, ids: Ids, now: float, copy: bool = False) -> bool:
        """A message of anybody on the network; whether it shows that a device of ours restarted.
        copy: of a heartbeat that came before."""
        if message.get_type() != "HEARTBEAT":
            restarted = self._from_parachute(message, ids, now)
            return self._from_autopilot(message, ids, now) or restarted
        if message.type == dialect.MAV_TYPE_PARACHUTE:
            self._parachute_heartbeat(message, ids, now)
        else:
            self._unproven.pop(ids, None)
            if len(self._others) < MOST_DEVICES:
                self._others.add(ids)
            if is_autopilot(message):
                self._autopilot_heartbeat(message, ids, now, copy)
        return False

    def update(self, now: float) -> None:
        """Look at the clock."""
        for parachute in self.parachutes.all():
            changes, picture_changed = parachute.update(now)
            self.link_changed(f"parachute {parachute.device}", changes)
            if picture_changed:
                self._events.append(ParachuteChanged(parachute.status(now), parachute.received))
        for autopilot in self.autopilots.all():
            changes = autopilot.liveness.update(now)
            self.link_changed(f"autopilot {autopilot.device}", changes)
            if changes:
                self._vehicle_changed(now)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        deadlines = [p.next_deadline() for p in self.parachutes.all()]
        deadlines += [a.liveness.next_deadline() for a in self.autopilots.all()]
        return min(deadlines, default=math.inf)

    def vehicle_state(self, now: float) -> VehicleState:
        """The picture of our autopilot's vehicle."""
        autopilot = self.chosen_autopilot()
        if autopilot is None:
            return VehicleState()
        state, settings = autopilot.vehicle_state(now), autopilot.settings
        fault = kill_plan(self._config.kill_method, autopilot.vehicle_type, settings).fault()
        return replace(state, faults=(*state.faults, fault)) if fault else state

    def _parachute_heartbeat(self, message: Any, ids: Ids, now: float) -> None:
        if not self.parachutes.admits(*ids):
            return
        parachute = self.parachutes.get(*ids)
        if parachute is None:
            parachute = self._unproven.pop(ids, None) or self._tracker(ids)
            self.parachutes.add(*ids, parachute)
        self.link_changed(f"parachute {parachute.device}", parachute.heartbeat(message, now))
        self._events.append(ParachuteChanged(parachute.status(now), parachute.received))

    def _tracker(self, ids: Ids) -> ParachuteTracker:
        return ParachuteTracker(*ids, self._config.parachute_liveness, self._config.status)

    def _autopilot_heartbeat(self, message: Any, ids: Ids, now: float, copy: bool) -> None:
        if not self.autopilots.admits(*ids):
            return
        autopilot = self.autopilots.get(*ids)
        if autopilot is None:
            limits, needed = self._config.autopilot_liveness, self._config.needed_message_rate
            autopilot = AutopilotTracker(*ids, limits, needed)
            self.autopilots.add(*ids, autopilot)
        self.link_changed(f"autopilot {autopilot.device}", autopilot.heartbeat(message, now, copy))
        self._vehicle_changed(now)

    def _from_parachute(self, message: Any, ids: Ids, now: float) -> bool:
        parachute, kind = self.parachutes.get(*ids), message.get_type()
        if parachute is None:
            if kind == "PARACHUTE_STATUS":
                self._unproven_status(message, ids, now)
            return False
        reboots = parachute.reboot_count
        if kind == "PARACHUTE_STATUS":
            parachute.parachute_status(message, now)
            if parachute.reboot_count > reboots:
                self.notice(Severity.ERROR, f"parachute {parachute.device} restarted")
            self._events.append(ParachuteChanged(parachute.status(now), parachute.received))
        elif kind == "COMPONENT_INFORMATION_BASIC":
            parachute.component_information(message)
        return parachute.reboot_count > reboots

    def _unproven_status(self, message: Any, ids: Ids, now: float) -> None:
        if ids in self._others or not self.parachutes.fits(*ids):
            return
        if ids not in self._unproven and len(self._unproven) < MOST_DEVICES:
            self._unproven[ids] = self._tracker(ids)
        if ids in self._unproven:
            self._unproven[ids].parachute_status(message, now)

    def _from_autopilot(self, message: Any, ids: Ids, now: float) -> bool:
        autopilot = self.autopilots.get(*ids)
        if autopilot is None:
            return False
        reboots = autopilot.reboot_count
        changed = autopilot.message(message, now)
        if autopilot.reboot_count > reboots:
            where = "in flight" if autopilot.rebooted_in_flight else "on the ground"
            self.notice(Severity.ERROR, f"autopilot {autopilot.device} restarted {where}")
        if changed:
            self._vehicle_changed(now)
        return autopilot.reboot_count > reboots

    def _vehicle_changed(self, now: float) -> None:
        self._events.append(VehicleChanged(self.vehicle_state(now), now))
