"""Which flight controller an autopilot runs, by its heartbeat.

Source: MAVLink minimal.xml, MAV_AUTOPILOT and MAV_TYPE.
"""

from __future__ import annotations

import enum

from chute_ros.protocol.mavlink.dialect import dialect


class Firmware(enum.Enum):
    """The flight controllers whose ways with a kill are known."""

    PX4 = "PX4"
    ARDUPILOT = "ArduPilot"
    OTHER = "an unknown autopilot"


_BY_AUTOPILOT = {
    dialect.MAV_AUTOPILOT_PX4: Firmware.PX4,
    dialect.MAV_AUTOPILOT_ARDUPILOTMEGA: Firmware.ARDUPILOT,
}
#: Types that ArduPlane gives itself unless its user chose another (Q_MAV_TYPE).
_VTOLS = range(dialect.MAV_TYPE_VTOL_DUOROTOR, dialect.MAV_TYPE_VTOL_RESERVED5 + 1)
_AEROPLANES = frozenset({dialect.MAV_TYPE_FIXED_WING, *_VTOLS})


def firmware_of(autopilot: int) -> Firmware:
    """By HEARTBEAT.autopilot."""
    return _BY_AUTOPILOT.get(autopilot, Firmware.OTHER)


def is_aeroplane(vehicle_type: int) -> bool:
    """HEARTBEAT.type is that of an aeroplane or a VTOL."""
    return vehicle_type in _AEROPLANES
