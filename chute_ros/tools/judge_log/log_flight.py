"""A log flown through the real link and the real core in virtual time, beside a simulated
parachute that is armed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from builtin_interfaces.msg import Time

from chute_ros.campaign.aircraft import is_for_devices
from chute_ros.campaign.bus import Bus, Medium, Plug
from chute_ros.campaign.channel import Delivery
from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.supervisor_host import SupervisorHost
from chute_ros.campaign.world import World
from chute_ros.links.api import AUTOPILOT_LINK
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.links.mavlink.virtual import VirtualMavlink
from chute_ros.model import FIRES, Action, Decision, TriggerFlags, VehicleState
from chute_ros.protocol.vehicle_merge import VEHICLE_STATE
from chute_ros.ros.supervisor_messages import state_message
from chute_ros.runtime.topics import safety_told
from chute_ros.runtime.supervisor import FinishedTurn
from chute_ros.sim.faults import flip_a_byte
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.judge_log.flight_log import FlightLog
from chute_ros.tools.judge_log.nearest import Nearest
from chute_ros.tools.judge_log.recorded_autopilot import LEAD, RecordedAutopilot

#: What was recorded is no answer to what we do: after a release, or a kill in flight, nothing of
#: the log is judged any more but what follows at once, s.
_FOLLOWED = 3.0
#: Pictures of the supervisor are at least so far apart where nothing is decided, s.
_APART = 0.2
#: Nothing is lost, damaged or overtaken beyond what the log shows.
_CABLE = Medium(Delivery(0.00025, in_order=True), flip_a_byte)


@dataclass
class JudgedLog:
    """What became of a log. Times: s from its start; what came in the lead has a negative one."""

    log: FlightLog
    config: SupervisorConfig
    #: The supervisor's pictures (chute_msgs/SafetyState).
    pictures: list[tuple[float, Any]] = field(default_factory=list)
    decided: list[tuple[float, Decision]] = field(default_factory=list)
    said: list[tuple[float, str]] = field(default_factory=list)
    #: As the link told of it.
    vehicle: list[tuple[float, VehicleState]] = field(default_factory=list)
    #: When the log was left; its end, if nothing was released or killed in flight.
    ended: float = math.nan
    begins_in_flight: bool = False
    nearest: Nearest = field(default_factory=Nearest)

    @property
    def fired(self) -> tuple[tuple[float, Decision], ...]:
        """The kills and deploys of a vehicle that was in flight, and the deploys of any."""
        flown = [at for at, one in self.pictures if one.state == Stage.IN_FLIGHT]
        up = flown[0] if flown else math.inf
        return tuple(
            (at, one)
            for at, one in self.decided
            if one.action is Action.DEPLOY or (one.action is Action.KILL and at >= up)
        )

    @property
    def flew(self) -> float:
        """For how long it was guarded in flight, s."""
        times = [(at, one.state) for at, one in self.pictures if at >= 0.0]
        return sum(
            min(after - at, 2.0 * _APART + 1.0)
            for (at, state), (after, _) in zip(times, times[1:], strict=False)
            if state == Stage.IN_FLIGHT
        )


class _Host(SupervisorHost):
    """Keeps pictures of each of its turns that decides something, and of some of the others."""

    judged: JudgedLog

    def record(self, turn: FinishedTurn) -> None:
        """One more turn."""
        pictures, at = self.judged.pictures, turn.now - LEAD
        if turn.outputs or not pictures or at - pictures[-1][0] >= _APART:
            told = safety_told(self.config, self.process.name, turn.after, {}, turn.now)
            pictures.append((at, state_message(self.config, told, Time())))
            self.judged.nearest.look(self.config, turn.after, turn.now, at)


def fly(
    log: FlightLog, config: SupervisorConfig, until: float, progress: Callable[[float], None]
) -> JudgedLog:
    """Fly the log up to until (s from its start) at most. progress: is told how far it is, s."""
    judged = JudgedLog(log, config)
    world = World()
    ros = Ros(world, 0)
    bus = Bus(world, _CABLE, "log")
    host = _Host(config, (VEHICLE_STATE,), Process("supervisor"), ros, _no_arming)
    host.judged = judged
    world.add(host)
    autopilot = RecordedAutopilot(log)
    judged.begins_in_flight = autopilot.begins_in_flight
    world.add(Plug(bus, "autopilot", autopilot, is_for_devices))
    armed = ParachuteSettings(armed_triggers=TriggerFlags.FC | TriggerFlags.OFFBOARD)
    world.add(Plug(bus, "parachute", ParachuteDevice(armed, []), is_for_devices))
    # What a log lacks was not written; of the take-off it tells that there was one.
    link = MavlinkConfig(needed_message_rate=0.0)
    node = VirtualMavlink(bus, Process(AUTOPILOT_LINK), ros, expect_parachute=True, config=link)
    world.add(node)
    ros.subscribe(i.VehicleReport, Process("listener"), partial(_hear, judged))
    over = _Over(judged, host, autopilot, progress)
    world.run(LEAD + min(until, log.duration) + 1.0, lambda: over.at(world.now))
    judged.ended = min(world.now - LEAD, log.duration)
    judged.decided = [(at - LEAD, one) for at, one in host.decided]
    judged.said = [(at - LEAD, text) for at, text in host.said]
    return judged


class _Over:
    """Whether anything more is to be learnt of a log."""

    def __init__(
        self,
        judged: JudgedLog,
        host: _Host,
        autopilot: RecordedAutopilot,
        progress: Callable[[float], None],
    ) -> None:
        self._judged, self._host, self._autopilot = judged, host, autopilot
        self._progress, self._looks = progress, 0
        self._flown = False

    def at(self, now: float) -> bool:
        """By now."""
        self._looks += 1
        if self._looks % 1000 == 0:
            self._progress(now - LEAD)
        self._flown |= self._host.state.flight.airborne
        acts = FIRES if self._flown else (Action.DEPLOY,)
        first = next((at for at, one in self._host.decided if one.action in acts), math.inf)
        return now > first + _FOLLOWED


def _hear(judged: JudgedLog, report: i.VehicleReport, difference: float, now: float) -> None:
    judged.vehicle.append((now - LEAD, report.state))


def _no_arming(link: str, order: i.ArmDevices, answered: Any) -> None:
    """The parachute is armed, and nobody looks at it after the log."""
