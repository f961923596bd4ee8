"""Status of the flight computer from its telemetry, normalised.

Source: Umbilical Reference, sections 1 and 3.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from chute_ros.links.umbilical.protocol.canopies import CANOPIES, Canopies
from chute_ros.links.umbilical.protocol.gate import Situation
from chute_ros.links.umbilical.protocol.layouts import Record
from chute_ros.links.umbilical.protocol.modes import GROUND, IN_FLIGHT, FlightMode
from chute_ros.links.umbilical.protocol.rest import FIX_3D, Rest, force
from chute_ros.model import (
    NAN,
    Armed,
    LandedState,
    LinkState,
    ParachuteState,
    ParachuteStatus,
    TriggerFlags,
    VehicleState,
    pressure_altitude,
)
from chute_ros.protocol.boot_clock import Age, BootClock
from chute_ros.protocol.liveness import LinkChange, Liveness, LivenessLimits

#: Who it is on the link; there is one at the end of a cable.
DEVICE = "flight_computer"
#: A clock that falls behind ours by more, from one record to the next, may have started anew, s.
_FALLS_BEHIND = 0.5
#: So many records in a row must say that a canopy is out which nobody fired from here: text
#: without a checksum may be damaged.
_TO_BELIEVE = 2
#: What came out has its time to open before the next is fired, s (`canopy does not carry`).
_OPENS = 3.0
#: What was fired on the ground is not packed and wired anew in less, s.
_PACKED_AFTER = 300.0
_MODES = {int(mode): mode for mode in FlightMode}
_SITUATIONS = {mode: Situation[mode.name] for mode in FlightMode}


class FlightComputerTracker:
    """Follows one flight computer. main_counts: only the main is the parachute, not the drogue."""

    def __init__(self, limits: LivenessLimits, main_counts: bool = False) -> None:
        self.liveness = Liveness(limits)
        self.record: Record | None = None
        self.records = 0
        self.interval = NAN  # s, between the two newest
        self.restarts = 0
        self.restarted_in_flight = False
        self._clock = BootClock()
        self._limits = limits
        #: Those of them that are the parachute.
        self._counting = ("main",) if main_counts else tuple(CANOPIES)
        self._cable_pulled = False
        #: In the air, as far as its records have told.
        self.flying = False
        self._rest = Rest()
        #: Its altitude where it stands before the flight, m: it may count from the sea. NaN: it
        #: was not heard there.
        self._ground = NAN
        #: The altitude of the pressure there, m, which does not count from anywhere else after a
        #: restart; and what heights are above since one, NaN: none since it was heard there.
        self._ground_by_pressure = self._pressure_zero = NAN
        self._was_out = False
        self._canopies = Canopies()
        #: Records in a row that say that the parachute is out.
        self._out_in_a_row = 0
        self._clock_moved_at = NAN
        self._paused = False
        self._was_fresh = False
        #: The newest record said a mode of the ground, whether it was believed or not.
        self._said_ground = False
        #: When what was not known to fly was fired from here, s, by command.
        self._fired_on_ground: dict[str, float] = {}

    # -- what comes ------------------------------------------------------------------------------

    def heard(self, record: Record, now: float) -> tuple[list[LinkChange], Age]:
        """A record came: (what changed of the link, what its clock says)."""
        # A clock of 0 is one that has just started here, not one that is missing.
        age = self._clock.observe(max(1, int(record["ms_since_boot_cfc"])), now)
        if age in (Age.OLD, Age.DOUBTFUL):
            return [], age
        if self._has_restarted(record):
            age = Age.RESTARTED
        said_ground, self._said_ground = self._said_ground, _mode(record) in GROUND
        if age is Age.NEW and self.flying and self._said_ground and not said_ground:
            # Its clock runs on: text without a checksum may be damaged.
            return [], Age.DOUBTFUL
        if age is Age.RESTARTED:
            self.restarts += 1
            self.restarted_in_flight = self.flying
            # Its altitude may count from elsewhere now.
            self._rest.begin_anew()
            if self.record is not None and math.isnan(self._pressure_zero):
                # Where the ground's is not known its height goes on from what it was.
                last = _by_pressure(self.record) - self._height(self.record)
                known = not math.isnan(self._ground_by_pressure)
                self._pressure_zero = self._ground_by_pressure if known else last
            if not self.flying:
                self._ground = NAN
        before, self.record = self.record, record
        self._cable_pulled = False
        if before is not None:
            self.interval = now - before.received
        if before is None or before["ms_since_boot_cfc"] != record["ms_since_boot_cfc"]:
            self._clock_moved_at = now
        self.records += 1
        # The first one tells what happened before it was heard.
        row = self._out_in_a_row + 1 if before is not None else _TO_BELIEVE
        self._out_in_a_row = row if self._says_out(self._counting) else 0
        was_out, self._was_out = self._was_out, self._says_out(CANOPIES)
        came_out = self._was_out and not was_out
        took_off = self.mode in IN_FLIGHT and (before is None or _mode(before) not in IN_FLIGHT)
        self._rest.watch(record, moves=came_out or took_off)
        self._watch_flight()
        self._canopies.watch(before, record, self.mode)
        if self.mode in GROUND and not self.flying:
            self._canopies, self._pressure_zero = Canopies(), NAN
            if self._rest.rests or math.isnan(self._ground):
                self._ground = record.number("altitude")
                self._ground_by_pressure = _by_pressure(record)
        return self.liveness.heard(now), age

    def cable_pulled(self) -> None:
        """What it said before says nothing of what is at the cable's end when it is back."""
        self._cable_pulled = True

    def fired(self, name: str, now: float) -> None:
        """A command that fires the drogue or the main has left."""
        if self.flying:
            self._canopies.fired.add(name)
            self._canopies.since.setdefault(name, now)
        else:
            self._fired_on_ground[name] = now

    def not_fired(self, name: str) -> None:
        """It had not left after all: the port took no more."""
        self._canopies.fired.discard(name)
        self._fired_on_ground.pop(name, None)

    def alive(self, now: float) -> list[LinkChange]:
        """It is heard, though a long work keeps it from sending telemetry."""
        return self.liveness.heard(now) if self.record is not None else []

    def update(self, now: float, paused: bool = False) -> tuple[list[LinkChange], bool]:
        """Look at the clock: (what changed of the link, whether the picture changed).

        paused: a long work with a limit of its own keeps it from sending: its silence says nothing
        of the link.
        """
        self._paused = paused
        changes = [] if paused else self.liveness.update(now)
        was_fresh, self._was_fresh = self._was_fresh, self.fresh(now)
        return changes, bool(changes) or was_fresh != self._was_fresh

    def next_deadline(self) -> float:
        """When the picture changes by itself; infinity: never."""
        stale_at = math.inf
        if self.record is not None and self._was_fresh:
            stale_at = self._clock_moved_at + self._limits.stale_after
        return stale_at if self._paused else min(self.liveness.next_deadline(), stale_at)

    # -- what it is ------------------------------------------------------------------------------

    @property
    def mode(self) -> FlightMode | None:
        """The flight mode of the newest record; None: a number without a name, or no record."""
        return None if self.record is None else _mode(self.record)

    def fresh(self, now: float) -> bool:
        """The newest record is young enough to decide on, and no repetition of an older one."""
        if self._cable_pulled:
            return False
        # Compared as next_deadline says it, so that rounding never leaves a deadline unserved.
        return self.record is not None and now < self._clock_moved_at + self._limits.stale_after

    def situation(self, now: float) -> Situation:
        """The gate's column."""
        mode = self.mode
        if not self.fresh(now):
            # What was in the air a moment ago is so now.
            near = self.liveness.state in (LinkState.OK, LinkState.STALE)
            return Situation.LOST_IN_FLIGHT if self.flying and near else Situation.UNKNOWN
        if self.flying and mode not in IN_FLIGHT:
            return Situation.LOST_IN_FLIGHT
        return Situation.UNKNOWN if mode is None else _SITUATIONS[mode]

    @property
    def landed(self) -> bool:
        """After a deployment its altitude does not change any more, by its records: silence is
        no rest."""
        return self._says_out(CANOPIES) and self._rest.rests

    @property
    def deployed(self) -> bool:
        """The parachute is out: drogue or main, or the main alone. By the newest record, and in
        flight, where nobody fired, the one before it; or by those of before a restart in this
        flight."""
        fired_or_down = self._canopies.fired or not self.flying
        believed = fired_or_down or self._out_in_a_row >= _TO_BELIEVE
        says_so = self._says_out(self._counting) and bool(believed)
        return says_so or any(map(self.forgot, self._counting))

    def _says_out(self, names: Iterable[str]) -> bool:
        """The newest record says that one of them is out."""
        record, mode = self.record, self.mode
        shown_by = [CANOPIES[name] for name in names]
        return record is not None and any(bool(record[f]) or mode is m for f, m in shown_by)

    def came_out(self, name: str) -> bool:
        """The drogue or the main came out in this flight: a flag that was set before it, as by a
        test on the ground, does not count, and a restart does not undo it."""
        return name in self._canopies.came_out

    def surely_out(self, name: str) -> bool:
        """Two records in a row said that it came out in this flight."""
        return name in self._canopies.surely_out

    def seen_out(self, name: str) -> bool:
        """It surely came out in this flight, or was fired from here and one record showed it."""
        canopies = self._canopies
        return self.surely_out(name) or name in canopies.came_out & canopies.fired

    def forgot(self, name: str) -> bool:
        """The drogue or the main surely came out in this flight, and it has restarted since: that
        its records say so no more means nothing."""
        return self.flying and self.restarted_in_flight and self.surely_out(name)

    def was_fired(self, name: str, now: float) -> bool:
        """It surely came out in this flight, or was fired from here, long enough ago to be open:
        not every firmware tells, nor can one that is silent tell that it flies."""
        canopies = self._canopies
        out = self.surely_out(name) or name in canopies.fired
        lately = now - self._fired_on_ground.get(name, -math.inf) < _PACKED_AFTER
        return (out and now - canopies.since[name] >= _OPENS) or lately

    @property
    def armed(self) -> bool:
        """The key is armed, by the mode that it gates; in a fault it is not known."""
        return self.mode is FlightMode.STANDBY or self.mode in IN_FLIGHT

    def status(self, now: float, pause: str) -> ParachuteStatus:
        """The picture at now. pause: why there is no telemetry, empty: there should be some."""
        if self.record is None:
            return ParachuteStatus("", self.liveness.state)
        return ParachuteStatus(
            device=DEVICE,
            link_state=self.liveness.state,
            state=self._state(now, pause),
            armed=self.armed,
            deployed=self.deployed,
            armed_triggers=TriggerFlags.FC if self.armed else TriggerFlags(0),
            height=self._height(self.record),
            uptime=self._clock.uptime,
            faults=tuple(self._faults(now, pause)),
        )

    def vehicle_state(self, now: float) -> VehicleState:
        """The picture of the rocket at now: height, acceleration, position by fix."""
        record = self.record
        if record is None:
            return VehicleState()
        age = now - record.received
        acceleration = force(record)
        has_fix = record.number("fix_type") >= FIX_3D
        speed = -record.number("vel_d") if has_fix else NAN
        height = self._height(record)
        return VehicleState(
            source=DEVICE,
            link_state=self.liveness.state,
            armed=self._motors(),
            armed_age=age,
            landed_state=self._landed_state(),
            landed_state_age=age,
            height=height,
            height_age=_age(age, height),
            vertical_speed=speed,
            vertical_speed_age=_age(age, speed),
            acceleration=acceleration,
            acceleration_age=_age(age, acceleration),
            latitude=record.number("latitude") if has_fix else NAN,
            longitude=record.number("longitude") if has_fix else NAN,
            position_age=_age(age, record.number("latitude")) if has_fix else NAN,
            uptime=self._clock.uptime,
            reboot_count=self.restarts,
            rebooted_in_flight=self.restarted_in_flight,
            height_holds=self.restarted_in_flight and not math.isnan(self._pressure_zero),
        )

    # -- inside ----------------------------------------------------------------------------------

    def _height(self, record: Record) -> float:
        """Above where it took off, m; of one that was first heard in flight its altitude. NaN: not
        known."""
        if self._rest.barometer_is_lost:
            return NAN
        if not math.isnan(self._pressure_zero):
            return _by_pressure(record) - self._pressure_zero
        return record.number("altitude") - (0.0 if math.isnan(self._ground) else self._ground)

    def _has_restarted(self, record: Record) -> bool:
        """In flight, when its clock does not show it: as it runs for longer than before by now.

        Only a restart leads from a mode of the flight, or a fault in it, to one of the ground
        with a clock that falls behind.
        """
        before, mode = self.record, _mode(record)
        if before is None or not self.flying or mode not in GROUND or _mode(before) in GROUND:
            return False
        ran = (int(record["ms_since_boot_cfc"]) - int(before["ms_since_boot_cfc"])) / 1000.0
        return record.received - before.received - ran > _FALLS_BEHIND

    def _watch_flight(self) -> None:
        """Whether it flies: a ground mode after a restart in the air, and a mode without a name or
        a fault, say nothing of it until its altitude stays. A mode of the flight says so until it
        is seen to stand: the motor did not burn, or it came down without a canopy."""
        if self.mode in IN_FLIGHT:
            flies = not self.landed and not self._rest.stands
            if flies and not self.flying:
                self.restarted_in_flight = False  # what happened in another flight
            self.flying = flies
        elif self._rest.rests or (self.mode in GROUND and not self.restarted_in_flight):
            self.flying = False

    def _motors(self) -> Armed:
        """Whether the motor may burn: the key is armed on the ground, or the MAV is open."""
        assert self.record is not None
        if self.mode is None:
            return Armed.UNKNOWN
        if self.mode is FlightMode.FAULT and not self.record["mav_open"]:
            return Armed.UNKNOWN
        may_burn = self.mode is FlightMode.STANDBY or bool(self.record["mav_open"])
        return Armed.ARMED if may_burn else Armed.DISARMED

    def _landed_state(self) -> LandedState:
        if self.flying:
            return LandedState.IN_AIR
        if self.mode in GROUND or self.landed or self._rest.stands:
            return LandedState.ON_GROUND
        return LandedState.UNKNOWN

    def _faults(self, now: float, pause: str) -> list[str]:
        assert self.record is not None
        faults, age = [], now - self.record.received
        if pause:
            faults.append(f"no telemetry: {pause}")
        elif self._cable_pulled:
            faults.append(
                f"the cable was pulled, or the port closed: no telemetry for {age:.1f} s"
            )
        elif not self.fresh(now):
            faults.append(f"telemetry {self.liveness.state.name}: {age:.1f} s old")
        if self.mode is FlightMode.FAULT:
            faults.append("flight mode Fault")
        elif self.mode is None:
            faults.append(f"flight mode {self.record['flight_mode']} has no name")
        elif self.mode in IN_FLIGHT and not self.flying and not self.landed:
            faults.append(
                f"flight mode {self.mode.name.capitalize()} while it stands: it did not fly, or "
                "came down without a canopy; stay away, its charges may be live"
            )
        for name in ("altitude", "pressure"):
            if not math.isfinite(self.record.number(name)):
                faults.append(f"{name} is {self.record.number(name)}")
        if self.record.received - self._clock_moved_at > self._limits.stale_after:
            faults.append("its clock stands still")
        if self.restarted_in_flight and self.flying:
            faults.append("it restarted in flight")
        return faults

    def _state(self, now: float, pause: str) -> ParachuteState:
        """Onto the UPF numbering. A canopy that is out wins over all; a fault wins over the rest.
        Under a drogue that is not the parachute it is LAUNCHED, and not deployed."""
        if self.deployed or self.landed:
            return ParachuteState.TOUCHDOWN if self.landed else ParachuteState.LAUNCHED
        if self.flying and self.seen_out("drogue"):
            return ParachuteState.LAUNCHED  # and the main, which is the parachute, is not out yet
        if pause and self.liveness.state is LinkState.OK:
            return ParachuteState.NOT_READY
        if self._faults(now, pause):
            return ParachuteState.ABNORMAL
        return ParachuteState.ARMED if self.armed else ParachuteState.READY


def _mode(record: Record) -> FlightMode | None:
    return _MODES.get(int(record["flight_mode"]))


def _by_pressure(record: Record) -> float:
    return pressure_altitude(record.number("pressure"))


def _age(age: float, value: float) -> float:
    """The age of a value; NaN: there is none."""
    return age if math.isfinite(value) else NAN
