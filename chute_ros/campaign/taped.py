"""A body that flies its tape until our side acts: then the small model takes over from there."""

from __future__ import annotations

import math
import random
from array import array
from dataclasses import dataclass, field
from typing import Any

from chute_ros.campaign.sensors import Sensors
from chute_ros.campaign.truth import SOFT, Truth, touchdown_speed
from chute_ros.campaign.vehicle import CampaignAutopilot, WindyModel
from chute_ros.protocol.rotation import quaternion_of, tilt_of
from chute_ros.sim.flight import GRAVITY, FlightModel
from chute_ros.sim.tape import STEP, Tape

#: The latest release is looked for in rows that are so far apart, then in each.
_STRIDE = 10
#: What lands softly by itself has so much time, s (truth.py: Truth.lands_softly).
_NO_HURRY = 60.0


@dataclass
class TapedModel(WindyModel):
    """tape: of what it does from begin() on. Stopped motors or a parachute that is out end that,
    as nobody recorded those: it falls on from the same height, speed and tilt."""

    tape: Tape | None = None
    pitch: float = 0.0
    yaw: float = 0.0
    ground_speed: float = 0.0
    #: Row that it is at; -1: the tape does not play.
    row: int = -1
    _columns: dict[str, array[float]] = field(default_factory=dict)

    def begin(self) -> None:
        """The tape plays."""
        if self.tape is not None and self.armed and math.isnan(self.released_for):
            self._columns = self.tape.unpack()
            self.row = 0
            self._be_there()

    @property
    def plays(self) -> bool:
        """What it does is what was recorded."""
        return self.row >= 0

    @property
    def lean(self) -> float:
        return math.copysign(tilt_of(self.roll, self.pitch), self.roll)

    def step(self, dt: float) -> None:
        """Move on: the tape has a row for each step of the physics."""
        if self.plays and self.armed and math.isnan(self.released_for):
            self.row += 1
            self._be_there()
            return
        if self.plays:
            self._leave()
        super().step(dt)

    def commanded(self, what: str) -> float:
        """By the controller on the tape, as the column commanded_...; only while it plays."""
        return self._columns[f"commanded_{what}"][self.row]

    def _be_there(self) -> None:
        at = {name: values[self.row] for name, values in self._columns.items()}
        self.height, self.vertical_speed = at["height"], at["vertical_speed"]
        self.roll, self.pitch, self.yaw = at["roll"], at["pitch"], at["yaw"]
        self.acceleration, self.ground_speed = at["force"], at["ground_speed"]
        if self.on_ground or self.row == len(self._columns["height"]) - 1:
            self._leave()
            self.target_height = max(self.ground, self.height)

    def _leave(self) -> None:
        self.roll, self.pitch, self.ground_speed, self.row = self.lean, 0.0, 0.0, -1


def truth_of(model: TapedModel, begun: float) -> Truth:
    """Of a tape that ends out of control and began then, virtual s: since when, and the last
    release after which the small model's canopy still lands what the tape had become."""
    tape = model.tape
    assert tape is not None
    columns, first = tape.unpack(), round(tape.label.lost_at / STEP)
    at, height = begun + first * STEP, columns["height"][first]
    if not tape.label.ends_hard:
        return Truth(at, at + _NO_HURRY, height)

    def is_soft(row: int) -> bool:
        if columns["height"][row] <= 0.0:
            return False
        roll, pitch = columns["roll"][row], columns["pitch"][row]
        body = FlightModel(
            fall_speed=model.fall_speed,
            canopy_speed=model.canopy_speed,
            canopy_opening_time=model.canopy_opening_time,
            height=columns["height"][row],
            vertical_speed=columns["vertical_speed"][row],
            roll=tilt_of(roll, pitch),
            unheld=model.unheld,
        )
        return touchdown_speed(body, 0.0) <= SOFT

    # From the ground up: on a tape the height may rise again.
    for low in range(tape.rows - 1, first - _STRIDE, -_STRIDE):
        if is_soft(max(low, first)):
            high = min(tape.rows, low + _STRIDE)
            latest = max(row for row in range(max(low, first), high) if is_soft(row))
            return Truth(at, begun + latest * STEP, height)
    return Truth(at, math.nan, height)


