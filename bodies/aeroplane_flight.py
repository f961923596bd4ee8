"""One flight of an aeroplane in JSBSim: mission, wind and failure, all drawn from a seed."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

from bodies.recorder import Recorder, Row
from bodies.wings import BODY, DT, KINDS, Aeroplane, Command, Controller, Kind
from chute_ros.sim.tape import STEP, Tape

#: It settles before the record, flies on before its mission, and is recorded at most so long after
#: its failure, or if nothing fails, s.
_SETTLES, _LEVEL, _FALLS, _FOLLOWED = 25.0, 1.0, 60.0, 12.0

#: Sink of a glide and of a dive with 20 degrees, in parts of the cruise.
_GLIDES, _DIVES = 0.12, 0.4

MISSIONS = {"cruise": 3, "climb": 2, "descent": 2, "hard turn": 2, "dive": 1, "slow flight": 1}
FAILURES = {
    "nothing": 6,
    "engine off, it glides": 4,
    "engine off, its height is still commanded": 3,
    "stall held": 4,
    "spin": 4,
    "spiral dive": 4,
    "elevator hard over, up": 3,
    "elevator hard over, down": 3,
    "the controller stops": 3,
}


@dataclass(frozen=True)
class _Plan:
    """side: 1 or -1: to which it turns, spins or spirals; aileron: of a spiral dive."""

    height: float
    mission: str
    failure: str
    failed_at: float
    side: int
    aileron: float
    bank: float


def fly(seed: int) -> Tape:
    """The same for the same seed. UnflyableError: the physics did not stand it."""
    chance = random.Random(f"{seed} aeroplane")
    kind = chance.choice(KINDS)
    failures = {
        name: often
        for name, often in FAILURES.items()
        if kind.motor or not name.startswith("engine")
    }
    failure = chance.choices(list(failures), list(failures.values()))[0]
    missions = dict(MISSIONS)
    if failure.startswith("engine"):
        # It is not failed in a dive, which it could fly on as it was told.
        del missions["dive"]
    low, high = chance.uniform(40.0, 120.0), chance.uniform(120.0, 400.0)
    plan = _Plan(
        height=round(chance.choice((low, high)), 1),
        mission=chance.choices(list(missions), list(missions.values()))[0],
        failure=failure,
        failed_at=round(_LEVEL + chance.uniform(0.5, 5.0), 1),
        side=chance.choice((-1, 1)),
        aileron=round(chance.uniform(0.05, 0.3), 2),
        bank=math.radians(chance.uniform(35.0, 60.0)),
    )
    plane = Aeroplane(kind, plan.height, chance.randrange(2**31))
    wind = chance.choice((0.0, chance.uniform(1.0, 6.0), chance.uniform(6.0, 12.0)))
    wind *= min(1.0, kind.cruise / 30.0)
    heading, turbulence = chance.uniform(0.0, math.tau), chance.choice((0.0, wind))
    plane.blow(wind * math.cos(heading), wind * math.sin(heading), turbulence)
    told = f"{wind:.1f} m/s{', turbulence' if turbulence else ''}"
    return _Flight(seed, kind, plan, plane, told).tape()


class _Flight:
    def __init__(self, seed: int, kind: Kind, plan: _Plan, plane: Aeroplane, wind: str) -> None:
        self._seed, self._kind, self._plan, self._plane = seed, kind, plan, plane
        self._wind = wind
        self._controller = Controller(plane)
        self._command = Command(0.0, plan.height, kind.cruise, not kind.motor)
        self._recorder = Recorder()
        self._told_height = plan.height

    def tape(self) -> Tape:
        plan, plane, recorder = self._plan, self._plane, self._recorder
        for _ in range(round(_SETTLES / DT)):
            plane.step(self._controller.controls(self._command))
            if not self._kind.motor:
                # What only glides begins its record where it was drawn.
                plane.lift_to(plan.height)
        mass = plane.mass
        fails = plan.failure != "nothing"
        end = plan.failed_at + (_FALLS if fails else _FOLLOWED)
        passed, steps, told = 0.0, 0, self._told(0.0)
        frozen: dict[str, float] = {}
        while passed < end and not recorder.is_down:
            self._fly_mission(passed)
            failed = fails and passed >= plan.failed_at
            stopped = failed and plan.failure == "the controller stops"
            controls = frozen if stopped and frozen else self._controller.controls(self._command)
            if failed and not stopped:
                controls = self._failing(controls)
            frozen = controls
            if steps % round(STEP / DT) == 0:
                if not stopped:
                    told = self._told(controls["throttle"])
                recorder.add(self._row(told))
            plane.step(controls)
            steps += 1
            passed = steps * DT
        return recorder.tape(
            f"aeroplane {self._seed}",
            BODY,
            "fixed_wing",
            plan.failure,
            plan.failed_at if fails else math.nan,
            parameters={
                "aircraft": f"{self._kind.model}, {mass:.0f} kg",
                "mission": plan.mission,
                "wind": self._wind,
                **({"aileron": plan.side * plan.aileron} if plan.failure == "spiral dive" else {}),
            },
        )

    def _fly_mission(self, passed: float) -> None:
        plan, command, flown = self._plan, self._command, passed - _LEVEL
        if flown < 0.0:
            return
        if plan.mission == "climb":
            command.height = plan.height + 100.0
        elif plan.mission == "descent":
            command.height = max(20.0, plan.height - 100.0)
        elif plan.mission == "hard turn":
            command.roll = plan.side * plan.bank
        elif plan.mission == "slow flight":
            command.speed = 0.75 * self._kind.cruise
        elif plan.mission == "dive":
            # Until there is no room for the pull-out.
            low = self._plane.height < 45.0 + self._kind.cruise
            self._controller.dives = None if low or flown > 4.0 else math.radians(-20.0)
        if plan.failure == "engine off, it glides" and passed >= plan.failed_at:
            # Somebody flies it down to the ground: no more missions.
            command.glides, command.roll, self._controller.dives = True, 0.0, None
            command.speed = 0.72 * self._kind.cruise

    def _failing(self, controls: dict[str, float]) -> dict[str, float]:
        plan = self._plan
        if plan.failure.startswith("engine off"):
            self._plane.stop_engine()
            return {**controls, "throttle": 0.0}
        if plan.failure == "stall held":
            return {**controls, "throttle": 0.0, "elevator": 1.0, "aileron": 0.0}
        if plan.failure == "spin":
            stick = {"elevator": 1.0, "rudder": float(plan.side), "aileron": 0.0}
            return {**controls, **stick, "throttle": 0.0}
        if plan.failure == "spiral dive":
            return {**controls, "aileron": plan.side * plan.aileron}
        return {**controls, "elevator": 1.0 if plan.failure.endswith("up") else -1.0}

    def _told(self, throttle: float) -> dict[str, float]:
        _, _, yaw = self._plane.angles
        controller, kind = self._controller, self._kind
        speed, height = controller.vertical_speed, self._command.height
        if self._command.glides or controller.dives is not None:
            # Where no height is held, a sink as of the glide or the dive is as it was told, and no
            # faster one.
            fastest = (_GLIDES if self._command.glides else _DIVES) * kind.cruise
            speed = max(self._plane.vertical_speed, -fastest)
            height = max(self._plane.height, self._told_height - fastest * STEP)
        self._told_height = height
        return {
            "commanded_roll": controller.roll,
            "commanded_pitch": controller.pitch,
            # Autopilots of aeroplanes command no heading of the nose: it is where it is.
            "commanded_yaw": yaw,
            "commanded_height": height,
            "commanded_vertical_speed": speed,
            "commanded_thrust": throttle,
        }

    def _row(self, told: dict[str, float]) -> Row:
        plane = self._plane
        return Row(
            plane.height,
            plane.vertical_speed,
            *plane.angles,
            plane.force,
            plane.ground_speed,
            **told,
        )
