"""A supervisor's runtime in a process that may be late, hang, or die and start again."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from chute_ros.campaign.ros import Process, Ros
from chute_ros.campaign.sensor_messages import Imu, Odometry
from chute_ros.model import Decision, LinkState
from chute_ros.protocol import vehicle_readings as readings
from chute_ros.protocol.events import Notice
from chute_ros.protocol.vehicle_merge import IMU, ODOMETRY, VEHICLE_STATE
from chute_ros.runtime.arming import Answered
from chute_ros.runtime.supervisor import FinishedTurn, Start, SupervisorRuntime
from chute_ros.runtime.topics import (
    ActionTold,
    DeviceBeat,
    DeviceRequest,
    LeaseClaim,
    SafetyPicture,
    SafetyTold,
)
from chute_ros.runtime.vehicle_hearing import VehicleHearing
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.lease import LeaseConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.resume import SavedState, dump, load, worth_saving
from chute_ros.supervisor.state import State

_BOOT = _SETTINGS = "the same"
_RESUME_WITHIN = 30.0  # s
#: Finding each other takes no time here: one that starts looks so long for a leader, s.
_LISTEN = 0.6
#: The wall clock's seconds, of which an epoch is made, as the first one starts.
_FIRST_EPOCH = 8
#: What it hears of device nodes, besides their heartbeats and the vehicle.
_HEARD = (i.ParachuteReport, ActionTold, DeviceRequest)
#: What source of vehicle_sources says what.
_SOURCES: dict[str, type] = {VEHICLE_STATE: i.VehicleReport, IMU: Imu, ODOMETRY: Odometry}

#: Calls the arm service of the device node of this name.
CallArm = Callable[[str, i.ArmDevices, Answered], None]


class SupervisorHost:
    """The shell of a supervisor's runtime in virtual time. vehicle_sources: as its node's
    parameter."""

    def __init__(
        self,
        config: SupervisorConfig,
        vehicle_sources: tuple[str, ...],
        process: Process,
        ros: Ros,
        call_arm: CallArm,
    ) -> None:
        self.config, self.process, self._ros = config, process, ros
        self._call_arm, self._vehicle_sources = call_arm, vehicle_sources
        self._lease_config = LeaseConfig(
            process.name,
            config.rank,
            config.standby,
            listen=_LISTEN,
            deaf_after=max(config.limits(link).lost_after for link in config.links),
        )
        #: When each decision was first made, in their order.
        self.decided: list[tuple[float, Decision]] = []
        self._numbers: set[tuple[int, int]] = set()
        self.said: list[tuple[float, str]] = []
        #: Those of them that were alarms.
        self.alarmed: list[tuple[float, str]] = []
        #: When it was first told that a parachute is out.
        self.knew_release = math.nan
        self._kept: State | None = None
        self._released = self._armed = frozenset[tuple[str, str]]()
        self._begin(_FIRST_EPOCH, None, 0.0)
        for kind in _HEARD:
            ros.subscribe(kind, process, self._take)
        for source in vehicle_sources:
            ros.subscribe(_SOURCES[source], process, self._vehicle)
        ros.subscribe(DeviceBeat, process, self._heartbeat)
        if config.standby:
            ros.subscribe(LeaseClaim, process, self._claim)

    def _begin(self, epoch: int, before: State | None, now: float) -> None:
        start = Start(epoch, f"{self.process.name} {now}", before, self._released, self._armed)
        self.runtime = SupervisorRuntime(self.config, self._lease_config, self, start, now)
        self._hearing = VehicleHearing(
            self._vehicle_sources,
            self.config.vehicle_state_age,
            self.config.vehicle_source_rate,
            self._vehicle_told,
            LinkState.NEVER_SEEN if before is None else before.heard.vehicle.link_state,
            now,
        )

    @property
    def state(self) -> State:
        """The core's."""
        return self.runtime.state

    @property
    def leading(self) -> bool:
        """What it decides is sent."""
        return self.runtime.lease.leading

    # -- for a person ----------------------------------------------------------------------------

    def call(self, make: Callable[[int], i.Input], answered: Callable[[i.Finish], None]) -> None:
        """One of its services is called."""
        self.runtime.ask(make, answered, self._ros.world.now)
        self._ros.world.stir(self)

    # -- the runtime's shell ---------------------------------------------------------------------

    def publish(self, message: Any) -> int:
        """On its topic."""
        if isinstance(message, SafetyTold):
            state = message.state
            message = SafetyPicture(
                state.flight_blocked,
                tuple(state.device_blocks),
                message.supervisor,
                message.stamps,
                message.alarms,
                message.reasons if state.flight_blocked else (),
                state.stage is Stage.DEPLOYED,
            )
        elif isinstance(message, Decision):
            number = (message.epoch, message.id)
            if number not in self._numbers:
                self._numbers.add(number)
                self.decided.append((self._ros.world.now, message))
        return self._ros.publish(self.process, message)

    def log(self, notice: Notice) -> None:
        """Who leads, above all."""
        self.said.append((self._ros.world.now, notice.text))

    def say(self, said: i.LogMessage) -> None:
        """To the judge."""
        told = (self._ros.world.now, said.text)
        self.said.append(told)
        if said.alarm:
            self.alarmed.append(told)

    def record(self, turn: FinishedTurn) -> None:
        """The judge looks at what comes of it."""

    def keep(self, state: State) -> None:
        """Until the next start."""
        self._kept = state
        self._released, self._armed = state.released_since_reset, state.last_armed

    def offer(self, offered: bool) -> None:
        """Who calls asks the one that leads."""

    def failed(self, error: Exception, new: tuple[i.Input, ...]) -> str:
        """A flight in which the core fails is broken."""
        raise error

    def arm(self, link: str, order: i.ArmDevices, answered: Answered) -> str:
        """Call a device node's arm service; its answer comes in a turn of its own."""

        def answer(success: bool, message: str, now: float) -> None:
            if self.process.runs(now):
                answered(success, message, now)
                self._ros.world.stir(self)

        def post(success: bool, message: str, now: float) -> None:
            self._ros.world.post(now, lambda then: answer(success, message, then))

        self._call_arm(link, order, post)
        return ""

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
        """Of all that it does, but not before it runs again."""
        deadline = min(self.runtime.core_due, self.runtime.due, self._hearing.due)
        return max(deadline, self.process.stopped_until)

    def start_again(self, now: float) -> None:
        """It was killed; what it left is what it goes on with."""
        left, self._kept = self._kept, None
        before = None
        if left is not None and worth_saving(left):
            text = dump(SavedState(_BOOT, _SETTINGS, left))
            before = load(text, _BOOT, _SETTINGS, _RESUME_WITHIN, now)
        # The epoch is made of the wall clock's seconds, which have moved on.
        self._begin(self.state.epoch, before, now)
        self._turn((), now)

    # -- what comes ------------------------------------------------------------------------------

    def _take(self, one: Any, difference: float, now: float) -> None:
        released = isinstance(one, i.ParachuteReport) and one.status.deployed
        if released and math.isnan(self.knew_release):
            self.knew_release = now
        self.runtime.heard(one, difference, now)
        self._ros.world.stir(self)

    def _heartbeat(self, one: DeviceBeat, difference: float, now: float) -> None:
        stamp = self.process.wall(now) - round(difference * 1e9)
        self.runtime.heard_beat(one, stamp, difference, now)
        self._ros.world.stir(self)

    def _vehicle(
        self, one: i.VehicleReport | Imu | Odometry, difference: float, now: float
    ) -> None:
        if isinstance(one, i.VehicleReport):
            self._hearing.hear_state(one.state, now)
        elif isinstance(one, Imu):
            self._hearing.hear(IMU, readings.imu(one), now)
        else:
            self._hearing.hear(ODOMETRY, readings.odometry(one), now)
        self._ros.world.stir(self)

    def _vehicle_told(self, report: i.VehicleReport, now: float) -> None:
        self._turn((report,), now)

    def _claim(self, told: LeaseClaim, difference: float, now: float) -> None:
        self.runtime.claim(told, now)
        self._ros.world.stir(self)

    def _turn(self, new: tuple[i.Input, ...], now: float) -> None:
        self.runtime.turn(new, now)
        self._ros.world.stir(self)
