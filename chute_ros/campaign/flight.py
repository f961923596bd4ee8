"""One flight: the world is built from its scenario, lived through, and compared with the truth."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from chute_ros.campaign.bus import Bus
from chute_ros.campaign.channel import Channel, Spell
from chute_ros.campaign.device_node import NAME, DeviceNode
from chute_ros.campaign.scenario import FOLLOWED, Failure, Scenario, Stop, WayFault
from chute_ros.campaign.supervisor_host import SupervisorHost
from chute_ros.campaign.truth import Truth, observe
from chute_ros.campaign.vehicle import CampaignAutopilot, SensorFault, WindyModel
from chute_ros.campaign.world import World
from chute_ros.model import Action, Decision, DeploymentTrigger
from chute_ros.protocol.mavlink.config import MavlinkConfig
from chute_ros.protocol.mavlink.link import MavlinkLink
from chute_ros.sim.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.profile_reader import read_profile
from chute_ros.supervisor.rules import Profile

#: From a message's publisher to its subscription over ROS on one host, s.
_ROS_DELAY = 0.0005
#: FC and OFFBOARD.
_ARMED_TRIGGERS = 12
_CLIMB_SPEED = 20.0  # m/s
_READY_WITHIN = 12.0  # s
#: A pilot looks at the vehicle so often, s.
_LOOKS = 0.1


@dataclass(frozen=True)
class Flown:
    """What happened, in virtual s; NaN: it did not."""

    scenario: Scenario
    truth: Truth
    #: Why it never took off; empty: it did.
    grounded: str
    took_off: float
    killed: float
    released: float
    landed: float
    landing_speed: float
    release_height: float
    #: Orders to release that the node sent although it had heard that the parachute is out.
    ordered_again: int
    decided: tuple[tuple[float, Decision], ...]
    acted: tuple[tuple[float, Decision], ...]
    #: When the supervisor was told of the vehicle.
    told: tuple[float, ...]


class ReleasedParachute(ParachuteDevice):
    """Its release acts on the vehicle, whoever hears of it."""

    def __init__(self, settings: ParachuteSettings, out: Callable[[], None]) -> None:
        super().__init__(settings, [])
        self._out = out

    def _deploy(self, trigger: DeploymentTrigger) -> None:
        super()._deploy(trigger)
        self._out()


def load_profiles(folder: Path) -> Mapping[str, Profile]:
    """Those that are shipped."""
    return {
        path.stem: read_profile(path.read_text(encoding="utf-8"), path.stem, (NAME,))
        for path in folder.glob("*.yaml")
    }


class Flight:
    """Everything that lives in one world."""

    def __init__(self, scenario: Scenario, profile: Profile) -> None:
        self.scenario = scenario
        chance = random.Random(scenario.seed + 1)
        self.world = World()
        bus = Bus(self.world, chance)
        self.model = WindyModel(
            fall_speed=scenario.fall_speed,
            climb_speed=_CLIMB_SPEED,
            gusts=scenario.gusts,
            chance=chance,
        )
        self.autopilot = CampaignAutopilot(self.model, chance)
        settings = ParachuteSettings(armed_triggers=_ARMED_TRIGGERS)
        self.parachute = ReleasedParachute(settings, self._parachute_out)
        self.autopilot_plug, self.parachute_plug = (
            bus.plug(self.autopilot),
            bus.plug(self.parachute),
        )
        #: One of each kind of message: a topic keeps its order, topics overtake each other.
        self._topics: dict[type, Channel[i.Input]] = {}
        self._chance = chance
        self._spells_to_supervisor: list[Spell] = []
        self._decisions: Channel[Decision] = Channel(self.world, chance, _ROS_DELAY, True)
        config = SupervisorConfig(
            required_links=(NAME,), kill_links=(NAME,), deploy_links=(NAME,), profile=profile
        )
        self.supervisor = SupervisorHost(config, self._send_decision)
        self.node = DeviceNode(bus, MavlinkLink(MavlinkConfig()), self._tell)
        bus.add(self.node)
        self.world.parts += [
            self.autopilot_plug,
            self.parachute_plug,
            self.node,
            self.supervisor,
            self,
        ]
        self._look_at = 0.0
        self.truth = Truth()
        self.took_off = self.up_at = self.released = self.landed = math.nan
        self.landing_speed = self.release_height = math.nan
        self._speed = 0.0

    # -- ROS --------------------------------------------------------------------------------------

    def _tell(self, one: i.Input) -> None:
        topic = self._topics.get(type(one))
        if topic is None:
            topic = self._topics[type(one)] = Channel(self.world, self._chance, _ROS_DELAY, True)
            topic.spells = self._spells_to_supervisor
        topic.send(one, self.supervisor.take)

    def _send_decision(self, decision: Decision) -> None:
        sent = self.world.now
        self._decisions.send(decision, lambda one, now: self.node.decide(one, now - sent, now))

    # -- the pilot, the failure and the faults ---------------------------------------------------

    def next_deadline(self) -> float:
        """The pilot's next look."""
        return self._look_at

    def update(self, now: float) -> None:
        """The pilot looks."""
        self._look_at = now + _LOOKS
        stage = self.supervisor.state.stage
        if math.isnan(self.took_off):
            if stage is Stage.READY and now > 1.5:
                self.autopilot.act("arm")
                self.autopilot.act(f"takeoff={self.scenario.height}")
                self.took_off = now
        elif math.isnan(self.up_at) and self.model.height > self.scenario.height - 1.0:
            self.up_at = now
            self._plan(now)
        self._watch(now)

    def _watch(self, now: float) -> None:
        if self.model.on_ground and not math.isnan(self.up_at) and math.isnan(self.landed):
            self.landed, self.landing_speed = now, self._speed
        self._speed = max(0.0, -self.model.vertical_speed)

    def _plan(self, up: float) -> None:
        """From here on the scenario's times are known."""
        post, failure = self.world.post, self.scenario.failure
        if failure is not Failure.NOTHING:
            post(up + self.scenario.failure_at, self._fail)
        ways = {
            "autopilot": (self.autopilot_plug.outward, self.autopilot_plug.inward),
            "parachute": (self.parachute_plug.outward, self.parachute_plug.inward),
            "node": (self.node.outward, self.node.inward),
            "from the supervisor": (self._decisions,),
        }
        for fault in self.scenario.faults:
            if isinstance(fault, WayFault):
                spell = fault.spell
                moved = Spell(**{**vars(spell), "begin": up + spell.begin, "end": up + spell.end})
                if fault.way == "to the supervisor":
                    self._spells_to_supervisor.append(moved)
                else:
                    for channel in ways[fault.way]:
                        channel.spells.append(moved)
            elif isinstance(fault, SensorFault):
                moved_fault = SensorFault(fault.kind, up + fault.begin, up + fault.end)
                self.autopilot.faults.append(moved_fault)
            else:
                post(up + fault.at, lambda now, fault=fault: self._stop(fault, now))

    def _stop(self, fault: Stop, now: float) -> None:
        if fault.who == "supervisor":
            self.supervisor.hangs_until = now + fault.lasts
            if fault.dies:
                self.world.post(now + fault.lasts, self.supervisor.start_again)
        elif fault.who == "parachute":
            self.parachute_plug.dead_until = now + fault.lasts
            if fault.dies:
                self.world.post(now + fault.lasts, lambda _: self.parachute.reboot())
        else:
            self.node.dead_until = now + fault.lasts

    def _fail(self, now: float) -> None:
        failure = self.scenario.failure
        self.autopilot.step(now)
        if failure.falls and math.isnan(self.model.released_for):
            self.truth = observe(self.model, now)
        if failure is Failure.MOTOR:
            self.autopilot.act("fail-motor")
        elif failure is Failure.REBOOT:
            self.autopilot.reboot()
        elif failure is Failure.POWER:
            self.model.motors_failed = True
            self.autopilot_plug.dead_until = math.inf
            self._fall_unseen(now)
        elif failure is Failure.HANG:
            self.autopilot_plug.dead_until = now + 6.0

    def _fall_unseen(self, now: float) -> None:
        """Nobody steps a vehicle whose autopilot has no power but nature."""
        self.autopilot.step(now)
        self._watch(now)
        self.world.post(now + 0.05, self._fall_unseen)

    def _parachute_out(self) -> None:
        self.released, self.release_height = self.world.now, self.model.height
        self.model.release()

    def run(self) -> Flown:
        """Live through it."""
        self.world.run(_READY_WITHIN, lambda: not math.isnan(self.took_off))
        grounded = ""
        if math.isnan(self.took_off):
            grounded = "; ".join(text for _, text in self.supervisor.said) or "nothing was said"
        else:
            climb = self.took_off + self.scenario.height / _CLIMB_SPEED + 15.0
            self.world.run(climb, lambda: not math.isnan(self.up_at))
            end = self.up_at + self.scenario.failure_at + FOLLOWED
            self.world.run(end, self._over)
        acted = tuple((one.at, one.decision) for one in self.node.acted)
        killed = [at for at, one in acted if one.action is Action.KILL]
        return Flown(
            self.scenario,
            self.truth,
            grounded,
            self.took_off,
            killed[0] if killed else math.nan,
            self.released,
            self.landed,
            self.landing_speed,
            self.release_height,
            self.node.ordered_again,
            tuple(self.supervisor.decided),
            acted,
            tuple(self.supervisor.vehicle_reports),
        )

    def _over(self) -> bool:
        """It is down, or hangs under its canopy for longer than anybody would fire again."""
        now = self.world.now
        under_canopy = not math.isnan(self.released) and now > self.released + 3.0
        return under_canopy or now > self.landed + 1.0
