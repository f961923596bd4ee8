"""One flight of a campaign: vehicle, wind, what fails, what else goes wrong (draw.py draws it)."""

from __future__ import annotations

import enum
import functools
from dataclasses import dataclass

from chute_ros.campaign.channel import Spell
from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.manoeuvre import Manoeuvre
from chute_ros.campaign.sensors import SensorFault
from chute_ros.campaign.truth import SOFT
from chute_ros.links.api import AUTOPILOT_LINK, SUPERVISOR, CampaignPart, VehicleKind, load
from chute_ros.links.registered import links, vehicles
from chute_ros.protocol.vehicle_merge import IMU, ODOMETRY, VEHICLE_STATE
from chute_ros.sim.autopilot_kinds import GENERIC
from chute_ros.sim.flight import Descent
from chute_ros.sim.home import Homing

#: At most so many things go wrong besides the failure, and one more of a second source.
MOST_FAULTS = 3
_GRAVITY = 9.81  # m/s^2
#: About what the rocket's motor pushes it with, m/s^2.
_BURN = 51.0


class Failure(enum.Enum):
    """What ends controlled flight, or does not."""

    NOTHING = "nothing fails"
    MOTOR = "a motor fails"
    REBOOT = "the autopilot restarts, and does not hold the vehicle"
    POWER = "the vehicle's power fails, and with it the autopilot"
    HANG = "the autopilot hangs, and the vehicle flies on"
    SINK = "a part of its thrust is lost, and it sinks upright"
    GLIDE = "its motor stops, and it glides"
    STALL = "it stalls, spins or dives, and does not recover"
    NO_DROGUE = "the drogue does not come by itself at the apogee"
    TAPE = "its tape's failure"
    FAULT = "the flight computer goes to Fault"
    COMPUTER_REBOOT = "the flight computer restarts"
    COMPUTER_POWER = "the flight computer has no power any more"
    COMPUTER_SILENT = "the flight computer falls silent, and does its work"


PROFILES = ("multirotor", "fixed_wing", "rocket")

#: The one that leads, and the one that stands by; what reaches each, and what it tells.
SUPERVISORS = ("supervisor", "standby")
ROS_WAYS = ("to the supervisor", "from the supervisor")
STANDBY_WAYS = ("to the standby", "from the standby")
#: Over which an autopilot tells.
AUTOPILOT_WAYS = ("autopilot", AUTOPILOT_LINK)


@functools.cache
def part(link: str) -> CampaignPart:
    """What the campaign has of a link."""
    made: CampaignPart = load(links()[link].part)()
    return made


@functools.cache
def flown_vehicles() -> tuple[VehicleKind, ...]:
    """Those whose links all have a part in the campaign."""
    kinds = links()
    return tuple(v for v in vehicles().values() if all(kinds[one].part for one in v.links))


#: Their names, for who writes a scenario by hand: Vehicle.MAVLINK is "mavlink".
Vehicle = enum.Enum(  # type: ignore[misc]  # mypy knows only members that are written here
    "Vehicle", {one.name.upper(): one.name for one in flown_vehicles()}, type=str
)


def ways_of(vehicle: str) -> tuple[str, ...]:
    """The ways that a spell can lie on."""
    kind = vehicles()[vehicle]
    return tuple(way for link in kind.links for way in part(link).ways(kind))


def stopping_of(vehicle: str) -> tuple[str, ...]:
    """The device nodes and devices that can stop. Nodes hang as well as die, and have a wall
    clock."""
    kind = vehicles()[vehicle]
    return (*kind.links, *(one for link in kind.links for one in part(link).stopping(kind)))


def is_rocket(vehicle: str) -> bool:
    """Whether it flies by the profile of rockets."""
    return vehicles()[vehicle].given(SUPERVISOR, "profile", PROFILES[0]) == PROFILES[2]


_SENSORS = {
    "height": ("sticks", "drifts", "jumps", "noise"),
    "speed": ("sticks", "drifts", "jumps", "noise", "zero"),
    "tilt": ("sticks", "jumps", "noise", "gone"),
    "force": ("sticks", "noise", "zero"),
    "pressure": ("sticks", "drifts", "jumps", "noise", "gone"),
    "landed": ("lies",),
    "disarmed": ("lies",),
}
_ROCKET_SENSORS = {
    "height": ("sticks", "drifts", "jumps", "noise", "gone"),
    "speed": ("sticks", "jumps", "noise", "gone"),
    "force": ("sticks", "noise", "zero"),
    "fix": ("lies",),
}
#: Of each source besides the autopilot.
SECOND_SENSORS = {
    IMU: {"tilt": _SENSORS["tilt"], "force": _SENSORS["force"]},
    ODOMETRY: {name: _SENSORS[name] for name in ("height", "speed", "tilt")},
}


def sensors_of(vehicle: str) -> dict[str, tuple[str, ...]]:
    """Of its autopilot or flight computer, and in which ways each may be wrong."""
    return _ROCKET_SENSORS if is_rocket(vehicle) else _SENSORS


@dataclass(frozen=True)
class WayFault:
    """A spell on one way."""

    way: str
    spell: Spell


@dataclass(frozen=True)
class Stop:
    """A process hangs for so long, or dies and is there again after it; a device has no power for
    so long. Times: virtual s."""

    who: str
    at: float
    lasts: float
    dies: bool = False


@dataclass(frozen=True)
class Stalls:
    """The supervisor's host is overloaded: it stands still again and again, at most longest s."""

    who: str
    begin: float
    end: float
    longest: float


@dataclass(frozen=True)
class ClockJump:
    """The wall clock of a process is set by so many s."""

    who: str
    at: float
    by: float


