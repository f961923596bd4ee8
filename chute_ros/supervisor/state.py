"""All that the supervisor's core remembers. Frozen: an update makes a new one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from chute_ros.model import Action, Armed, Decision, LandedState, LinkState, Outcome, VehicleState
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.machine import Stage

#: A flight block that nobody reports on is sent at least so often, s.
_RAREST_RESEND = 1.0
_NOTHING: MappingProxyType[str, tuple[str, ...]] = MappingProxyType({})


@dataclass(frozen=True)
class LinkEvidence:
    """What is known of one link. heard: monotonic s of the newest heartbeat; NaN: never."""

    heard: float = math.nan
    reported: LinkState = LinkState.NEVER_SEEN
    device_healthy: bool = False
    seq: int = 0
    #: The devices on this link whose own status says released.
    deployed: frozenset[str] = frozenset()
    #: Faults of each device on this link, in words.
    faults: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: _NOTHING)

    def silent(self, limit: float, now: float) -> bool:
        """The node itself, not only its device, was not heard for limit s, or never.

        Compared as next_deadline says it, so that rounding never leaves a deadline unserved.
        """
        return not now < self.heard + limit

    def state(self, config: SupervisorConfig, now: float) -> LinkState:
        """The worse of what the node says of its wire, and what its silence says of itself."""
        if math.isnan(self.heard):
            return LinkState.NEVER_SEEN
        if self.silent(config.heartbeat.lost_after, now):
            return LinkState.LOST
        if self.silent(config.heartbeat.stale_after, now) and self.reported is LinkState.OK:
            return LinkState.STALE
        return self.reported


@dataclass(frozen=True)
class Pending:
    """A decision on its way, with every outcome that each link reported."""

    decision: Decision
    #: All that shall carry it out; a decision made again may name only those still missing.
    targets: tuple[str, ...]
    decided_at: float
    sent_at: float
    outcomes: Mapping[str, frozenset[Outcome]] = field(
        default_factory=lambda: MappingProxyType({})
    )
    details: tuple[str, ...] = ()
    #: Numbers under which the same was decided before; a report on one of them counts.
    earlier: frozenset[tuple[int, int]] = frozenset()
    #: It was said that nothing came of it.
    given_up: bool = False

    @property
    def number(self) -> tuple[int, int]:
        """How the gates of the device nodes order decisions."""
        return self.decision.epoch, self.decision.id

    def of(self, link: str) -> frozenset[Outcome]:
        """What this link reported so far."""
        return self.outcomes.get(link, frozenset())

    def reached(self, outcome: Outcome) -> bool:
        """A link has got this far, or further: one parachute that is out is enough."""
        good = [o for outcomes in self.outcomes.values() for o in outcomes]
        return any(o >= outcome for o in good if o is not Outcome.FAILED)

    @property
    def confirmed(self) -> bool:
        """A device's own status showed the effect."""
        return self.reached(Outcome.CONFIRMED)

    def all_failed(self) -> bool:
        """Every target has failed, and none was confirmed."""
        failed = all(Outcome.FAILED in self.of(target) for target in self.targets)
        return failed and not self.confirmed

    def unreported(self) -> tuple[str, ...]:
        """The targets that have not even said that they have sent it."""
        return tuple(target for target in self.targets if not self.of(target))

    def not_begun(self) -> tuple[str, ...]:
        """The targets that have not reported, or only that they failed."""
        good = {Outcome.SENT, Outcome.ACCEPTED, Outcome.CONFIRMED}
        return tuple(t for t in self.targets if not self.of(t) & good)

    def resend_at(self, config: SupervisorConfig) -> float:
        """When to send it again. A flight block that stays without a report: ever more rarely."""
        if self.decision.action in (Action.KILL, Action.DEPLOY):
            return self.sent_at + config.resend_interval
        slower = min((self.sent_at - self.decided_at) / 4, _RAREST_RESEND)
        return self.sent_at + max(config.resend_interval, slower)

    def newest_details(self) -> str:
        """What was reported last, in words."""
        return "; ".join(self.details[-2:])


@dataclass(frozen=True)
class State:
    """The supervisor's memory. Times are monotonic s; NaN: has not happened."""

    epoch: int
    started_at: float
    stage: Stage = Stage.STARTUP
    stage_since: float = math.nan
    mode: Mode = Mode.ACTIVE
    next_id: int = 1
    links: Mapping[str, LinkEvidence] = field(default_factory=lambda: MappingProxyType({}))
    vehicle: VehicleState = field(default=VehicleState())
    vehicle_received: float = math.nan
    block: Pending | None = None
    kill: Pending | None = None
    deploy: Pending | None = None
    #: Why a deploy follows the kill; empty: none does.
    deploy_reason: str = ""
    #: When it leaves at the latest. A kill that is decided again does not put it off.
    deploy_due: float = math.nan
    #: It was in the air since the start or the reset.
    flown: bool = False
    #: (link, device) that were released before the flight: they say nothing of what happens in it.
    released_before: frozenset[tuple[str, str]] = frozenset()
    #: "link device" of those that asked to block flight and have not released it -> why.
    device_blocks: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    #: It was said that no more of them are remembered.
    block_refused: bool = False
    #: Who waits for the outcome.
    kill_tokens: tuple[int, ...] = ()
    deploy_tokens: tuple[int, ...] = ()
    alarms: tuple[str, ...] = ()

    def released(self, config: SupervisorConfig) -> frozenset[tuple[str, str]]:
        """(link, device) of every parachute that says that it is released."""
        return frozenset(
            (link, device)
            for link in config.deploy_links
            if link in self.links
            for device in self.links[link].deployed
        )

    def disarmed(self, config: SupervisorConfig, now: float) -> bool:
        """Does the autopilot say, freshly, that the motors are off?"""
        age = self.vehicle.armed_age + (now - self.vehicle_received)
        return age <= config.vehicle_state_age and self.vehicle.armed is Armed.DISARMED

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
