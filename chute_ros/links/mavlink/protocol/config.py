"""Settings of a MAVLink link."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from chute_ros.errors import ParameterError
from chute_ros.links.mavlink.protocol.commands import CommandLimits
from chute_ros.links.mavlink.protocol.parachute import StatusLimits
from chute_ros.model import TriggerFlags
from chute_ros.protocol.goal import Commanded, EffectLimits
from chute_ros.protocol.liveness import LivenessLimits
from chute_ros.settings import Settings, nested, parameter


class KillMethod(enum.Enum):
    """Way to stop the motors that is tried first."""

    #: By the kind of autopilot and its settings.
    AUTO = "auto"
    #: MAV_CMD_DO_FLIGHTTERMINATION (185), param1 = 1.
    FLIGHT_TERMINATION = "flight_termination"
    #: MAV_CMD_COMPONENT_ARM_DISARM (400), param1 = 0, param2 = 21196.
    FORCED_DISARM = "forced_disarm"


_NOT_SOONER = {"minimum": 0.1}


@dataclass(frozen=True)
class MavlinkConfig(Commanded, Settings):
    """Settings of a MavlinkLink. heartbeat_interval: of its own heartbeat, s."""

    system_id: int = parameter(1, "MAVLink system id of this node: the vehicle's", 1, 255)
    #: MAV_COMP_ID_ONBOARD_COMPUTER.
    component_id: int = parameter(191, "MAVLink component id of this node", 1, 255)
    parachute_system_id: int = parameter(
        0, "system id of the parachutes; 0: that of the first one received", 0, 255
    )
    parachute_component_id: int = parameter(0, "component id of the parachute; 0: any", 0, 255)
    autopilot_system_id: int = parameter(
        0, "system id of the autopilot; 0: that of the first one received", 0, 255
    )
    #: MAV_COMP_ID_AUTOPILOT1.
    autopilot_component_id: int = parameter(1, "component id of the autopilot; 0: any", 0, 255)
    parachute_liveness: LivenessLimits = nested(
        LivenessLimits(2.5, 5.0), "parachute", stale_after=_NOT_SOONER, lost_after=_NOT_SOONER
    )
    autopilot_liveness: LivenessLimits = nested(
        LivenessLimits(2.5, 5.0), "autopilot", stale_after=_NOT_SOONER, lost_after=_NOT_SOONER
    )
    status: StatusLimits = nested(StatusLimits())
    commands: CommandLimits = nested(CommandLimits())
    effect: EffectLimits = nested(EffectLimits())
    default_triggers: TriggerFlags = parameter(
        TriggerFlags.FC | TriggerFlags.OFFBOARD,
        "trigger sources that ~/arm arms if its triggers are 0: mask of PARACHUTE_TRIGGER_FLAGS",
        1,
        255,
    )
    kill_method: KillMethod = parameter(
        KillMethod.AUTO,
        "way to stop the motors that is tried first; the other one follows if it fails; a way "
        "that also releases a parachute is not taken before a deploy was decided",
    )
    takeoff_height: float = parameter(
        2.0,
        "a flight block holds until the vehicle was higher than this above the place where it was "
        "armed",
        0.1,
        100.0,
        "m",
    )
    disarm_when_blocked: bool = parameter(
        True, "undo arming on the ground while flight is blocked"
    )
    autopilot_message_rate: float = parameter(
        10.0,
        "rate that is requested of the autopilot for each message of vehicle/state; 0: no request",
        0.0,
        100.0,
        "Hz",
        changeable=True,
    )
    needed_message_rate: float = parameter(
        5.0,
        "take-off is forbidden if GLOBAL_POSITION_INT, ATTITUDE or SCALED_IMU comes at a lower "
        "rate, or never; 0: not checked",
        0.0,
        100.0,
        "Hz",
    )
    heartbeat_interval: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 < self.heartbeat_interval < math.inf:
            raise ParameterError(
                f"heartbeat_interval is {self.heartbeat_interval}: need a time above 0 s"
            )