@dataclass(frozen=True)
class HomeMove:
    """Home is set anew in flight, so many m higher."""

    at: float
    by: float


Fault = WayFault | Stop | Stalls | ClockJump | SensorFault | EstimatorFault | HomeMove


@dataclass(frozen=True)
class Person:
    """Somebody at the supervisor's services. does: deploy, kill, or kill_only: the kill, and no
    deploy after it."""

    does: str
    at: float


@dataclass(frozen=True)
class Canopy:
    """Of the parachute that comes out first: m/s under it, and s until it is open."""

    speed: float = 5.0
    opens: float = 1.2

    @property
    def carries(self) -> bool:
        """It lands what hangs below it softly, if it opens in time."""
        return self.speed <= SOFT


@dataclass(frozen=True)
class Autopilot:
    """Whose it is (sim/autopilot_kinds.py) shows in what it does besides flying. home_drift: m/s;
    imus: accelerometers, 1 or 2."""

    homing: Homing = Homing.STAYS
    home_drift: float = 0.0
    kind: str = GENERIC.name
    imus: int = 1


@dataclass(frozen=True)
class Taped:
    """The tape that is its flight, by its name in a file that is given with it.

    body, failed: as on its label; lasts: s; is_lost: it gets out of control, at failure_at;
    shows_after: so long after that it shows, s; ends_hard, level: as on its label.
    """

    name: str
    body: str
    failed: str
    lasts: float
    is_lost: bool
    shows_after: float
    ends_hard: bool
    level: bool


@dataclass(frozen=True)
class Scenario:
    """Times are s after an aircraft has stood at its height for 0.3 s, or a rocket was launched.
    Nothing goes wrong before that height or launch: what was drawn earlier (a negative time)
    begins there, and a stop then lasts as long from there. height (m), gusts (m/s^2), fall_speed
    (m/s): of an aircraft; burn: of a rocket, s; ground: under the flight, m above the take-off;
    vehicle: a VehicleKind's name."""

    seed: int
    vehicle: str
    profile: str
    height: float
    gusts: float
    fall_speed: float
    burn: float
    failure: Failure
    failure_at: float
    faults: tuple[Fault, ...] = ()
    #: A second supervisor stands by.
    standby: bool = False
    #: The UPF parachute may release itself.
    aps: bool = False
    #: The parachute is armed by safety/arm; an aircraft's may be armed from the start.
    arms: bool = False
    person: Person | None = None
    #: Where the supervisor learns of the vehicle, as its node's parameter: the preferred first.
    vehicle_sources: tuple[str, ...] = (VEHICLE_STATE,)
    ground: float = 0.0
    #: What it is told to do besides hovering.
    manoeuvre: Manoeuvre | None = None
    #: How it comes down with its autopilot and without; None: it falls and tumbles.
    descent: Descent | None = None
    unheld: Descent | None = None
    canopy: Canopy = Canopy()
    autopilot: Autopilot = Autopilot()
    #: Of so many, with a reset of nothing in between, this is the last.
    flights: int = 1
    #: What it takes off from moves up and down by so much, m.
    deck: float = 0.0
    #: What flies instead of the small model, until our side acts.
    tape: Taped | None = None

    @property
    def stands(self) -> bool:
        """It never leaves the ground, armed as it is."""
        return not self.is_rocket and self.height == 0.0

    @property
    def lands(self) -> bool:
        """It comes down as its pilot wants."""
        return self.manoeuvre is not None and self.manoeuvre.lands

    @property
    def is_rocket(self) -> bool:
        """It is no aircraft."""
        return is_rocket(self.vehicle)

    @property
    def carries(self) -> VehicleKind:
        """What flies, and how its parachute is spoken to."""
        return vehicles()[self.vehicle]

    @property
    def second_sources(self) -> tuple[str, ...]:
        """Those that outlive the autopilot."""
        return tuple(one for one in self.vehicle_sources if one != VEHICLE_STATE)

    @property
    def apogee_at(self) -> float:
        """About when the rocket turns over, s after its launch."""
        return self.burn * (1.0 + (_BURN - _GRAVITY) / _GRAVITY)


_KNOWN_BY = {
    VEHICLE_STATE: ("height", "speed", "tilt", "force", "pressure", "estimator"),
    **SECOND_SENSORS,
}
_SILENCES = (Failure.REBOOT, Failure.POWER, Failure.HANG)


def outlives(scenario: Scenario) -> bool:
    """The autopilot has no power any more, and another source still tells of the vehicle."""
    return scenario.failure is Failure.POWER and bool(scenario.second_sources)


def may_count(scenario: Scenario, fault: SensorFault | EstimatorFault) -> bool:
    """What this sensor says may be told to the supervisor: its source is the preferred one of
    those that know it, or one that is preferred falls silent at some time."""
    teller = fault.source or VEHICLE_STATE
    for source in scenario.vehicle_sources:
        if source == teller:
            return True
        if fault.sensor in _KNOWN_BY[source] and not _falls_silent(scenario, source):
            return False
    return True


def _falls_silent(scenario: Scenario, source: str) -> bool:
    """At some time, or one of its sensors."""
    is_autopilot = source == VEHICLE_STATE
    ways = AUTOPILOT_WAYS if is_autopilot else (source,)
    for one in scenario.faults:
        if isinstance(one, SensorFault):
            silent = one.how == "gone" and (one.source or VEHICLE_STATE) == source
        else:
            silent = isinstance(one, WayFault) and one.way in ways
            silent |= isinstance(one, Stop) and one.who in ways
        if silent:
            return True
    return is_autopilot and scenario.failure in _SILENCES
