"""An aircraft whose autopilot decides by itself, as a peer of this product would, and releases the
parachute on its own output. There is no supervisor, no link and no ROS."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from chute_ros.campaign.aircraft import Aircraft
from chute_ros.campaign.estimator import EstimatorFault
from chute_ros.campaign.peers.api import Belief, Peer, PeerDecision
from chute_ros.campaign.scenario import Fault, HomeMove, Scenario
from chute_ros.campaign.sensors import SensorFault, Sensors
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.vehicle import CampaignAutopilot, WindyModel
from chute_ros.campaign.virtual_node import Acted
from chute_ros.model import Action, Decision
from chute_ros.sim.autopilot_device import STEP
from chute_ros.sim.autopilot_kinds import AutopilotKind

#: Who acts, and the output that it does it on.
_NAME = "autopilot"
#: Faults of what an autopilot knows. All others lie on ways and processes that it has not.
_FELT = (SensorFault, EstimatorFault, HomeMove)
#: Manoeuvres that no autopilot flies while it holds an attitude: 45 degrees and more.
_ACRO = ("flip", "dive")

MakePeer = Callable[[], Peer]


class PeerAircraft(Aircraft):
    """make_peer: called at each start of the autopilot."""

    def __init__(self, scenario: Scenario, shipped: Shipped, make_peer: MakePeer) -> None:
        self._make_peer = make_peer
        self._acted: list[Acted] = []
        super().__init__(scenario, shipped)

    def join_supervisors(self) -> None:
        """None is there."""

    def join_links(self) -> None:
        """None is there."""

    def make_autopilot(self, kind: AutopilotKind) -> CampaignAutopilot:
        return DecidingAutopilot(self.model, self.sensors, kind, self._make_peer, self._ordered)

    @property
    def is_ready(self) -> bool:
        return True

    @property
    def sees_flight(self) -> bool:
        return True

    def acted(self) -> list[Acted]:
        return self._acted

    def plan_one(self, fault: Fault, up: float) -> None:
        if isinstance(fault, _FELT):
            super().plan_one(fault, up)

    def _ordered(self, order: PeerDecision) -> None:
        """The motors are off with a kill; with a deploy the parachute is out."""
        number = len(self._acted) + 1
        decision = Decision(1, number, order.action, order.rule, order.reasons, (_NAME,))
        self._acted.append(Acted(self.world.now, _NAME, decision))
        if order.action is Action.DEPLOY:
            self.out(_NAME)


class DecidingAutopilot(CampaignAutopilot):
    """ordered: told of a kill as it stops the motors, and of a deploy as it releases."""

    model: WindyModel

    def __init__(
        self,
        model: WindyModel,
        sensors: Sensors,
        kind: AutopilotKind,
        make_peer: MakePeer,
        ordered: Callable[[PeerDecision], None],
    ) -> None:
        self._make_peer, self._ordered = make_peer, ordered
        super().__init__(model, sensors, kind)

    def reboot(self) -> None:
        super().reboot()
        self._peer = self._make_peer()
        self._decides_at, self._armed_at = self.now, math.nan
        self._terminated = False

    def _fly(self, now: float) -> None:
        if now < self._decides_at:
            return
        self._decides_at = max(self._decides_at + STEP, now)
        order = self._peer.step(self._belief())
        if order is None or self._terminated:
            return
        self._terminated = True
        self._set_armed(False)
        self._ordered(replace(order, action=Action.KILL))
        if order.action is Action.DEPLOY:
            self._after(self._peer.release_delay, lambda: self._ordered(order))

    def next_step(self) -> float:
        return min(super().next_step(), self._decides_at)

    def _belief(self) -> Belief:
        model, now, read = self.model, self.now, self._sensors.read
        self.home.follow(model, now)
        picture = self.estimator.picture(model, now)
        altitude = read("height", picture.height, now)
        if not model.armed:
            self._armed_at = math.nan
        elif math.isnan(self._armed_at):
            self._armed_at = now
        # It is carried up at once; without that it would have climbed for as long as this.
        climb = 0.0 if model.on_ground else max(0.0, model.target_height) / model.climb_speed
        manoeuvre = model.manoeuvre
        held = model.controlled or model.on_ground
        return Belief(
            now=now,
            armed=model.armed,
            armed_for=now - self._armed_at + climb,
            landed=self._landed,
            acro=manoeuvre is not None and manoeuvre.kind in _ACRO,
            height=altitude - self.home.offset,
            vertical_speed=read("speed", picture.vertical_speed, now),
            tilt=math.degrees(read("tilt", picture.roll, now)),
            commanded_tilt=math.degrees(self._commanded_roll()),
            # What it controls does as it is told: a wrong sensor is one of the telling.
            commanded_altitude=model.height if held else model.target_height,
            altitude=altitude,
            pressure_height=read("pressure", model.height, now),
            force=abs(read("force", model.acceleration, now)),
        )
