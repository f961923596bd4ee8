"""Flies an autopilot from a ground station: modes, arming, take-off, sticks, missions."""

from __future__ import annotations

import math
import struct
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from sitl.autopilots import ARDUCOPTER, ARDUPLANE, PX4
from sitl.simulators import ALTITUDE, LATITUDE, LONGITUDE
from sitl.station import Station

FORCE = 21196.0
_CUSTOM = 1  # MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_INT32, _REAL32 = 6, 9
_VELOCITY_ONLY = 0b0000_1101_1100_0111
_LOCAL_NED = 1
_GLOBAL_RELATIVE = 6
#: Modes by name; of PX4 the main and the sub mode.
MODES: dict[str, dict[str, Any]] = {
    ARDUCOPTER: {
        "STABILIZE": 0, "ACRO": 1, "ALT_HOLD": 2, "AUTO": 3, "GUIDED": 4, "LOITER": 5, "RTL": 6,
        "CIRCLE": 7, "LAND": 9, "DRIFT": 11, "SPORT": 13, "FLIP": 14, "POSHOLD": 16, "BRAKE": 17,
        "SMART_RTL": 21,
    },
    ARDUPLANE: {
        "MANUAL": 0, "CIRCLE": 1, "STABILIZE": 2, "ACRO": 4, "FBWA": 5, "FBWB": 6, "CRUISE": 7,
        "AUTO": 10, "RTL": 11, "LOITER": 12, "TAKEOFF": 13, "GUIDED": 15, "QSTABILIZE": 17,
        "QHOVER": 18, "QLOITER": 19, "QLAND": 20, "QRTL": 21, "QACRO": 23,
    },
    PX4: {
        "ALTCTL": (2, 0), "POSCTL": (3, 0), "TAKEOFF": (4, 2), "HOLD": (4, 3), "MISSION": (4, 4),
        "RTL": (4, 5), "LAND": (4, 6), "ACRO": (5, 0), "OFFBOARD": (6, 0), "STABILIZED": (7, 0),
    },
}  # fmt: skip


