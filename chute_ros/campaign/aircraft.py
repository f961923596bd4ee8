"""A multirotor or aeroplane with its autopilot on MAVLink, its parachute on either bus or on both,
and some with an IMU or odometry besides."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from chute_ros.campaign.bus import MAVLINK, Bus, Plug
from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.rig import Rig
from chute_ros.campaign.scenario import Failure, Fault, HomeMove, Scenario
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.taped import RealSensors, TapedAutopilot, TapedModel, truth_of
from chute_ros.campaign.truth import SOFT, Truth, observe
from chute_ros.campaign.vehicle import CampaignAutopilot, Physics, WindyModel
from chute_ros.model import Action
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.sim.autopilot_kinds import KINDS, AutopilotKind
from chute_ros.sim.flight import GRAVITY, FlightModel
from chute_ros.sim.home import Home
from chute_ros.sim.motion import Motion

#: How long the autopilot that hangs does, s.
_HANGS = 6.0
#: From its arming until it leaves the ground, s: PX4 spools up for 1 s (COM_SPOOLUP_TIME) and
#: then ramps up its thrust, ArduCopter waits for 2 s.
_SPOOLS_UP = 2.0
#: From a touch-down until its pilot disarms it, s.
_DISARMED_AFTER = 2.0
#: How high a flight before the one that is told of goes, m.
_HOP = 8.0
_FAILED_MOTORS = (Failure.MOTOR, Failure.SINK, Failure.GLIDE, Failure.STALL)
#: So near to where it took off the ground may be, for all that anybody knows, m.
_NEAR = 10.0
#: So long after its release a canopy carries; faster than this it does not, s and m/s.
_CARRIES_AFTER, _NOT_CARRIED = 2.0, 1.5 * SOFT
#: All that the simulators react to, as a frame has its number.
_HEARD = tuple(
    number.to_bytes(3, "little")
    for number in (
        dialect.MAVLINK_MSG_ID_PARAM_REQUEST_READ,
        dialect.MAVLINK_MSG_ID_PARAM_SET,
        dialect.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        dialect.MAVLINK_MSG_ID_COMMAND_INT,
        dialect.MAVLINK_MSG_ID_COMMAND_LONG,
        dialect.MAVLINK_MSG_ID_TIMESYNC,
    )
)


def is_for_devices(data: bytes) -> bool:
    """A MAVLink 2 frame of a kind to which a simulator reacts, or a damaged one."""
    return data[7:10] in _HEARD or data[0] != 0xFD


def _kind_of(scenario: Scenario) -> AutopilotKind:
    """Whose autopilot it is; the same one flies multirotors and aeroplanes."""
    kind = KINDS[scenario.autopilot.kind]
    if scenario.profile == "fixed_wing" and kind.vehicle_type == dialect.MAV_TYPE_QUADROTOR:
        return replace(kind, vehicle_type=dialect.MAV_TYPE_FIXED_WING, vtol_state=0)
    return kind


class Aircraft(Rig):
    """Its autopilot is on MAVLink, its parachutes wherever its links are."""

    def __init__(self, scenario: Scenario, shipped: Shipped) -> None:
        super().__init__(scenario, shipped)
        air: dict[str, Any] = {"gusts": scenario.gusts, "chance": self.chance("wind")}
        taped = scenario.tape
        if taped is None:
            self.model = WindyModel(fall_speed=scenario.fall_speed, **air)
        else:
            tape = shipped.tape(taped.name)
            self.model = TapedModel(fall_speed=scenario.fall_speed, tape=tape, **air)
            self.sensors = self.sensors_of[""] = RealSensors(self.chance("sensors"), self.model)
        self.model.descent, self.model.unheld = scenario.descent, scenario.unheld
        self.model.canopy_speed = scenario.canopy.speed
        self.model.canopy_opening_time = scenario.canopy.opens
        #: Devices that feel how it moves.
        self.feeling: list[Callable[[Motion], None]] = []
        self.network = Bus(self.world, MAVLINK, f"{scenario.seed} mavlink")
        traits = scenario.autopilot
        self.autopilot = self.make_autopilot(_kind_of(scenario))
        self.autopilot.home = Home(drift=traits.home_drift, homing=traits.homing)
        if traits.imus > 1:
            self.autopilot.add_second_imu()
        plug = Plug(self.network, "autopilot", self.autopilot, is_for_devices)
        self.add_device(plug, self.autopilot.reboot)
        self.join_links()
        self.physics = Physics(self.model, scenario.deck, self._moved)
        self.world.add(self.physics)
        for source in scenario.second_sources:
            self.add_source(source, self.model)
        #: From its arming until it leaves the ground, s.
        self.spools_up = _SPOOLS_UP
        self._speed = 0.0
        self._left = self._flew = False
        self._flights_before = scenario.flights - 1
        self._first_out = ""

    def make_autopilot(self, kind: AutopilotKind) -> CampaignAutopilot:
        """The one that flies it."""
        if isinstance(self.model, TapedModel):
            return TapedAutopilot(self.model, self.sensors, kind)
        return CampaignAutopilot(self.model, self.sensors, kind)

    # -- the flight ------------------------------------------------------------------------------

    def take_off(self, now: float) -> None:
        self.autopilot.act("arm")
        self.world.stir(self.plugs["autopilot"])
        self.world.post(now + self.spools_up, self._leave)

    def _leave(self, now: float) -> None:
        scenario, first = self.scenario, self._flights_before > 0
        self.autopilot.act(f"takeoff={_HOP if first else scenario.height}")
        self.physics.ground = 0.0 if first else scenario.ground
        self.physics.lifts = self._left = True

    def lands_first(self) -> bool:
        if not self._flights_before:
            return False
        self._flights_before -= 1
        self._left = False
        self.autopilot.act("land")
        return True

    def _stand(self, now: float) -> None:
        self.autopilot.disarm()
        self.world.stir(self.plugs["autopilot"])
        if not self._left:  # and it flies again
            self._flew, self.landed = False, math.nan

    def is_up(self) -> bool:
        return self._left and (self._flew or self.scenario.stands) and not self.physics.lifts

    def plan(self, up: float) -> None:
        super().plan(up)
        manoeuvre = self.scenario.manoeuvre
        if manoeuvre is not None:
            self.world.post(up + manoeuvre.begin, self._begin_manoeuvre)
        taped, model = self.scenario.tape, self.model
        if taped is not None and isinstance(model, TapedModel):
            self.world.post(up, lambda _: model.begin())
            if taped.is_lost:
                truth = truth_of(model, up)
                self.world.post(truth.at, lambda _: self._lose(truth))

    def _lose(self, truth: Truth) -> None:
        """As on its tape, unless our side acted before: then it is observed."""
        if not self.truth.falls and math.isnan(self.released):
            self.truth = truth

    def _begin_manoeuvre(self, now: float) -> None:
        manoeuvre = self.model.manoeuvre = self.scenario.manoeuvre
        self.model.flown_for = 0.0
        self.model.slope = math.radians(manoeuvre.slope) if manoeuvre else 0.0

    def plan_one(self, fault: Fault, up: float) -> None:
        super().plan_one(fault, up)
        if isinstance(fault, EstimatorFault):
            self.autopilot.estimator.faults.append(fault.later(up))
        elif isinstance(fault, HomeMove):
            self.world.post(up + fault.at, lambda _: self.autopilot.home.move(fault.by))

    def fail(self, now: float) -> None:
        failure, plug = self.scenario.failure, self.plugs["autopilot"]
        if failure in _FAILED_MOTORS:
            self.autopilot.act("fail-motor")
        elif failure is Failure.REBOOT:
            self.autopilot.reboot()
        elif failure is Failure.POWER:
            self.model.motors_failed = True
            plug.dead_until = math.inf
        elif failure is Failure.HANG:
            plug.dead_until = now + _HANGS

    def _moved(self, now: float) -> None:
        model = self.model
        if self.feeling:
            motion = Motion(
                model.height, model.vertical_speed, abs(model.lean), model.acceleration
            )
            for feel in self.feeling:
                feel(motion)
        glides = model.descent is not None and model.descent.sink <= SOFT
        carried = model.armed and (glides or not model.motors_failed)
        if not self._flew:
            self._flew = not model.on_ground
        elif model.on_ground:
            if math.isnan(self.landed):
                self.landed, self.landing_speed = now, self._speed
                if model.armed and not model.motors_failed:
                    self.world.post(now + _DISARMED_AFTER, self._stand)
        elif not carried and not self.truth.falls and math.isnan(self.released):
            self.truth = observe(model, now)
        if self.truth.falls:
            self._check_fall(now)
        due = self.released + _CARRIES_AFTER
        if not self.another.falls and now >= due and -model.vertical_speed > _NOT_CARRIED:
            self.another = observe(model, now)
        self._speed = max(0.0, -model.vertical_speed)

    def _check_fall(self, now: float) -> None:
        model = self.model
        if model.acceleration < GRAVITY / 2.0:
            self.light_until = now
        if abs(model.height) < _NEAR and model.clearance > _NEAR:
            begin = self.unclear[0]
            self.unclear = (now if math.isnan(begin) else begin, now)

    def out(self, whose: str) -> None:
        """A parachute on this link is out."""
        now = self.world.now
        if math.isnan(self.released):
            self.released, self.release_height = now, self.model.height
            self._first_out = whose
            decided = [one.action for host in self.supervisors for _, one in host.decided]
            if self.autopilot.released_at <= now and Action.DEPLOY not in decided:
                self.opened_by_kill = now
            self.model.release()
        elif whose != self._first_out and math.isnan(self.released_another):
            self.released_another = now
            if self.another.falls:
                self.model.release_another(FlightModel.canopy_speed)
