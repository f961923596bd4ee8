"""All that the supervisor's core remembers between two updates. Frozen: an update makes a new one."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from chute_ros.model import Armed, Decision, LandedState, LinkState, Outcome, VehicleState
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.machine import Stage


@dataclass(frozen=True)
class LinkEvidence:
    """What is known of one link. heard: monotonic s of the newest heartbeat; NaN: never."""

    heard: float = math.nan
    reported: LinkState = LinkState.NEVER_SEEN
    device_healthy: bool = False
    seq: int = 0
    deployed: bool = False
    faults: tuple[str, ...] = ()

    def state(self, config: SupervisorConfig, now: float) -> LinkState:
        """The worse of what the node says of its wire, and of what its silence says of the node."""
        if math.isnan(self.heard):
            return LinkState.NEVER_SEEN
        silence = now - self.heard
        if silence >= config.heartbeat.lost_after:
            return LinkState.LOST
        if silence >= config.heartbeat.stale_after and self.reported is LinkState.OK:
            return LinkState.STALE
        return self.reported


@dataclass(frozen=True)
class Pending:
    """A decision on its way. reached: the furthest outcome of each link that reported."""

    decision: Decision
    decided_at: float
    sent_at: float
    reached: MappingProxyType[str, Outcome] = field(default_factory=lambda: MappingProxyType({}))
    details: tuple[str, ...] = ()

    def furthest(self) -> Outcome:
        """The best that any target got to: one parachute that is out is enough."""
        good = [outcome for outcome in self.reached.values() if outcome is not Outcome.FAILED]
        return max(good, default=Outcome.NONE)

    def all_failed(self) -> bool:
        """Every target has failed."""
        return all(self.reached.get(t) is Outcome.FAILED for t in self.decision.targets)

    def unreported(self) -> bool:
        """A target has not even said that it has sent it."""
        return any(target not in self.reached for target in self.decision.targets)


@dataclass(frozen=True)
class State:
    """The supervisor's memory. Times are monotonic s; NaN: has not happened."""

    epoch: int
    started_at: float
    stage: Stage = Stage.STARTUP
    stage_since: float = math.nan
    mode: Mode = Mode.ACTIVE
    next_id: int = 1
    links: MappingProxyType[str, LinkEvidence] = field(default_factory=lambda: MappingProxyType({}))
    vehicle: VehicleState = field(default=VehicleState())
    vehicle_received: float = math.nan
    block: Pending | None = None
    kill: Pending | None = None
    deploy: Pending | None = None
    #: A deploy follows the kill: why, and the token of who asked (0: nobody waits).
    deploy_reason: str = ""
    deploy_token: int = 0
    kill_token: int = 0
    alarms: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if math.isnan(self.stage_since):
            object.__setattr__(self, "stage_since", self.started_at)

    def in_air(self, config: SupervisorConfig, now: float) -> bool | None:
        """Is the vehicle in the air? None: nothing that is fresh says so or otherwise."""
        vehicle, waited = self.vehicle, now - self.vehicle_received

        def fresh(age: float) -> bool:
            return age + waited <= config.vehicle_state_age

        if fresh(vehicle.landed_state_age) and vehicle.landed_state is not LandedState.UNKNOWN:
            return vehicle.landed_state is not LandedState.ON_GROUND
        if fresh(vehicle.armed_age) and vehicle.armed is Armed.DISARMED:
            return False
        if fresh(vehicle.armed_age) and fresh(vehicle.height_age):
            armed = vehicle.armed is Armed.ARMED
            return armed and vehicle.height > config.takeoff_height
        return None


def frozen(mapping: dict[str, Any]) -> MappingProxyType[str, Any]:
    """A read-only copy."""
    return MappingProxyType(dict(mapping))
