"""Aeroplanes of JSBSim in SI units, and a controller that flies them as autopilots do."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from importlib.metadata import version

from chute_ros.sim.flight import GRAVITY

# Read as it is imported: no banner for each of hundreds of aeroplanes.
os.environ.setdefault("JSBSIM_DEBUG", "0")
import jsbsim

BODY = f"jsbsim {version('jsbsim')}"
DT = 0.01  # s
_FOOT, _POUND = 0.3048, 0.45359237
#: JSBSim's own ground lies so far below, m.
_DEEP = 100.0
#: What the controller commands at most, rad.
_MOST_PITCH_UP, _MOST_PITCH_DOWN = math.radians(18.0), math.radians(15.0)


@dataclass(frozen=True)
class Kind:
    """model: of JSBSim; cruise: m/s; pulls: elevator of each rad at its cruise; motor: it has
    one."""

    model: str
    cruise: float
    pulls: float = 2.0
    motor: bool = True


KINDS = (
    Kind("c172x", 52.0),
    Kind("c172p", 50.0),
    Kind("J3Cub", 32.0),
    Kind("minisgs", 14.0, pulls=1.2, motor=False),
)


@dataclass
class Command:
    """What its controller is told to fly: rad, m, m/s."""

    roll: float = 0.0
    height: float = 0.0
    speed: float = 0.0
    #: The height is left to what its speed takes: it glides.
    glides: bool = False


class Aeroplane:
    """One of JSBSim, in the air."""

    def __init__(self, kind: Kind, height: float, seed: int) -> None:
        self.kind = kind
        self.fdm = jsbsim.FGFDMExec(None)
        self.fdm.set_debug_level(0)
        self.fdm.load_model(kind.model)
        # Some of its models write what they do into the present folder.
        self.fdm.disable_output()
        self.fdm.set_dt(DT)
        self.fdm["simulation/randomseed"] = seed
        # The record ends at a height of 0: whatever a wheel or wing tip does there is none of it.
        self.fdm["ic/terrain-elevation-ft"] = -_DEEP / _FOOT
        self.fdm["ic/h-sl-ft"] = height / _FOOT
        self.fdm["ic/vt-fps"] = kind.cruise / _FOOT
        self.fdm["ic/theta-deg"] = 2.0
        self.fdm.run_ic()
        if kind.motor:
            self.fdm["fcs/mixture-cmd-norm"] = 0.9
            self.fdm["propulsion/set-running"] = -1

    def blow(self, north: float, east: float, turbulence: float) -> None:
        """Wind, and Milspec turbulence of the wind speed at 20 ft, m/s."""
        self.fdm["atmosphere/wind-north-fps"] = north / _FOOT
        self.fdm["atmosphere/wind-east-fps"] = east / _FOOT
        if turbulence:
            self.fdm["atmosphere/turb-type"] = 3
            self.fdm["atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps"] = (
                turbulence / _FOOT
            )
            self.fdm["atmosphere/turbulence/milspec/severity"] = 3

    def lift_to(self, height: float) -> None:
        """Carried there as it flies, m."""
        self.fdm["position/h-sl-ft"] = height / _FOOT

    def stop_engine(self) -> None:
        """It has no fuel any more, and its propeller turns in the wind."""
        self.fdm["propulsion/cutoff_cmd"] = 1.0
        self.fdm["fcs/mixture-cmd-norm"] = 0.0
        self.fdm["propulsion/magneto_cmd"] = 0.0

    def step(self, controls: dict[str, float]) -> None:
        """By DT; aileron, elevator (up positive), rudder: -1 to 1; throttle: 0 to 1."""
        for name, value in controls.items():
            told = -value if name == "elevator" else value
            self.fdm[f"fcs/{name}-cmd-norm"] = told
        self.fdm.run()

    def _at(self, name: str, unit: float = 1.0) -> float:
        return float(self.fdm[name]) * unit

    @property
    def height(self) -> float:
        """m above the ground."""
        return self._at("position/h-sl-ft", _FOOT)

    @property
    def vertical_speed(self) -> float:
        """m/s up."""
        return self._at("velocities/h-dot-fps", _FOOT)

    @property
    def air_speed(self) -> float:
        """m/s."""
        return self._at("velocities/vt-fps", _FOOT)

    @property
    def ground_speed(self) -> float:
        """m/s."""
        return self._at("velocities/vg-fps", _FOOT)

    @property
    def angles(self) -> tuple[float, float, float]:
        """Roll, pitch, yaw, rad."""
        yaw = math.remainder(self._at("attitude/psi-rad"), math.tau)
        return self._at("attitude/phi-rad"), self._at("attitude/theta-rad"), yaw

    @property
    def rates(self) -> tuple[float, float, float]:
        """rad/s."""
        return tuple(self._at(f"velocities/{one}-rad_sec") for one in "pqr")  # type: ignore[return-value]

    @property
    def force(self) -> float:
        """Length of the specific force, m/s^2."""
        return GRAVITY * math.hypot(*(self._at(f"accelerations/N{one}") for one in "xyz"))

    @property
    def mass(self) -> float:
        """kg."""
        return self._at("inertia/weight-lbs", _POUND)


class Controller:
    """Height by pitch, speed by throttle; in a glide, speed by pitch."""

    def __init__(self, plane: Aeroplane) -> None:
        self._plane = plane
        self._pitch_gained = math.radians(2.0)
        self._elevator_gained = 0.0
        self._throttle_gained = 0.6
        #: What it commands: rad, rad, m/s.
        self.roll = self.pitch = self.vertical_speed = 0.0
        #: The pitch of a dive that is flown on purpose, rad; None: none is.
        self.dives: float | None = None

    def controls(self, command: Command) -> dict[str, float]:
        """For one step."""
        plane = self._plane
        roll, pitch, _ = plane.angles
        p, q, _ = plane.rates
        speed, cruise = max(5.0, plane.air_speed), plane.kind.cruise
        slow = speed - command.speed
        if command.glides:
            self.vertical_speed = plane.vertical_speed
            self._pitch_gained += 0.1 * slow / cruise * DT
            wanted = self._pitch_gained + 1.2 * slow / cruise
        else:
            most = 0.08 * cruise
            self.vertical_speed = _held(0.25 * (command.height - plane.height), most)
            climb = (self.vertical_speed - plane.vertical_speed) / speed
            self._pitch_gained += 0.4 * climb * DT
            wanted = self._pitch_gained + 0.8 * climb
            # Too slow to hold the height: speed first.
            wanted += min(0.0, 3.0 * (slow / cruise + 0.15))
        if self.dives is not None:
            # By hand: no height is held, and what sinks is what was commanded.
            wanted = self.dives
            self.vertical_speed, command.height = plane.vertical_speed, plane.height
        self._pitch_gained = max(-_MOST_PITCH_DOWN, min(_MOST_PITCH_UP, self._pitch_gained))
        self.pitch = max(self.dives or -_MOST_PITCH_DOWN, min(_MOST_PITCH_UP, wanted))
        self.roll = command.roll
        stiff = (cruise / speed) ** 2
        error = self.pitch - pitch
        # In a turn it must pull.
        pull = 0.35 * (1.0 / max(0.4, math.cos(roll)) - 1.0)
        self._elevator_gained = _held(self._elevator_gained + 1.2 * error * DT, 0.8)
        elevator = stiff * (plane.kind.pulls * error - 0.6 * q + pull) + self._elevator_gained
        aileron = stiff * (1.2 * (self.roll - roll) - 0.35 * p)
        gained = self._throttle_gained - 0.75 * slow / cruise * DT
        self._throttle_gained = min(1.0, max(0.0, gained))
        return {
            "aileron": _held(aileron, 1.0),
            "elevator": _held(elevator, 1.0),
            "rudder": 0.0,
            "throttle": min(1.0, max(0.0, self._throttle_gained - 3.0 * slow / cruise)),
        }


def _held(value: float, most: float) -> float:
    return max(-most, min(most, value))