class RealSensors(Sensors):
    """Those of an autopilot on a body that shakes and that the air flows around, before what is
    drawn to be wrong with them: the errors are ours, of the size that logs show."""

    def __init__(self, chance: random.Random, model: TapedModel) -> None:
        super().__init__(chance)
        self._model, self._errors = model, random.Random(chance.random())
        errors = self._errors
        self._force_bias = errors.gauss(0.0, 0.2)
        #: Of an accelerometer on running motors, m/s^2; of dynamic pressure at a static port.
        self._vibration, self._port = errors.uniform(0.2, 1.5), errors.uniform(-0.12, 0.12)
        #: An estimator's vertical speed follows within this, s.
        self._lag = errors.uniform(0.03, 0.2)
        self._speed, self._speed_at = 0.0, math.nan
        self._wander: dict[str, tuple[float, float]] = {}

    def read(self, sensor: str, value: float, now: float) -> float:
        model = self._model
        if sensor == "force":
            value += self._force_bias
            if model.armed and not model.on_ground:
                value = abs(value + self._errors.gauss(0.0, self._vibration))
        elif sensor == "speed":
            value = self._followed(value, now) + self._wandering(sensor, 0.15, now)
        elif sensor == "tilt":
            value += self._wandering(sensor, math.radians(1.5), now)
        elif sensor in ("pressure", "height"):
            flow = math.hypot(model.ground_speed, model.vertical_speed)
            felt = self._port * flow**2 / (2.0 * GRAVITY)
            # An estimator makes its height of the pressure and of the satellites.
            share = 1.0 if sensor == "pressure" else 0.5
            value += share * felt + self._wandering(sensor, 0.4, now)
        return super().read(sensor, value, now)

    def _followed(self, value: float, now: float) -> float:
        passed = now - self._speed_at
        if not passed < 1.0:
            self._speed = value
        elif passed > 0.0:
            self._speed += (value - self._speed) * (1.0 - math.exp(-passed / self._lag))
        self._speed_at = now
        return self._speed

    def _wandering(self, sensor: str, strength: float, now: float) -> float:
        """An error that changes within 5 s."""
        before, at = self._wander.get(sensor, (self._errors.gauss(0.0, strength), now))
        kept = math.exp((at - now) / 5.0)
        spread = strength * math.sqrt(1.0 - kept**2)
        error = before * kept + self._errors.gauss(0.0, spread)
        self._wander[sensor] = error, now
        return error


class TapedAutopilot(CampaignAutopilot):
    """Tells the attitude and the commands of the tape while it plays."""

    model: TapedModel

    def _attitude(self) -> Any:
        message: Any = super()._attitude()
        message.pitch, message.yaw = self.model.pitch, self.model.yaw
        return message

    def _attitude_target(self) -> Any:
        model = self.model
        if not model.plays:
            return super()._attitude_target()
        angles = (model.commanded(one) for one in ("roll", "pitch", "yaw"))
        message: Any = super()._attitude_target()
        message.q, message.thrust = list(quaternion_of(*angles)), model.commanded("thrust")
        return message

    def _position_target(self) -> Any:
        message: Any = super()._position_target()
        if self.model.plays:
            message.vz = -self.model.commanded("vertical_speed")
        return message

    def _nav_controller_output(self) -> Any:
        message: Any = super()._nav_controller_output()
        if self.model.plays:
            message.nav_pitch = math.degrees(self.model.commanded("pitch"))
        return message

    def _commanded_roll(self) -> float:
        return self.model.commanded("roll") if self.model.plays else super()._commanded_roll()

    def _commanded_height(self) -> float:
        return self.model.commanded("height") if self.model.plays else super()._commanded_height()
