"""The vehicle of a campaign: the simulator's flight model in wind, with sensors that may lie."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.sim.autopilot_device import AutopilotDevice
from chute_ros.sim.flight import FlightModel

#: Gusts change within about this time, s.
_GUST_TIME = 1.0


@dataclass
class WindyModel(FlightModel):
    """gusts: their usual strength, m/s^2 up and down; they tilt the vehicle as well."""

    gusts: float = 0.0
    chance: random.Random = field(default_factory=random.Random)
    _gust: float = 0.0
    _sway: float = 0.0

    def step(self, dt: float) -> None:
        """Move on; the wind pushes whatever is in the air."""
        if self.gusts and not self.on_ground:
            share = dt / _GUST_TIME
            push = self.chance.gauss(0.0, self.gusts * math.sqrt(2.0 * share))
            self._gust += push - self._gust * share
            self.vertical_speed += self._gust * dt
            self._sway = math.radians(3.0) * self._gust
        super().step(dt)

    def _turn(self, dt: float) -> None:
        super()._turn(dt)
        if self.armed and not self.motors_failed and not self.on_ground:
            self.roll = self._sway


@dataclass(frozen=True)
class SensorFault:
    """From begin to end (virtual s) a part of what the autopilot tells is wrong.

    kind: height (drifts), speed (sticks), tilt (noise), force (reads 0), landed (says on ground),
    disarmed (says disarmed).
    """

    kind: str
    begin: float
    end: float


class CampaignAutopilot(AutopilotDevice):
    """Tells what its sensors say."""

    def __init__(self, model: WindyModel, chance: random.Random) -> None:
        super().__init__(1, [], model)
        self._chance = chance
        self.faults: list[SensorFault] = []
        self._stuck: int | None = None

    def _wrong(self, kind: str) -> SensorFault | None:
        for fault in self.faults:
            if fault.kind == kind and fault.begin <= self.now < fault.end:
                return fault
        return None

    def _global_position_int(self) -> object:
        message = super()._global_position_int()
        if drift := self._wrong("height"):
            message.relative_alt += int(3000.0 * (self.now - drift.begin))  # 3 m/s
        if self._wrong("speed"):
            self._stuck = message.vz if self._stuck is None else self._stuck
            message.vz = self._stuck
        else:
            self._stuck = None
        return message

    def _attitude(self) -> object:
        message = super()._attitude()
        if self._wrong("tilt"):
            message.roll = self._chance.uniform(-math.pi, math.pi)
        return message

    def _scaled_imu(self) -> object:
        message = super()._scaled_imu()
        if self._wrong("force"):
            message.xacc = message.yacc = message.zacc = 0
        return message

    def _extended_sys_state(self) -> object:
        message = super()._extended_sys_state()
        if self._wrong("landed"):
            message.landed_state = dialect.MAV_LANDED_STATE_ON_GROUND
        return message

    def _heartbeat(self) -> object:
        message = super()._heartbeat()
        if self._wrong("disarmed"):
            message.base_mode = 0
        return message
