"""One flight of a multirotor in RotorPy: a cascaded controller as autopilots have, a mission,
wind, and a failure, all drawn from a seed."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from bodies.recorder import Recorder, Row, UnflyableError
from bodies.rotors import BODY, FRAMES, FailingMultirotor, angles
from bodies.wind import Wind
from chute_ros.sim.flight import GRAVITY
from chute_ros.sim.tape import STEP, Tape

_DT = 0.01  # s
#: It hovers for so long before its mission, and is recorded at most so long after its failure, s.
_HOVERS, _FOLLOWED, _FALLS = 1.0, 10.0, 30.0
#: As PX4 is delivered: MPC_Z_P, MPC_XY_P, and its acceleration of each m/s; tilt at most, rad.
_HEIGHT_P, _PLACE_P, _UP_P, _UP_I, _ALONG_P = 1.0, 0.95, 4.0, 2.0, 1.8
_MOST_TILT = math.radians(40.0)

#: kg.
_HEAVIEST_FLIP = 2.0

MISSIONS = {
    "hover": 3,
    "climb": 2,
    "descent": 3,
    "cruise": 3,
    "braking": 2,
    "hard turn": 2,
    "steps": 2,
    "flip": 1,
}
FAILURES = {
    "nothing": 8,
    "a rotor dead": 6,
    "a rotor at part of its thrust": 4,
    "all rotors dead": 4,
    "the controller stops": 4,
    "thrust below the weight": 5,
}


@dataclass(frozen=True)
class _Plan:
    """speed: m/s, of its mission; rotor: that fails; share: of its thrust that is left."""

    height: float
    mission: str
    speed: float
    failure: str
    failed_at: float
    rotor: int
    share: float
    turns: float


def fly(seed: int) -> Tape:
    """The same for the same seed. UnflyableError: the physics did not stand it."""
    chance = random.Random(f"{seed} multirotor")
    # RotorPy's own noise, of its motors, is drawn here.
    np.random.seed(chance.randrange(2**32))
    vehicle_frame = chance.choice(FRAMES)
    vehicle = FailingMultirotor(vehicle_frame)
    plan = _drawn(chance, vehicle)
    wind = Wind(chance)
    return _Flight(seed, vehicle_frame.name, vehicle, plan, wind).tape()


def _drawn(chance: random.Random, vehicle: FailingMultirotor) -> _Plan:
    mission = chance.choices(list(MISSIONS), list(MISSIONS.values()))[0]
    failure = chance.choices(list(FAILURES), list(FAILURES.values()))[0]
    if mission == "flip":
        # What is heavier follows no such turn, and nobody flips it.
        mission = "hover" if vehicle.mass > _HEAVIEST_FLIP else "flip"
        failure = "nothing"
    speeds = {"climb": (2.0, 8.0), "descent": (1.0, 6.0), "steps": (4.0, 12.0)}
    speed = round(chance.uniform(*speeds.get(mission, (5.0, 16.0))), 1)
    height = round(chance.choice((chance.uniform(15.0, 40.0), chance.uniform(40.0, 120.0))), 1)
    failed_at = round(_HOVERS + chance.uniform(0.5, 5.0), 2)
    if mission == "descent":
        height = max(height, round(12.0 + speed * failed_at, 1))
    share = {
        "a rotor dead": 0.0,
        "all rotors dead": 0.0,
        "a rotor at part of its thrust": round(chance.uniform(0.2, 0.75), 2),
    }.get(failure, 1.0)
    if failure == "thrust below the weight":
        # Of all that its rotors can give, so that so much of the weight is carried at best.
        carried = chance.uniform(0.7, 0.99)
        share = round(carried * vehicle.mass * GRAVITY / vehicle.most_thrust, 4)
    rotor = chance.randrange(vehicle.num_rotors)
    turns = chance.choice((400.0, 540.0, 720.0))
    return _Plan(height, mission, speed, failure, failed_at, rotor, share, turns)


class _Flight:
    def __init__(
        self, seed: int, frame: str, vehicle: FailingMultirotor, plan: _Plan, wind: Wind
    ) -> None:
        self._seed, self._frame, self._vehicle, self._plan = seed, frame, vehicle, plan
        self._wind = wind
        self._state = vehicle.at_rest(plan.height)
        self._gained = np.zeros(3)
        self._target = np.array([0.0, 0.0, plan.height])
        self._recorder = Recorder()

    def tape(self) -> Tape:
        plan, recorder, vehicle = self._plan, self._recorder, self._vehicle
        fails = plan.failure != "nothing"
        # The wind is there before the record: its controller has settled in it.
        passed, settled = -4.0, 0
        end = plan.failed_at + (_FALLS if fails else _FOLLOWED)
        control: dict[str, Any] = {}
        while passed < end and not recorder.is_down:
            failed = fails and passed >= plan.failed_at
            if failed:
                self._fail()
            if not (failed and plan.failure == "the controller stops" and control):
                control = self._control(passed)
            if passed >= 0.0 and round(passed / _DT) % round(STEP / _DT) == 0:
                recorder.add(self._row(control))
            self._state["wind"] = self._wind.at(float(self._state["x"][2]))
            self._state = vehicle.step(self._state, control, _DT)
            if not np.isfinite(self._state["x"]).all() or np.linalg.norm(self._state["w"]) > 400.0:
                raise UnflyableError("it turns faster than the integrator follows")
            settled += 1
            passed = settled * _DT - 4.0
        drag = vehicle.drag_matrix[2, 2]
        return recorder.tape(
            f"multirotor {self._seed}",
            BODY,
            "multirotor",
            plan.failure,
            plan.failed_at if fails else math.nan,
            fall_speed=round(math.sqrt(vehicle.mass * vehicle.g / drag), 1),
            parameters={
                "frame": self._frame,
                "mission": plan.mission,
                "speed": plan.speed,
                "wind": self._wind.told,
                **({"share of thrust left": plan.share} if fails else {}),
                **({"rotor": plan.rotor} if plan.failure.startswith("a rotor") else {}),
            },
        )

    def _fail(self) -> None:
        plan, shares = self._plan, self._vehicle.shares
        if plan.failure.startswith("a rotor"):
            shares[plan.rotor] = plan.share
        elif plan.failure != "the controller stops":
            shares[:] = plan.share

    # -- what it is told to do -------------------------------------------------------------------

    def _control(self, passed: float) -> dict[str, Any]:
        """What RotorPy's attitude controller takes, and what an autopilot would tell of it."""
        plan, state, mass = self._plan, self._state, self._vehicle.mass
        if plan.mission == "flip" and (flip := self._flip(passed)) is not None:
            return flip
        wanted = self._wanted_velocity(passed)
        error = wanted - state["v"]
        most = self._vehicle.most_thrust
        # No integral once the thrust is used up, as autopilots have it.
        if mass * GRAVITY < 0.95 * most:
            self._gained += error * _DT * np.array([0.3, 0.3, _UP_I])
            self._gained = np.clip(self._gained, -4.0, 4.0)
        along = _ALONG_P * error[:2] + self._gained[:2] + self._lean(passed)
        up = max(-0.7 * GRAVITY, _UP_P * error[2] + self._gained[2]) + GRAVITY
        leans = float(np.linalg.norm(along))
        if leans > up * math.tan(_MOST_TILT):
            along *= up * math.tan(_MOST_TILT) / leans
        axis = np.array([*along, up])
        turned = _turned(axis / np.linalg.norm(axis))
        upright = Rotation.from_quat(state["q"]).as_matrix()[:, 2]
        thrust = min(most, max(0.1 * mass * GRAVITY, mass * up / max(0.5, upright[2])))
        return {
            "cmd_thrust": thrust,
            "cmd_q": turned,
            "height": float(self._target[2]),
            "speed": float(wanted[2]),
        }

    def _wanted_velocity(self, passed: float) -> Any:
        plan, target = self._plan, self._target
        flown = passed - _HOVERS
        along, up = 0.0, 0.0
        if flown > 0.0:
            if plan.mission in ("climb", "descent"):
                up = plan.speed if plan.mission == "climb" else -plan.speed
                if up < 0.0 and target[2] < 10.0:
                    up = 0.0
            elif plan.mission in ("cruise", "hard turn"):
                along = plan.speed
            elif plan.mission == "braking":
                along = plan.speed if passed < plan.failed_at - 0.7 else 0.0
            elif plan.mission == "steps":
                higher = flown % 6.0 < 3.0
                target[2] = plan.height + (plan.speed if higher else 0.0)
        target[2] += up * _DT
        wanted = np.zeros(3)
        if along:
            heading = self._turned_by(flown)
            wanted[:2] = along * math.cos(heading), along * math.sin(heading)
            target[:2] = self._state["x"][:2]
        elif plan.mission == "braking":
            target[:2] = self._state["x"][:2]
        else:
            wanted[:2] = np.clip(_PLACE_P * (target[:2] - self._state["x"][:2]), -5.0, 5.0)
        wanted[2] = max(-6.0, min(8.0, up + _HEIGHT_P * (target[2] - self._state["x"][2])))
        return wanted

    def _turned_by(self, flown: float) -> float:
        """Its heading, rad, in a turn with 6 m/s^2 once it has gained speed."""
        if self._plan.mission != "hard turn":
            return 0.0
        return max(0.0, flown - 2.0) * 6.0 / self._plan.speed

    def _lean(self, passed: float) -> Any:
        """To the middle of its turn, m/s^2."""
        flown = passed - _HOVERS
        if self._plan.mission != "hard turn" or flown < 2.0:
            return np.zeros(2)
        heading = self._turned_by(flown)
        return 6.0 * np.array([-math.sin(heading), math.cos(heading)])

    def _flip(self, passed: float) -> dict[str, Any] | None:
        """A hop, a whole turn with little thrust, then it catches itself; None: not now."""
        hop, turn = 0.45, 360.0 / self._plan.turns
        flown = passed - _HOVERS - 0.5
        if not 0.0 <= flown < hop + turn:
            return None
        weight = self._vehicle.mass * GRAVITY
        told = {"height": float(self._target[2]), "speed": 0.0}
        if flown < hop:
            return {"cmd_thrust": 1.8 * weight, "cmd_q": np.array([0.0, 0.0, 0.0, 1.0]), **told}
        angle, rate = (
            math.radians(self._plan.turns * (flown - hop)),
            math.radians(self._plan.turns),
        )
        # RotorPy's controller knows no commanded rate and damps the turn: it is led by as much.
        lead = rate * self._vehicle.kd_att / self._vehicle.kp_att
        return {
            "cmd_thrust": 0.25 * weight,
            "cmd_q": _rolled(angle + lead),
            "told_q": _rolled(angle),
            **told,
        }

    # -- what it does ----------------------------------------------------------------------------

    def _row(self, control: dict[str, Any]) -> Row:
        state = self._state
        own, told = angles(state["q"]), angles(control.get("told_q", control["cmd_q"]))
        return Row(
            float(state["x"][2]),
            float(state["v"][2]),
            *own,
            self._vehicle.force(state),
            float(math.hypot(state["v"][0], state["v"][1])),
            *told,
            control["height"],
            control["speed"],
            control["cmd_thrust"] / self._vehicle.most_thrust,
        )


def _rolled(angle: float) -> Any:
    """The attitude with this roll, rad."""
    return np.array([math.sin(angle / 2.0), 0.0, 0.0, math.cos(angle / 2.0)])


def _turned(axis: Any) -> Any:
    """The attitude with this upward axis that looks along x, as RotorPy's quaternion."""
    left = np.cross(axis, [1.0, 0.0, 0.0])
    left /= np.linalg.norm(left)
    return Rotation.from_matrix(np.stack([np.cross(left, axis), left, axis]).T).as_quat()
