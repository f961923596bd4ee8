"""A multirotor or aeroplane with its autopilot on MAVLink, its parachute on either bus or on both,
and some with an IMU or odometry besides."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from chute_ros.campaign.bus import CAN, MAVLINK, Bus, Plug
from chute_ros.campaign.device_nodes import MAVLINK_NODE, UPF_NODE, MavlinkNode, UpfNode
from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.rig import Rig
from chute_ros.campaign.scenario import Failure, Fault, HomeMove, Scenario, Vehicle
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.truth import SOFT, observe
from chute_ros.campaign.vehicle import CampaignAutopilot, Nature, WindyModel
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.model import Action, DeploymentTrigger
from chute_ros.protocol.dronecan import time_sync
from chute_ros.protocol.dronecan.allocation import MESSAGE as ALLOCATION
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.sim.autopilot_kinds import KINDS, AutopilotKind
from chute_ros.sim.flight import GRAVITY, FlightModel
from chute_ros.sim.home import Home, Homing
from chute_ros.sim.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.sim.upf_aps import Motion
from chute_ros.sim.upf_bus import UpfBus
from chute_ros.sim.upf_controller import ControllerSettings, UpfController
from chute_ros.sim.upf_memory import CONTROLLER_PARAMETERS
from chute_ros.sim.upf_node import NodeSettings
from chute_ros.sim.upf_node import UpfNode as UpfDevice
from chute_ros.sim.upf_trigger import UpfTrigger

#: FC and OFFBOARD.
_ARMED_TRIGGERS = 12
#: How long the autopilot that hangs does, s.
_HANGS = 6.0
#: From its arming until it leaves the ground, s: PX4 spools up for 1 s (COM_SPOOLUP_TIME) and
#: then ramps up its thrust, ArduCopter waits for 2 s.
_SPOOLS_UP = 2.0
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


def _is_for_devices(data: bytes) -> bool:
    """A MAVLink 2 frame of a kind to which a simulator reacts, or a damaged one."""
    return data[7:10] in _HEARD or data[0] != 0xFD


def _heights_are_true(scenario: Scenario) -> bool:
    """Those above home are above the ground; elsewhere a parachute has a sensor of its own."""
    moves = any(isinstance(one, HomeMove) for one in scenario.faults)
    autopilot = scenario.autopilot
    stays = autopilot.homing is Homing.STAYS and not autopilot.home_drift
    return stays and not moves and not scenario.ground


def _kind_of(scenario: Scenario) -> AutopilotKind:
    """Whose autopilot it is; the same one flies multirotors and aeroplanes."""
    kind = KINDS[scenario.autopilot.kind]
    if scenario.profile == "fixed_wing" and kind.vehicle_type == dialect.MAV_TYPE_QUADROTOR:
        return replace(kind, vehicle_type=dialect.MAV_TYPE_FIXED_WING)
    return kind


def _is_for(node: UpfDevice) -> Callable[[bytes], bool]:
    """A service's frame, an anonymous one, or one of a message to which this node reacts."""
    names = (*node.messages, ALLOCATION, time_sync.MESSAGE)
    wanted = frozenset(node.definitions.types.message(name).id for name in names)

    def hears(frame: bytes) -> bool:
        identifier = int.from_bytes(frame[:4], "little")
        is_service, source = identifier & 0x80, identifier & 0x7F
        return bool(is_service) or not source or identifier >> 8 & 0xFFFF in wanted

    return hears


class ReleasedParachute(ParachuteDevice):
    """Its release acts on the vehicle, whoever hears of it. true_height: above ground, m; feels:
    it goes by that, and not by the height that it is told."""

    def __init__(
        self,
        settings: ParachuteSettings,
        out: Callable[[], None],
        true_height: Callable[[], float],
        feels: bool,
    ) -> None:
        super().__init__(settings, [])
        self._out, self._true_height, self._feels = out, true_height, feels
        #: When it first refused a release because the height that it is told is wrong, virtual s.
        self.misled_at = math.nan

    def _height(self) -> float:
        return self._true_height() if self._feels else super()._height()

    def _release(self) -> int:
        result = super()._release()
        refused = result == dialect.MAV_RESULT_TEMPORARILY_REJECTED
        first = refused and math.isnan(self.misled_at)
        if first and self._true_height() >= self.settings.clear_height:
            self.misled_at = self.now
        return result

    def _deploy(self, trigger: DeploymentTrigger) -> None:
        super()._deploy(trigger)
        self._out()


