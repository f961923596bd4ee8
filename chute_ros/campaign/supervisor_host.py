"""The supervisor's core in its process, and what its node does between core and ROS: a loop that
may be late, hang, or die and start again; a lease, where there are two."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.sensor_messages import Imu, Odometry
from chute_ros.campaign.vehicle_hearing import VehicleHearing
from chute_ros.model import Action, Decision
from chute_ros.protocol.vehicle_merge import IMU, ODOMETRY, VEHICLE_STATE
from chute_ros.runtime.supervisor_inputs import input_of
from chute_ros.runtime.topics import (
    ActionTold,
    DeviceBeat,
    DeviceRequest,
    SafetyPicture,
    SupervisorBeat,
)
from chute_ros.supervisor import handover
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import next_deadline, update
from chute_ros.supervisor.epochs import epoch_above
from chute_ros.supervisor.lease import Claim, Event, Lease, LeaseConfig, Role
from chute_ros.supervisor.orders import ON_GROUND
from chute_ros.supervisor.resume import Left, resumed, worth_leaving, written
from chute_ros.supervisor.state import State

_BOOT = _SETTINGS = "the same"
_RESUME_WITHIN = 30.0  # s
_HEARTBEAT_INTERVAL = 0.1  # s
_STATE_INTERVAL = 1.0  # s, at the latest
#: Finding each other takes no time here: one that starts looks so long for a leader, s.
_LISTEN = 0.6
#: What it hears of device nodes, besides their heartbeats and the vehicle.
_HEARD = (i.ParachuteReport, ActionTold, DeviceRequest)
#: What source of vehicle_sources says what.
_SOURCES: dict[str, type] = {VEHICLE_STATE: i.VehicleReport, IMU: Imu, ODOMETRY: Odometry}


@dataclass(frozen=True)
class LeaseClaim:
    """On safety/lease. state: the leader's."""

    claim: Claim
    state: str


