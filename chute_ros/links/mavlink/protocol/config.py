"""Settings of one MAVLink link. Times in s; ids 1 to 255, 0: any."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field

from chute_ros.errors import ParameterError
from chute_ros.links.mavlink.protocol.commands import CommandLimits
from chute_ros.links.mavlink.protocol.parachute import StatusLimits
from chute_ros.model import TriggerFlags
from chute_ros.protocol.effect import EffectLimits
from chute_ros.protocol.liveness import LivenessLimits


class KillMethod(enum.Enum):
    """Which way to stop the motors is tried first. The other one follows where it fails."""

    #: By what the autopilot says that it is, and by its settings.
    AUTO = "auto"
    #: MAV_CMD_DO_FLIGHTTERMINATION (185), param1 = 1.
    FLIGHT_TERMINATION = "flight_termination"
    #: MAV_CMD_COMPONENT_ARM_DISARM (400), param1 = 0, param2 = 21196.
    FORCED_DISARM = "forced_disarm"


@dataclass(frozen=True)
class MavlinkConfig:
    """Settings of a MavlinkLink."""

    system_id: int = 1
    component_id: int = 191  # MAV_COMP_ID_ONBOARD_COMPUTER
    parachute_system_id: int = 0
    parachute_component_id: int = 0
    autopilot_system_id: int = 0
    autopilot_component_id: int = 1  # MAV_COMP_ID_AUTOPILOT1
    parachute_liveness: LivenessLimits = field(default=LivenessLimits(2.5, 5.0))
    autopilot_liveness: LivenessLimits = field(default=LivenessLimits(2.5, 5.0))
    status: StatusLimits = field(default=StatusLimits())
    commands: CommandLimits = field(default=CommandLimits())
    effect: EffectLimits = field(default=EffectLimits())
    default_triggers: TriggerFlags = TriggerFlags.FC | TriggerFlags.OFFBOARD
    kill_method: KillMethod = KillMethod.AUTO
    #: Rate to ask of the autopilot for each message that vehicle/state needs, Hz; 0: do not ask.
    autopilot_message_rate: float = 10.0
    #: Rate that the rules need of each message that they measure with, Hz; 0: not judged.
    needed_message_rate: float = 5.0
    #: Undo arming on the ground while flight is blocked.
    disarm_when_blocked: bool = True
    #: The vehicle is off the ground once it was higher than this above where it was armed, m.
    takeoff_height: float = 2.0
    heartbeat_interval: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 < self.heartbeat_interval < math.inf:
            raise ParameterError(
                f"heartbeat_interval is {self.heartbeat_interval}: need a time above 0 s"
            )
        if not 0.0 < self.takeoff_height < math.inf:
            raise ParameterError(
                f"takeoff_height is {self.takeoff_height}: need a height above 0 m"
            )
