"""The aircraft of a campaign: the simulator's flight model in wind, with sensors that may lie."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from chute_ros.campaign.estimator import Estimator
from chute_ros.campaign.manoeuvre import Manoeuvre, ManoeuvreMotion
from chute_ros.campaign.sensors import Sensors
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.sim.autopilot_device import STEP, AutopilotDevice
from chute_ros.sim.autopilot_kinds import AutopilotKind, Termination
from chute_ros.sim.flight import GRAVITY
from chute_ros.sim.gusts import GustyModel

#: A skid or a wheel throws it up with so much of the speed of its touch-down.
_BOUNCES = 0.3
#: What has touched down is flown to below the ground, m: it does not hover above it.
_LET_DOWN = 1.0
#: A deck moves up and down once in this, s; degrees by which each m of that leans it at most.
_SWELL, _LEANS = 7.0, 5.0
#: It is carried up to where the flight begins, by more than any vehicle climbs, and by less than a
#: height jumps, m/s.
_LIFT = 80.0


@dataclass
class WindyModel(GustyModel):
    """In gusts, and it may fly a manoeuvre, in which they do not push it."""

    #: What it flies now, and since when, s.
    manoeuvre: Manoeuvre | None = None
    flown_for: float = 0.0
    #: Of the ground on which it stands, rad.
    slope: float = 0.0

    @property
    def lean(self) -> float:
        """From upright, as if it rolled, rad."""
        return self.roll

    def step(self, dt: float) -> None:
        """Move on."""
        flown = self._manoeuvre(dt)
        if flown is not None:
            self.vertical_speed, self.roll, self.acceleration = flown
            self.height += self.vertical_speed * dt
            self.target_height = self.height
            if self.on_ground:
                self._touch_down(-self.vertical_speed, dt)
            return
        super().step(dt)

    def _touch_down(self, sink: float, dt: float) -> None:
        """It bounces off, is let down, and stands."""
        self.height, self.target_height = self.ground, self.ground - _LET_DOWN
        self.vertical_speed = _BOUNCES * sink
        self.acceleration = GRAVITY + (1.0 + _BOUNCES) * sink / dt

    def _turn(self, dt: float) -> None:
        super()._turn(dt)
        if self.on_ground:
            self.roll = self.slope

    def _manoeuvre(self, dt: float) -> ManoeuvreMotion | None:
        """What it is told to fly; whoever is out of control does not."""
        if self.manoeuvre is None or not self.controlled:
            self.manoeuvre = None
            return None
        flown = self.manoeuvre.at(self.flown_for)
        self.flown_for += dt
        if flown is None:
            self.manoeuvre = None
        return flown


def lift_time(height: float) -> float:
    """How long it is carried up to this height, s."""
    return math.ceil(height / (_LIFT * STEP)) * STEP


class Physics:
    """Moves the vehicle on, whoever hangs or has no power. deck: what it takes off from moves up
    and down by so much, m; moved: called after each step."""

    def __init__(self, model: WindyModel, deck: float, moved: Callable[[float], None]) -> None:
        self.model, self._deck, self._moved = model, deck, moved
        #: Under it once it is up, m above its take-off.
        self.ground = 0.0
        self._at = STEP
        #: It is being carried to its height, and was.
        self.lifts = self._is_off = False

    def update(self, now: float) -> None:
        """One step."""
        self._at += STEP
        model = self.model
        if self.lifts:
            self._is_off = True
            model.height = min(model.target_height, model.height + _LIFT * STEP)
            model.vertical_speed = 0.0
            self.lifts = model.height < model.target_height
            if not self.lifts:
                model.ground = self.ground
        else:
            model.step(STEP)
            if self._deck and not self._is_off:
                self._heave(now)
        self._moved(now)

    def _heave(self, now: float) -> None:
        model, turns = self.model, 2.0 * math.pi / _SWELL
        up, speed = math.sin(turns * now), turns * math.cos(turns * now)
        model.height = model.ground = self._deck * up
        model.vertical_speed = self._deck * speed
        model.acceleration = GRAVITY - self._deck * turns**2 * up
        model.roll = math.radians(_LEANS * self._deck) * up

    def next_deadline(self) -> float:
        """Of the next step."""
        return self._at


class CampaignAutopilot(AutopilotDevice):
    """Tells what its estimator and its sensors say; the physics move the vehicle."""

    def __init__(self, model: WindyModel, sensors: Sensors, kind: AutopilotKind) -> None:
        super().__init__(1, [], model, kind)
        self._sensors = sensors
        self.estimator = Estimator()
        self._told = 0.0
        #: When it ordered the release of a parachute itself, as it terminated the flight.
        self.released_at = math.nan

    def _fly(self, now: float) -> None:
        """The physics do."""

    def next_step(self) -> float:
        return min([when for when, _ in self._later], default=math.inf)

    def _global_position_int(self) -> Any:
        message: Any = super()._global_position_int()
        picture = self.estimator.picture(self.model, self.now)
        height = self._told = self._sensors.read("height", picture.height, self.now)
        speed = self._sensors.read("speed", picture.vertical_speed, self.now)
        message.relative_alt = int((height - self.home.offset) * 1000.0)
        message.alt = int((height + self.home.altitude) * 1000.0)
        message.vz = int(speed * -100.0)
        return message

    def _height_error(self) -> float:
        return self.model.height - self._told

    def _controlled_height(self) -> float:
        # A sensor's fault is one of the telling.
        return self.estimator.picture(self.model, self.now).height

    def _pressure_height(self) -> float:
        return self._sensors.read("pressure", self.model.height, self.now)

    def _attitude(self) -> Any:
        message: Any = super()._attitude()
        roll = self.estimator.picture(self.model, self.now).roll
        message.roll = self._sensors.read("tilt", roll, self.now)
        return message

    def _scaled_imu(self) -> Any:
        message: Any = super()._scaled_imu()
        force = self._sensors.read("force", self.model.acceleration, self.now)
        message.zacc = -min(int(abs(force) / GRAVITY * 1000.0), 32767)
        return message

    def _extended_sys_state(self) -> Any:
        message: Any = super()._extended_sys_state()
        landed, flying = dialect.MAV_LANDED_STATE_ON_GROUND, dialect.MAV_LANDED_STATE_IN_AIR
        message.landed_state = landed if self._landed else flying
        return message

    @property
    def _landed(self) -> bool:
        """By its land detector."""
        if self._sensors.lies("landed", self.now):
            return True
        return not self._takes_itself_to_fly and not self.estimator.tells_of_flight(self.now)

    def _heartbeat(self) -> Any:
        message: Any = super()._heartbeat()
        if self._sensors.lies("disarmed", self.now):
            message.base_mode = 0
        return message

    def disarm(self) -> None:
        """As its pilot does after a landing."""
        self._set_armed(False)

    def _end_flight(self) -> None:
        super()._end_flight()
        if self.kind.termination is Termination.RELEASES:
            self.released_at = self.now