class SupervisorHost:
    """One of the supervisors. vehicle_sources: as its node's parameter; arm_devices: calls the arm
    services that an order names."""

    def __init__(
        self,
        config: SupervisorConfig,
        vehicle_sources: tuple[str, ...],
        process: Process,
        ros: Ros,
        arm_devices: Callable[[SupervisorHost, i.ArmDevices], None],
    ) -> None:
        self.config, self.process, self._ros = config, process, ros
        self._arm_devices, self._vehicle_sources = arm_devices, vehicle_sources
        self._lease_config = LeaseConfig(process.name, config.rank, config.standby, listen=_LISTEN)
        self._tokens = itertools.count(1)
        self._callers: dict[int, Callable[[i.Finish], None]] = {}
        #: When each decision was first made, in their order.
        self.decided: list[tuple[float, Decision]] = []
        self.said: list[tuple[float, str]] = []
        #: Those of them that were alarms.
        self.alarmed: list[tuple[float, str]] = []
        #: When it was first told that a parachute is out.
        self.knew_release = math.nan
        self._kept: State | None = None
        self._begin(State(epoch_above(8, config.rank), 0.0, leading=not config.standby), 0.0)
        for kind in _HEARD:
            ros.subscribe(kind, process, self._take)
        alone = vehicle_sources == (VEHICLE_STATE,)
        for source in vehicle_sources:
            # One alone is passed on as it comes, as by the node.
            ros.subscribe(_SOURCES[source], process, self._take if alone else self._vehicle)
        ros.subscribe(DeviceBeat, process, self._heartbeat)
        if config.standby:
            ros.subscribe(LeaseClaim, process, self._claim)

    def _begin(self, state: State, now: float) -> None:
        self.state = state
        self.lease = Lease.begin(self._lease_config, now)
        self._experienced = False
        self._beat_at = self._state_at = now
        self._published: tuple[object, ...] = ()
        self._deadline = now
        self._hearing = VehicleHearing(
            self._vehicle_sources,
            self.config.vehicle_state_age,
            self._vehicle_told,
            state.vehicle.link_state,
            now,
        )
        self._stamps: dict[str, int] = {}
        self._callers.clear()

    @property
    def leading(self) -> bool:
        """What it decides is sent."""
        return self.lease.role is Role.LEADING

    # -- for a person ----------------------------------------------------------------------------

    def call(self, make: Callable[[int], i.Input], answered: Callable[[i.Finish], None]) -> None:
        """One of its services is called."""
        token = next(self._tokens)
        self._callers[token] = answered
        self._turn((make(token),), self._ros.world.now)

    def armed(self, done: i.ArmDone) -> None:
        """What came of an order to arm devices."""
        if self.process.runs(self._ros.world.now):
            self._turn((done,), self._ros.world.now)

    # -- time ------------------------------------------------------------------------------------

    def update(self, now: float) -> None:
        """Its deadline, or the end of its sleep."""
        if not self.process.runs(now):
            return
        if now >= self._hearing.due:
            self._hearing.tell_now(now)
        else:
            self._turn((), now)

    def next_deadline(self) -> float:
        """Of the core, the lease, its heartbeat and what is told of the vehicle, but not before it
        runs again."""
        lease = self.lease.deadline(self._lease_config)
        deadline = min(self._deadline, self._beat_at, lease, self._hearing.due)
        return max(deadline, self.process.stopped_until)

    def start_again(self, now: float) -> None:
        """It was killed; what it left is what it goes on with."""
        left, self._kept = self._kept, None
        rank, standby = self.config.rank, self.config.standby
        # The epoch is made of the wall clock's seconds, which have moved on.
        epoch = epoch_above(self.state.epoch, rank)
        if left is None or not worth_leaving(left):
            self._begin(State(epoch, now, leading=not standby), now)
            self._turn((), now)
            return
        text = written(Left(_BOOT, _SETTINGS, left))
        state = resumed(text, _BOOT, _SETTINGS, _RESUME_WITHIN, now)
        self._begin(state, now)
        self._turn(() if standby else (i.TakeOver(epoch),), now)

    # -- what comes ------------------------------------------------------------------------------

    def _take(self, one: Any, difference: float, now: float) -> None:
        released = isinstance(one, i.ParachuteReport) and one.status.deployed
        if released and math.isnan(self.knew_release):
            self.knew_release = now
        self._turn((input_of(one, difference),), now)

    def _vehicle(
        self, one: i.VehicleReport | Imu | Odometry, difference: float, now: float
    ) -> None:
        self._hearing.hear(one, now)
        self._ros.world.stir(self)

    def _vehicle_told(self, report: i.VehicleReport, now: float) -> None:
        self._turn((report,), now)

    def _heartbeat(self, one: DeviceBeat, difference: float, now: float) -> None:
        self._stamps[one.link] = self.process.wall(now) - round(difference * 1e9)
        self._take(one, difference, now)

    def _claim(self, told: LeaseClaim, difference: float, now: float) -> None:
        self.lease, event = self.lease.heard(self._lease_config, self._own(now), told.claim, now)
        if event is not None:
            self._happened(event, now)
        if told.claim.leading and self.lease.leader == told.claim.name and told.state:
            self.state = handover.followed(self.state, told.state, now)
            self._experienced = True
        self._ros.world.stir(self)

    # -- the loop --------------------------------------------------------------------------------

    def _turn(self, new: tuple[i.Input, ...], now: float) -> None:
        heard = self.state.newest_heartbeat() if self.config.standby else math.nan
        self.lease, event = self.lease.looked(self._lease_config, now, heard)
        if event is not None:
            self._happened(event, now)
        self.state, outputs = update(self.config, self.state, new, now)
        if outputs:
            self._carry_out(outputs, now)
        if now >= self._beat_at:
            self._beat_at = max(self._beat_at + _HEARTBEAT_INTERVAL, now)
            self._ros.publish(self.process, SupervisorBeat(self.process.name, self.leading))
            self._tell(now)
        if self.leading:
            self._publish_state(now)
        self._deadline = next_deadline(self.config, self.state, now)
        self._ros.world.stir(self)

    def _carry_out(self, outputs: tuple[i.Output, ...], now: float) -> None:
        if any(isinstance(output, i.Decide) for output in outputs):
            self._tell(now)
            self._kept = self.state
        for output in outputs:
            if isinstance(output, i.Decide):
                if not output.again:
                    self.decided.append((now, output.decision))
                self._ros.publish(self.process, output.decision)
            elif isinstance(output, i.Say):
                self.said.append((now, output.text))
                if output.alarm:
                    self.alarmed.append((now, output.text))
            elif isinstance(output, i.Finish):
                caller = self._callers.pop(output.token, None)
                if caller is not None:
                    caller(output)
            elif isinstance(output, i.ArmDevices):
                self._arm_devices(self, output)
            elif self.leading:
                self.lease, event = self.lease.refused(output.newest_epoch, now)
                self._happened(event, now)

    def _publish_state(self, now: float) -> None:
        state = self.state
        told = (state.stage, state.mode, state.next_id, state.alarms, state.device_blocks)
        if told == self._published and now < self._state_at:
            return
        self._published, self._state_at = told, now + _STATE_INTERVAL
        self._kept = state
        block = state.block.decision if state.block is not None else None
        blocked = block is not None and block.action is Action.FLIGHT_BLOCK and not block.shadow
        blocks = tuple(state.device_blocks)
        picture = SafetyPicture(blocked, blocks, self.process.name, dict(self._stamps))
        self._ros.publish(self.process, picture)

    # -- the lease -------------------------------------------------------------------------------

    def _happened(self, event: Event, now: float) -> None:
        if self.leading:
            epoch = self.lease.next_epoch(self._lease_config, self.state.epoch)
            new: i.Input = i.TakeOver(epoch)
        else:
            new = i.StepDown(event.value)
        self.said.append((now, f"{'leads' if self.leading else 'looks on'}: {event.value}"))
        self.state, outputs = update(self.config, self.state, (new,), now)
        self._carry_out(outputs, now)
        self._tell(now)

    def _own(self, now: float) -> Claim:
        state, config = self.state, self._lease_config
        empty = not self._experienced and not state.flown and state.stage in ON_GROUND
        heard = state.links_heard(self.config, now)
        return Claim(config.name, config.rank, state.epoch, self.leading, empty, heard)

    def _tell(self, now: float) -> None:
        if self.config.standby:
            state = handover.told(self.state, now) if self.leading else ""
            self._ros.publish(self.process, LeaseClaim(self._own(now), state))
