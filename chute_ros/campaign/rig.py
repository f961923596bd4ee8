"""What every flight has: processes and what becomes of them, ways and what lies on them."""

from __future__ import annotations

import math
import random
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import partial

from chute_ros.campaign.bus import Plug
from chute_ros.campaign.channel import Way
from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.scenario import (
    SUPERVISORS,
    ClockJump,
    Fault,
    Scenario,
    Stalls,
    Stop,
    WayFault,
    part,
)
from chute_ros.campaign.second_source import SecondSource
from chute_ros.campaign.sensors import SensorFault, Sensors
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.supervisor_host import SupervisorHost
from chute_ros.campaign.truth import Course
from chute_ros.campaign.vehicle import WindyModel
from chute_ros.campaign.virtual_node import Acted, VirtualNode
from chute_ros.campaign.world import World
from chute_ros.runtime.arming import Answered
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage

#: Between two stalls of an overloaded host, at most, s.
_BETWEEN_STALLS = 0.5


class Rig(Course, ABC):
    """The subclass plugs in its devices and nodes, and says what becomes of the vehicle."""

    def __init__(self, scenario: Scenario, shipped: Shipped) -> None:
        super().__init__()
        self.scenario, self.shipped = scenario, shipped
        self.world = World()
        self.ros = Ros(self.world, scenario.seed)
        self.sensors = Sensors(self.chance("sensors"))
        #: By the source's name in a SensorFault.
        self.sensors_of = {"": self.sensors}
        self.supervisors: list[SupervisorHost] = []
        self.nodes: dict[str, VirtualNode] = {}
        self.plugs: dict[str, Plug] = {}
        self._processes: dict[str, Process] = {}
        self._restart: dict[str, Callable[[float], None]] = {}
        #: When the only parachute refused its release by a wrong height, virtual s; NaN: never.
        self.refused_at: Callable[[], float] = lambda: math.nan
        self.join_supervisors()

    def join_supervisors(self) -> None:
        """One, or two."""
        scenario = self.scenario
        for rank, name in enumerate(SUPERVISORS[: 1 + scenario.standby]):
            config = self.shipped.config(
                scenario.vehicle, scenario.profile, scenario.standby, rank
            )
            process, sources = self.process(name), scenario.vehicle_sources
            host = SupervisorHost(config, sources, process, self.ros, self._call_arm)
            self.supervisors.append(host)
            self._restart[name] = host.start_again
            self.world.add(host)

    def chance(self, what: str) -> random.Random:
        """Of one part, so that what another draws does not change it."""
        return random.Random(f"{self.scenario.seed} {what}")

    def process(self, name: str) -> Process:
        """A new one."""
        self._processes[name] = Process(name)
        return self._processes[name]

    def add_node(self, node: VirtualNode) -> None:
        """A device node."""
        self.nodes[node.name] = self.plugs[node.name] = node
        self._restart[node.name] = node.start_again
        self.world.add(node)

    def add_source(self, name: str, model: WindyModel) -> None:
        """A source of the vehicle's picture besides the autopilot, which senses model."""
        sensors = self.sensors_of[name] = Sensors(self.chance(f"sensors of {name}"))
        source = SecondSource(self.process(name), self.ros, model, sensors)
        self._restart[name] = source.start_again
        self.world.add(source)

    def add_device(self, plug: Plug, reboot: Callable[[], None]) -> None:
        """A simulated device."""
        self.plugs[plug.name] = plug
        self._restart[plug.name] = lambda _: reboot()
        self.world.add(plug)

    @property
    def leader(self) -> SupervisorHost | None:
        """The supervisor whose services are there and answer."""
        leading = [one for one in self.supervisors if one.leading]
        return next((one for one in leading if one.process.runs(self.world.now)), None)

    @property
    def is_ready(self) -> bool:
        """Nothing blocks its flight."""
        leader = self.leader
        return leader is not None and leader.state.stage in (Stage.READY, Stage.ARMED)

    @property
    def sees_flight(self) -> bool:
        """Who decides about it has learnt that it flies, if it does."""
        leader = self.leader
        return leader is not None and (self.scenario.stands or leader.state.flight.airborne)

    def acted(self) -> list[Acted]:
        """What was let through to its devices, in the order of time."""
        every = (one for node in self.nodes.values() for one in node.acted)
        return sorted(every, key=lambda one: one.at)

    def join_links(self) -> None:
        """The nodes of its links, and their devices."""
        for link in self.scenario.carries.links:
            part(link).join(self)

    # -- for the subclass ------------------------------------------------------------------------

    @abstractmethod
    def take_off(self, now: float) -> None:
        """The pilot flies; called once flight is not blocked."""

    @abstractmethod
    def is_up(self) -> bool:
        """The times of the scenario begin."""

    def lands_first(self) -> bool:
        """It was up on a flight before the one that is told of, and lands now."""
        return False

    @abstractmethod
    def fail(self, now: float) -> None:
        """What fails, fails."""

    def told(self) -> Sequence[float]:
        """When lines of a rocket's flight computer came whole, virtual s."""
        return ()

    # -- faults ----------------------------------------------------------------------------------

    def plan(self, up: float) -> None:
        """From here on the scenario's times are known."""
        self.world.post(up + self.scenario.failure_at, self._fail)
        for fault in self.scenario.faults:
            self.plan_one(fault, up)

    def plan_one(self, fault: Fault, up: float) -> None:
        """The subclass has those of the vehicle itself."""
        post = self.world.post
        if isinstance(fault, WayFault):
            self._way(fault.way).append(fault.spell.later(up))
        elif isinstance(fault, SensorFault):
            self.sensors_of[fault.source].faults.append(fault.later(up))
        elif isinstance(fault, ClockJump):
            post(up + fault.at, lambda _: self._set_clock(fault))
        elif isinstance(fault, Stalls):
            chance = self.chance(f"stalls of {fault.who}")
            post(up + fault.begin, partial(self._stall, fault, up + fault.end, chance))
        elif isinstance(fault, Stop):
            post(up + fault.at, partial(self._stop, fault))

    def _fail(self, now: float) -> None:
        self.fail(now)
        for plug in self.plugs.values():
            self.world.stir(plug)

    def _way(self, name: str) -> Way:
        if name in self.plugs:
            return self.plugs[name].way
        if name in self._processes:
            return self._processes[name].outward
        process = self._processes["standby" if name.endswith("standby") else "supervisor"]
        return process.outward if name.startswith("from") else process.inward

    def _set_clock(self, jump: ClockJump) -> None:
        self._processes[jump.who].clock += jump.by

    def _stall(self, stalls: Stalls, end: float, chance: random.Random, now: float) -> None:
        process = self._processes[stalls.who]
        lasts = chance.uniform(0.0, stalls.longest)
        if process.runs(now):
            process.hang(self.world, now + lasts)
        following = now + lasts + chance.uniform(0.05, _BETWEEN_STALLS)
        if following < end:
            self.world.post(following, partial(self._stall, stalls, end, chance))

    def _stop(self, stop: Stop, now: float) -> None:
        until, process = now + stop.lasts, self._processes.get(stop.who)
        if process is None:
            self.plugs[stop.who].dead_until = until
            if stop.dies:
                self.world.post(until, self._restart[stop.who])
        elif stop.dies:
            process.die()
            self.world.post(until, partial(self._start, stop.who))
        else:
            process.hang(self.world, until)

    def _start(self, who: str, now: float) -> None:
        self._processes[who].start(now)
        self._restart[who](now)

    # -- what supervisors ask --------------------------------------------------------------------

    def _call_arm(self, link: str, order: i.ArmDevices, answered: Answered) -> None:
        def told(success: bool, message: str) -> None:
            answered(success, message, self.world.now)

        self.nodes[link].arm(order.arm, order.triggers, told)
