"""Which flight controller an autopilot runs, and what it flies, by what it tells.

Source: MAVLink minimal.xml, MAV_AUTOPILOT and MAV_VTOL_STATE.
"""

from __future__ import annotations

import enum

from chute_ros.model import Airframe, airframes_of
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


def shows_vtol(vehicle_type: int, vtol_state: int) -> bool:
    """EXTENDED_SYS_STATE.vtol_state beside this HEARTBEAT.type is that of a VTOL with another
    MAV_TYPE. A plain aeroplane tells none; ArduCopter says MC (GCS_MAVLINK_Copter::vtol_state)."""
    usual = {
        (Airframe.FIXED_WING,): (dialect.MAV_VTOL_STATE_UNDEFINED,),
        (Airframe.MULTIROTOR,): (dialect.MAV_VTOL_STATE_UNDEFINED, dialect.MAV_VTOL_STATE_MC),
    }
    kinds = airframes_of(vehicle_type)
    return kinds in usual and vtol_state not in usual[kinds]


def firmware_of(autopilot: int) -> Firmware:
    """By HEARTBEAT.autopilot."""
    return _BY_AUTOPILOT.get(autopilot, Firmware.OTHER)