class Pilot:
    """kind: of the autopilot. station: the ground station; bench: where faults are set."""

    def __init__(self, kind: str, station: Station, bench: Station) -> None:
        self.kind, self.station, self.bench = kind, station, bench
        self._sticks = (0.0, 0.0, 0.0, 0.0)
        self._mission: list[Any] = []
        self._velocity = (0.0, 0.0, 0.0)

    # -- orders ---------------------------------------------------------------------------------

    def mode(self, name: str) -> float:
        """Change the mode."""
        number = MODES[self.kind][name]
        main, sub = number if isinstance(number, tuple) else (number, 0)
        return self.station.command(dialect.MAV_CMD_DO_SET_MODE, _CUSTOM, main, sub)

    def in_mode(self, name: str) -> bool:
        """The newest heartbeat says so."""
        number = MODES[self.kind][name]
        told = int(self.station.get("HEARTBEAT", "custom_mode", -1))
        if isinstance(number, tuple):
            return (told >> 16 & 0xFF, told >> 24 & 0xFF) == number
        return bool(told == number)

    def arm(self, force: bool = False) -> float:
        """Arm the motors."""
        number = dialect.MAV_CMD_COMPONENT_ARM_DISARM
        return self.station.command(number, 1.0, FORCE if force else 0.0)

    def disarm(self, force: bool = False) -> float:
        """Disarm them."""
        number = dialect.MAV_CMD_COMPONENT_ARM_DISARM
        return self.station.command(number, 0.0, FORCE if force else 0.0)

    def terminate(self) -> float:
        """MAV_CMD_DO_FLIGHTTERMINATION."""
        return self.station.command(dialect.MAV_CMD_DO_FLIGHTTERMINATION, 1.0)

    def take_off(self, height: float) -> float:
        """The command, m above where it stands."""
        if self.kind == PX4:
            none = math.nan
            up = ALTITUDE + height
            where = (0.0, 0.0, 0.0, none, none, none, up)
            return self.station.command(dialect.MAV_CMD_NAV_TAKEOFF, *where)
        return self.station.command(dialect.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height)

    def ready_to_climb(self) -> str:
        """The mode that a climb begins in."""
        return "TAKEOFF" if self.kind == PX4 else "GUIDED"

    # -- faults ---------------------------------------------------------------------------------

    def set(self, name: str, value: float) -> float:
        """A parameter, over the bench's line."""
        if self.kind == PX4 and isinstance(value, int):
            # PX4 has whole numbers byte by byte in the field.
            raw = struct.unpack("<f", struct.pack("<i", value))[0]
            return self.bench.set_parameter(name, raw, _INT32)
        return self.bench.set_parameter(name, float(value), _REAL32)

    def fail_motors(self, mask: int) -> float:
        """Motors of this mask (bit 0: the first) of a PX4 are dead from now on."""
        unit, off = dialect.FAILURE_UNIT_SYSTEM_MOTOR, dialect.FAILURE_TYPE_OFF
        number = dialect.MAV_CMD_INJECT_FAILURE
        return self.bench.command(number, unit, off, math.nan, mask)

    # -- hands ----------------------------------------------------------------------------------

    def sticks(self, roll: float, pitch: float, throttle: float, yaw: float) -> None:
        """Hold the sticks there, each -1 to 1 (throttle 0: the middle), until they are let go."""
        self._sticks = (roll, pitch, throttle, yaw)
        self.station.stream("sticks", 10.0, self._stick_message)

    def let_go(self) -> None:
        """No sticks any more."""
        self.station.stop("sticks")
        if self.kind != PX4:
            none = [0] * 8
            self.station.send(dialect.MAVLink_rc_channels_override_message(1, 1, *none))

    def fly(self, north: float, east: float, down: float) -> None:
        """A velocity, m/s, until another order; PX4 then must be in OFFBOARD."""
        self._velocity = (north, east, down)
        self.station.stream("velocity", 10.0, self._velocity_message)

    def stop_flying(self) -> None:
        """No velocity any more."""
        self.station.stop("velocity")

    # -- missions -------------------------------------------------------------------------------

    def upload(self, height: float) -> None:
        """A mission: take off, fly 60 m north and back, land."""
        up = (
            dialect.MAV_CMD_NAV_VTOL_TAKEOFF
            if self.kind == ARDUPLANE
            else dialect.MAV_CMD_NAV_TAKEOFF
        )
        down = (
            dialect.MAV_CMD_NAV_VTOL_LAND if self.kind == ARDUPLANE else dialect.MAV_CMD_NAV_LAND
        )
        point = dialect.MAV_CMD_NAV_WAYPOINT
        steps = [(up, 0.0, height), (point, 60.0, height), (point, 0.0, height), (down, 0.0, 0.0)]
        if self.kind != PX4:
            steps.insert(0, (point, 0.0, 0.0))  # ArduPilot's first item is home
        self._mission = [self._item(seq, *step) for seq, step in enumerate(steps)]
        self.station.upload(self._mission)

    def turn(self) -> None:
        """Go on with an upload."""
        wanted, self.station.wanted_item = self.station.wanted_item, None
        if wanted is not None and wanted < len(self._mission):
            self.station.send(self._mission[wanted])

    def start_mission(self) -> float:
        """The command."""
        return self.station.command(dialect.MAV_CMD_MISSION_START, 0.0, 0.0)

    def _item(self, seq: int, command: int, north: float, height: float) -> Any:
        latitude = int((LATITUDE + north / 111_320.0) * 1e7)
        yaw = math.nan if self.kind == PX4 else 0.0
        where = (latitude, int(LONGITUDE * 1e7), height)
        return dialect.MAVLink_mission_item_int_message(
            1, 1, seq, _GLOBAL_RELATIVE, command, int(seq == 0), 1, 0, 0, 0, yaw, *where
        )

    def _stick_message(self) -> Any:
        roll, pitch, throttle, yaw = self._sticks
        if self.kind == PX4:
            return dialect.MAVLink_manual_control_message(
                1,
                int(pitch * 1000),
                int(roll * 1000),
                int((throttle + 1.0) * 500),
                int(yaw * 1000),
                0,
            )
        values = [int(1500 + 500 * one) for one in (roll, -pitch, throttle, yaw)]
        return dialect.MAVLink_rc_channels_override_message(1, 1, *values, 0, 0, 0, 0)

    def _velocity_message(self) -> Any:
        nothing = (0.0, 0.0, 0.0)
        return dialect.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, _LOCAL_NED, _VELOCITY_ONLY, *nothing, *self._velocity, *nothing, 0.0, 0.0
        )
