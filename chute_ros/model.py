"""Types shared by protocols, supervisor and nodes. All are frozen; none knows ROS or a wire.

Times are monotonic seconds unless said otherwise. Not known is NaN for floats, 0 of an
enumeration or mask, and empty text, as in the chute_msgs messages of the same names.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, fields, replace

NAN = math.nan


class LinkState(enum.IntEnum):
    """State of the wire to one device; numbers of chute_msgs/LinkHeartbeat."""

    NEVER_SEEN = 0
    OK = 1
    STALE = 2
    LOST = 3
    #: The wire is open and the device never says anything on it: what it is can only be hoped.
    UNMONITORED = 5


class ParachuteState(enum.IntEnum):
    """Global working state in the numbering of UPF (Flyfire UPF V1.0, flyfire.ParachuteStatus)."""

    UNKNOWN = 0
    NOT_READY = 1
    READY = 2
    TAKEOFF = 3
    ARMED = 4
    LAUNCHED = 5
    TOUCHDOWN = 6
    ABNORMAL = 7


class DeploymentTrigger(enum.IntEnum):
    """PARACHUTE_DEPLOYMENT_TRIGGER of the MAVLink parachute protocol."""

    NONE = 0
    MANUAL = 1
    ATS = 2
    DRONE = 3
    MAVLINK = 4
    GEOFENCE = 5
    FTS_PRECHECKING = 6


class TriggerFlags(enum.IntFlag, boundary=enum.KEEP):
    """PARACHUTE_TRIGGER_FLAGS of the MAVLink parachute protocol."""

    MANUAL = 1
    ATS = 2
    FC = 4
    OFFBOARD = 8
    GEOFENCE = 16
    FTS_PRECHECKING = 32
    ATS_AUTO_ARM = 64
    ATS_AUTO_DISARM = 128


#: The flags that fire the parachute; the other two only switch ATS on and off by height.
TRIGGER_SOURCES = TriggerFlags(0b00111111)


class SafetyFlags(enum.IntFlag, boundary=enum.KEEP):
    """PARACHUTE_SAFETY_FLAGS of the MAVLink parachute protocol."""

    GROUND_CLEARED = 1
    ON_GROUND = 2
    GEOFENCE_MISSION_SET = 4


class ErrorFlags(enum.IntFlag, boundary=enum.KEEP):
    """PARACHUTE_ERROR_FLAGS of the MAVLink parachute protocol."""

    BAROMETER_ERROR = 1
    IMU_ERROR = 2
    RF_CONNECTION_ERROR = 4
    LOW_POWER = 8
    FC_CONNECTION_ERROR = 16
    EFTS_CONNECTION_ERROR = 32
    POD_CONNECTION_ERROR = 64
    EFTS_DIAGNOSE = 128
    CHARGING_FAILED = 256
    EXTERNAL_POWER_ERROR = 512
    GS_CONNECTION_ERROR = 1024
    GPS_ERROR = 2048
    SUBSYSTEM_CONNECTION_ERROR = 4096
    SUBSYSTEM_FW_ERROR = 8192
    RESERVED_1 = 16384
    RESERVED_2 = 32768
    LOGGING_ERROR = 65536
    MODULE_RETIRED = 131072
    GLOW_WIRE_ERROR = 262144
    OFFBOARD_CONNECTION_ERROR = 524288
    IMU_CALIBRATION_ERROR = 1048576


def name_of(kind: type[enum.IntEnum], number: int) -> str:
    """The name of a member; a number that has none is shown as it is."""
    member = kind._value2member_map_.get(number)
    return str(member.name) if isinstance(member, enum.IntEnum) else f"number {number}"


def flag_names(flags: enum.IntFlag) -> list[str]:
    """Names of the set bits, lowest first; a bit without a name reads "bit N"."""
    kind = type(flags)
    value = int(flags)
    names = []
    for bit in range(value.bit_length()):
        if value >> bit & 1:
            member = kind._value2member_map_.get(1 << bit)
            names.append(str(getattr(member, "name", None) or f"bit {bit}"))
    return names


class Action(enum.IntEnum):
    """What the supervisor can decide; ordered, a later one wins (chute_msgs/SafetyDecision)."""

    NONE = 0
    FLIGHT_BLOCK = 1
    FLIGHT_BLOCK_RELEASE = 2
    KILL = 3
    DEPLOY = 4


#: Those that end a flight.
FIRES = (Action.KILL, Action.DEPLOY)


class Outcome(enum.IntEnum):
    """How far a device node got with a decision (chute_msgs/ActionReport)."""

    NONE = 0
    SENT = 1
    ACCEPTED = 2
    CONFIRMED = 3
    FAILED = 4
    #: For now: the node goes on trying.
    REFUSED = 5


class Armed(enum.IntEnum):
    """Whether the motors may turn (chute_msgs/VehicleState)."""

    UNKNOWN = 0
    DISARMED = 1
    ARMED = 2


class LandedState(enum.IntEnum):
    """MAV_LANDED_STATE of MAVLink."""

    UNKNOWN = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKING_OFF = 3
    LANDING = 4


@dataclass(frozen=True)
class ParachuteStatus:
    """The normalised picture of one parachute (chute_msgs/ParachuteStatus without its header)."""

    device: str
    link_state: LinkState = LinkState.NEVER_SEEN
    state: ParachuteState = ParachuteState.UNKNOWN
    armed: bool = False
    deployed: bool = False
    #: Number of DeploymentTrigger, or one that the device made up.
    deployment_trigger: int = 0
    armed_triggers: TriggerFlags = TriggerFlags(0)
    error_flags: ErrorFlags = ErrorFlags(0)
    safety_flags: SafetyFlags = SafetyFlags(0)
    ats_arm_altitude: float = NAN  # m
    height: float = NAN  # m
    backup_voltage: float = NAN  # V
    uptime: float = NAN  # s
    packed_date: str = ""
    faults: tuple[str, ...] = ()

    @property
    def before_parachute(self) -> bool:
        """A drogue is out, and the parachute after it is not: LAUNCHED, and not deployed."""
        return self.state is ParachuteState.LAUNCHED and not self.deployed

    @property
    def healthy(self) -> bool:
        """The device was heard in time, is whole, and its parachute can still be released."""
        if self.state is ParachuteState.LAUNCHED and self.deployed:
            return False
        return self.link_state is LinkState.OK and self.state in (
            ParachuteState.READY,
            ParachuteState.TAKEOFF,
            ParachuteState.ARMED,
            ParachuteState.LAUNCHED,
        )


@dataclass(frozen=True)
class Reading:
    """A value and the monotonic time (s) of its receipt; NaN time: never received."""

    value: float = NAN
    received: float = NAN

    def age(self, now: float) -> float:
        """Seconds since receipt; NaN: never."""
        return now - self.received


@dataclass(frozen=True)
class VehicleState:
    """What is known of the vehicle (chute_msgs/VehicleState). Ages in s, NaN: never received."""

    source: str = ""
    link_state: LinkState = LinkState.NEVER_SEEN
    armed: Armed = Armed.UNKNOWN
    armed_age: float = NAN
    landed_state: LandedState = LandedState.UNKNOWN
    landed_state_age: float = NAN
    height: float = NAN  # m above take-off
    height_age: float = NAN
    altitude: float = NAN  # m above mean sea level; no change of home moves it
    altitude_age: float = NAN
    pressure: float = NAN  # Pa, static
    pressure_age: float = NAN
    vertical_speed: float = NAN  # m/s, up positive
    vertical_speed_age: float = NAN
    roll: float = NAN  # rad
    pitch: float = NAN  # rad
    yaw: float = NAN  # rad
    tilt: float = NAN  # rad, 0 upright to pi
    attitude_age: float = NAN
    #: rad, between the vertical axes of the vehicle and of the attitude that it was commanded.
    attitude_error: float = NAN
    attitude_error_age: float = NAN
    target_vertical_speed: float = NAN  # m/s, up positive, as commanded
    below_target: float = NAN  # m, the commanded height less that of the vehicle
    target_age: float = NAN
    acceleration: float = NAN  # m/s^2, length of the specific force; of several the middle one
    acceleration_spread: float = NAN  # m/s^2, by how much several accelerometers differ
    acceleration_age: float = NAN
    latitude: float = NAN  # degrees
    longitude: float = NAN  # degrees
    position_age: float = NAN
    battery_voltage: float = NAN  # V
    battery_remaining: float = NAN  # 0 to 1
    battery_age: float = NAN
    system_status: int = 0
    vehicle_type: int = 0
    uptime: float = NAN  # s
    reboot_count: int = 0
    rebooted_in_flight: bool = False
    #: After a restart in flight of the autopilot: height counts from the same place as before it.
    height_holds: bool = False
    #: Why this vehicle must not take off, as its source says it, in words.
    faults: tuple[str, ...] = ()

    def aged(self, by: float) -> VehicleState:
        """The same picture, by seconds later."""
        return replace(self, **{name: getattr(self, name) + by for name in AGES})


#: Fields of VehicleState that tell an age.
AGES = tuple(one.name for one in fields(VehicleState) if one.name.endswith("_age"))


class Airframe(enum.Enum):
    """What a profile of rules is for."""

    ANY = "any"
    MULTIROTOR = "multirotor"
    FIXED_WING = "fixed_wing"
    ROCKET = "rocket"


#: MAV_TYPE of a VTOL of which nobody tells more (VTOL_FIXEDROTOR).
VTOL = 22
#: MAV_TYPE of those with a wing and of those that hover (MAVLink minimal.xml); VTOLs are both.
_VTOLS = frozenset({*range(19, 26), 47})
_WITH_A_WING = _VTOLS | {1, 16}
_HOVER = _VTOLS | {2, 3, 4, 13, 14, 15, 29, 35, 43}
_MAV_TYPES = {
    Airframe.FIXED_WING: _WITH_A_WING,
    Airframe.MULTIROTOR: _HOVER,
    Airframe.ROCKET: frozenset({9}),
}


def airframes_of(mav_type: int) -> tuple[Airframe, ...]:
    """What a vehicle of this MAV_TYPE may be flown as; empty: nobody can say (generic, a type that
    is no aircraft of these)."""
    return tuple(kind for kind, types in _MAV_TYPES.items() if mav_type in types)


@dataclass(frozen=True)
class Decision:
    """One decision of the supervisor (chute_msgs/SafetyDecision without its header)."""

    epoch: int
    id: int
    action: Action
    rule: str
    reasons: tuple[str, ...]
    targets: tuple[str, ...]
    shadow: bool = False
    #: Which device on the link a deploy is for; empty: the one that the node chooses.
    device: str = ""

    @property
    def named(self) -> str:
        """Its number in words: an epoch is made of a time, and would be read as one."""
        return f"decision {self.id} of epoch {self.epoch}"


def pressure_altitude(pressure: float) -> float:
    """Height at which the standard atmosphere has this pressure (Pa), m (ICAO Doc 7488, below
    11 km); NaN: it is no pressure."""
    if not 1000.0 <= pressure <= 120_000.0:
        return math.nan
    return 44_330.77 * (1.0 - math.pow(pressure / 101_325.0, 0.190263))
