"""Which autopilot a simulated one plays: where real ones differ as they are armed and killed.

Sources, read and flown: PX4 src/modules/commander and mavlink; ArduPilot AP_AdvancedFailsafe,
AP_Arming, ArduCopter and ArduPlane.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from chute_ros.protocol.mavlink.dialect import dialect


class Termination(enum.Enum):
    """What MAV_CMD_DO_FLIGHTTERMINATION does."""

    OBEYED = "motors off until a reboot"
    RELEASES = "motors off until a reboot; it orders the parachute's release itself"
    DISARMS = "motors off; it may be armed again"
    NEEDS_AFS = "refused without AFS_ENABLE 1 and AFS_TERM_ACTION 42"


@dataclass(frozen=True)
class AutopilotKind:
    """One autopilot. Times in s."""

    name: str
    #: MAV_AUTOPILOT and MAV_TYPE of its heartbeat.
    autopilot: int = dialect.MAV_AUTOPILOT_GENERIC
    vehicle_type: int = dialect.MAV_TYPE_QUADROTOR
    termination: Termination = Termination.OBEYED
    #: Answer to a plain disarm while it takes itself to fly.
    disarm_refused: int = dialect.MAV_RESULT_TEMPORARILY_REJECTED
    #: Answered by the parameter protocol; an int is an integer there.
    parameters: Mapping[str, float] = field(default_factory=dict)
    #: An integer lies in the bytes of the float.
    bytewise: bool = False
    #: A heartbeat follows at once as it is armed or disarmed, and other intervals are obeyed.
    quick_heartbeat: bool = True
    #: From an order to the heartbeat that shows it.
    settles: float = 0.0
    #: From a take-off that was ordered to IN_AIR, whatever the height.
    early_in_air: float = math.inf
    #: From being disarmed in the air, or started anew there, to ON_GROUND, whatever it does.
    stands_disarmed: float = math.inf
    #: HEARTBEAT.custom_mode.
    custom_mode: int = 0
    #: EXTENDED_SYS_STATE.vtol_state: ArduCopter always says MC, a quadplane FW on its wing.
    vtol_state: int = dialect.MAV_VTOL_STATE_UNDEFINED
    #: What is commanded comes with NAV_CONTROLLER_OUTPUT alone.
    targets_of_a_wing: bool = False


GENERIC = AutopilotKind("generic")
PX4 = AutopilotKind(
    "px4",
    dialect.MAV_AUTOPILOT_PX4,
    termination=Termination.RELEASES,
    parameters={
        "COM_ARM_AUTH_REQ": 0,
        "COM_ARM_AUTH_ID": 10,
        "COM_ARM_AUTH_MET": 0,
        "COM_SPOOLUP_TIME": 1.0,
        "MPC_TKO_RAMP_T": 3.0,
        "CBRK_FLIGHTTERM": 121212,
        "COM_PARACHUTE": 0,
    },
    bytewise=True,
    quick_heartbeat=False,
    settles=0.01,
    stands_disarmed=0.35,
)
_ARDUPILOT = {"CHUTE_ENABLED": 0}
ARDUCOPTER = AutopilotKind(
    "arducopter",
    dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
    termination=Termination.DISARMS,
    disarm_refused=dialect.MAV_RESULT_FAILED,
    parameters=_ARDUPILOT,
    stands_disarmed=0.0,
    vtol_state=dialect.MAV_VTOL_STATE_MC,
)
ARDUPLANE = AutopilotKind(
    "arduplane",
    dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
    dialect.MAV_TYPE_FIXED_WING,  # a quadplane's as well, unless Q_MAV_TYPE says otherwise
    Termination.NEEDS_AFS,
    dialect.MAV_RESULT_FAILED,
    {
        **_ARDUPILOT,
        "ARMING_REQUIRE": 1,
        "AFS_ENABLE": 0,
        "AFS_TERM_ACTION": 0,
        "AFS_TERM_PIN": -1,
        "HOME_RESET_ALT": 0,
    },
    quick_heartbeat=False,
    early_in_air=0.05,
    custom_mode=15,  # GUIDED
    targets_of_a_wing=True,
    vtol_state=dialect.MAV_VTOL_STATE_FW,
)
KINDS = {kind.name: kind for kind in (GENERIC, PX4, ARDUCOPTER, ARDUPLANE)}
