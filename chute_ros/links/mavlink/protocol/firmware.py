"""Which flight controller an autopilot runs, by its heartbeat.

Source: MAVLink minimal.xml, MAV_AUTOPILOT.
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


def firmware_of(autopilot: int) -> Firmware:
    """By HEARTBEAT.autopilot."""
    return _BY_AUTOPILOT.get(autopilot, Firmware.OTHER)