class Aircraft(Rig):
    """MAVLINK, UPF or BOTH."""

    def __init__(self, scenario: Scenario, shipped: Shipped) -> None:
        super().__init__(scenario, shipped)
        self.model = WindyModel(
            fall_speed=scenario.fall_speed, gusts=scenario.gusts, chance=self.chance("wind")
        )
        self.model.descent, self.model.unheld = scenario.descent, scenario.unheld
        self.model.canopy_speed = scenario.canopy.speed
        self.model.canopy_opening_time = scenario.canopy.opens
        self.controller: UpfController | None = None
        self.only_parachute: ReleasedParachute | None = None
        bus = Bus(self.world, MAVLINK, f"{scenario.seed} mavlink")
        traits = scenario.autopilot
        self.autopilot = CampaignAutopilot(self.model, self.sensors, _kind_of(scenario))
        self.autopilot.home = Home(drift=traits.home_drift, homing=traits.homing)
        if traits.imus > 1:
            self.autopilot.add_second_imu()
        plug = Plug(bus, "autopilot", self.autopilot, _is_for_devices)
        self.add_device(plug, self.autopilot.reboot)
        on_mavlink = scenario.vehicle is not Vehicle.UPF
        if on_mavlink:
            settings = ParachuteSettings(armed_triggers=0 if scenario.arms else _ARMED_TRIGGERS)
            parachute = ReleasedParachute(
                settings,
                partial(self._out, MAVLINK_NODE),
                lambda: self.model.clearance,
                feels=not _heights_are_true(scenario),
            )
            self.add_device(Plug(bus, "parachute", parachute, _is_for_devices), parachute.reboot)
            if scenario.vehicle is Vehicle.MAVLINK:
                self.only_parachute = parachute
        self.add_node(MavlinkNode(bus, self.process(MAVLINK_NODE), self.ros, on_mavlink))
        if scenario.vehicle is not Vehicle.MAVLINK:
            self._add_upf()
        self.nature = Nature(self.model, scenario.ground, self._moved)
        self.world.add(self.nature)
        for source in scenario.second_sources:
            self.add_source(source, self.model)
        self._speed = 0.0
        self._left = self._flew = False
        self._light_until = math.nan
        self._first_out = ""
        self._opened_by_kill = math.nan
        self._unclear = (math.nan, math.nan)

    def _add_upf(self) -> None:
        bus = Bus(self.world, CAN, f"{self.scenario.seed} can")
        by_itself = dict.fromkeys((p.AUTO_TAKEOFF, p.AUTO_ARM), not self.scenario.arms)
        values = {**CONTROLLER_PARAMETERS, p.ENABLE_APS: self.scenario.aps, **by_itself}
        node = NodeSettings("upf.controller", values)
        self.controller = UpfController(self.shipped.definitions, ControllerSettings(node))
        trigger = UpfTrigger(self.shipped.definitions, on_fire=partial(self._out, UPF_NODE))
        for name, device in (("controller", self.controller), ("trigger", trigger)):
            plug = Plug(bus, name, UpfBus([device]), _is_for(device))
            self.add_device(plug, device.reboot)
        self.add_node(UpfNode(bus, self.process(UPF_NODE), self.ros, self.shipped.types))

    # -- the flight ------------------------------------------------------------------------------

    def take_off(self, now: float) -> None:
        self.autopilot.act("arm")
        self.world.stir(self.plugs["autopilot"])
        self.world.post(now + _SPOOLS_UP, self._leave)

    def _leave(self, now: float) -> None:
        self.autopilot.act(f"takeoff={self.scenario.height}")
        self.nature.lifts = self._left = True

    def is_up(self) -> bool:
        return self._left and (self._flew or self.scenario.stands) and not self.nature.lifts

    def refused_at(self) -> float:
        return math.nan if self.only_parachute is None else self.only_parachute.misled_at

    def light_until(self) -> float:
        return self._light_until

    def opened_by_kill(self) -> float:
        return self._opened_by_kill

    def unclear(self) -> tuple[float, float]:
        return self._unclear

    def plan(self, up: float) -> None:
        super().plan(up)
        manoeuvre = self.scenario.manoeuvre
        if manoeuvre is not None:
            self.world.post(up + manoeuvre.begin, self._begin_manoeuvre)

    def _begin_manoeuvre(self, now: float) -> None:
        self.model.manoeuvre, self.model.flown_for = self.scenario.manoeuvre, 0.0

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
        if self.controller is not None:
            self.controller.motion = Motion(
                model.height, model.vertical_speed, abs(model.roll), model.acceleration
            )
        glides = model.descent is not None and model.descent.sink <= SOFT
        carried = model.armed and (glides or not model.motors_failed)
        if not self._flew:
            self._flew = not model.on_ground
        elif model.on_ground:
            if math.isnan(self.landed):
                self.landed, self.landing_speed = now, self._speed
        elif not carried and not self.truth.falls and math.isnan(self.released):
            self.truth = observe(model, now)
        if self.truth.falls:
            self._look_at_fall(now)
        self._speed = max(0.0, -model.vertical_speed)

    def _look_at_fall(self, now: float) -> None:
        model = self.model
        if model.acceleration < GRAVITY / 2.0:
            self._light_until = now
        if abs(model.height) < _NEAR and model.clearance > _NEAR:
            begin = self._unclear[0]
            self._unclear = (now if math.isnan(begin) else begin, now)
        due = self.released + _CARRIES_AFTER
        if not self.another.falls and now >= due and -model.vertical_speed > _NOT_CARRIED:
            self.another = observe(model, now)

    def _out(self, whose: str) -> None:
        now = self.world.now
        if math.isnan(self.released):
            self.released, self.release_height = now, self.model.height
            self._first_out = whose
            decided = [one.action for host in self.supervisors for _, one in host.decided]
            if self.autopilot.released_at <= now and Action.DEPLOY not in decided:
                self._opened_by_kill = now
            self.model.release()
        elif whose != self._first_out and math.isnan(self.released_another):
            self.released_another = now
            if self.another.falls:
                self.model.release_another(FlightModel.canopy_speed)
