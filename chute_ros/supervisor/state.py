"""All that the supervisor's core remembers. Frozen: an update makes a new one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from chute_ros.model import Action, Decision, LinkState, VehicleState
from chute_ros.supervisor.codec import INLINE
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.counter import RuleEvidence
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.link_evidence import LinkEvidence
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import NO_SAMPLE, Measured, Sample
from chute_ros.supervisor.pending import Ask, Pending, Time

#: A measurement that is contradicted for so long is an alarm in flight and blocks it before, s.
CONTRADICTED_FOR = 1.0


@dataclass(frozen=True)
class Killing:
    """The kill that is under way, or was the last."""

    kill: Pending | None = None
    #: The kill that is under way, or was the last, was decided in flight.
    killed_in_flight: bool = False
    #: When that was, the height then, m, and how fast it sank, m/s.
    killed_at: Time = math.nan
    killed_height: float = math.nan
    killed_sinking: float = math.nan
    #: A person asked for the kill under way alone: no deploy follows it by itself.
    kill_only: bool = False
    #: That kill was decided lower than a deploy needs, as far as anybody knew.
    killed_low: bool = False
    #: It said before that kill that it stands, or is disarmed: that is not the kill's effect.
    killed_standing: bool = False


@dataclass(frozen=True)
class DeployUnderWay:
    """The deploy: what was begun of it, and what is to follow the kill."""

    #: One for each step of the ladder that was begun.
    deploys: tuple[Pending, ...] = ()
    #: Rule and reasons of the deploy that follows the kill; empty: none does.
    deploy_rule: str = ""
    deploy_reasons: tuple[str, ...] = ()
    #: The steps that it has; empty: those of the configuration.
    deploy_ladder: tuple[Rung, ...] = ()
    #: When it leaves at the latest. A kill that is decided again does not put it off.
    deploy_due: Time = math.nan
    #: Where the vehicle was when a deploy was ordered, and then when a parachute was seen to be
    #: out, m; NaN: not known.
    deploy_height: float = math.nan


@dataclass(frozen=True)
class ThisFlight:
    """This flight, and what the ground was before it."""

    #: It was in the air since the start or the reset.
    flown: bool = False
    #: It took off and has not landed since, or was not seen to.
    airborne: bool = False
    #: When it took off.
    airborne_since: Time = math.nan
    #: Since when the vehicle says that it stands and nothing contradicts it.
    down_since: Time = math.nan
    #: When it last landed.
    landed_at: Time = math.nan
    #: Seen high enough for a deploy since the take-off.
    was_high: bool = False
    #: Seen off the ground since the take-off, for so long, s.
    up_for: float = 0.0
    #: The autopilot started anew since the take-off.
    rebooted: bool = False
    #: Since when it has flown steadily after that; infinity: it does not.
    steady_since: Time = math.inf
    #: Restarts of the autopilot that had been counted on the ground.
    reboots_before: int = 0
    #: Height when it was armed, m; 0: not seen.
    armed_height: float = 0.0
    #: Height when it was last seen to take off, m; NaN: not known.
    took_off_height: float = math.nan
    #: Degrees; where it took off.
    home: tuple[float, float] | None = None
    #: Altitudes of what heights are above, m above mean sea level and in the standard atmosphere:
    #: as they were on the ground before this flight.
    home_altitude: float = math.nan
    ground_pressure_altitude: float = math.nan
    #: (link, device) that were released before the flight: they say nothing of what happens in it.
    released_before: frozenset[tuple[str, str]] = frozenset()
    #: The parachutes were armed before it, by whomever: after the flight they are disarmed again.
    armed_on_ground: bool = False


@dataclass(frozen=True)
class Alarms:
    """What a person is told until a reset."""

    alarms: tuple[str, ...] = ()
    #: When the alarm that does not stop is said next.
    alarm_at: Time = math.nan
    #: A canopy is out, does not carry, and no other parachute is left: the alarm does not stop.
    canopy_fails: bool = False


@dataclass(frozen=True)
class HeardHere:
    """What a supervisor hears itself."""

    links: Mapping[str, LinkEvidence] = field(default_factory=lambda: MappingProxyType({}))
    vehicle: VehicleState = field(default=VehicleState())
    vehicle_received: float = math.nan
    #: Parts of it that another source has lately told otherwise.
    disputed: frozenset[str] = frozenset()
    measurements: Mapping[str, Measured] = field(default_factory=lambda: MappingProxyType({}))
    #: (monotonic s, m) of the heights of the last second, the oldest first; and by the barometer.
    heights: tuple[tuple[float, float], ...] = ()
    pressure_heights: tuple[tuple[float, float], ...] = ()
    #: The same of the barometer before it was last silent; NaN: it was not.
    pressure_before: tuple[float, float] = (math.nan, math.nan)
    #: (monotonic s, vertical speed m/s, specific force m/s^2, cosine of the tilt) of the last
    #: seconds, the oldest first; NaN: not known, or in doubt.
    motion: tuple[tuple[float, float, float, float], ...] = ()
    #: Measurement -> why what it claims of a fall is not so; and since when, monotonic s.
    denied: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    denied_since: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    #: Measurement -> in words that what it claims of a fall was commanded.
    commanded: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    #: The vertical speed that was commanded last, m/s; NaN: none, or of motors that are off, or
    #: the autopilot has reported since and commands none.
    commanded_speed: Sample = NO_SAMPLE
    #: Measurement -> what it told that cannot be; it is not used until it tells what can.
    unfit: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    #: Since when it tells otherwise of its fitness on the ground, monotonic s.
    fitness_since: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    #: By the barometer on the height of its take-off, and not moving, since, monotonic s.
    at_ground_since: float = math.nan
    #: Nothing has moved since, whatever the autopilot says of being in the air, monotonic s.
    still_since: float = math.nan
    #: Since when it says that it stands with its motors off, and feels its weight.
    rests_since: float = math.nan
    #: Why the vehicle must not fly, as last raised as an alarm in flight.
    faults_told: tuple[str, ...] = ()


@dataclass(frozen=True)
class Own:
    """What concerns this supervisor alone."""

    #: It holds the lease: what it decides is sent. One that follows only looks on.
    leading: bool = True
    updated_at: float = math.nan
    #: Updates that came later than their deadline allows.
    late_count: int = 0
    #: Until then time alone changes nothing of what is known of the vehicle, monotonic s;
    #: -infinity: nobody has looked.
    vehicle_rests_until: float = -math.inf
    #: What was said last of what the rules do not see of this vehicle.
    not_seen: str = ""
    #: Who waits for the outcome.
    kill_tokens: tuple[int, ...] = ()
    deploy_tokens: tuple[int, ...] = ()


@dataclass(frozen=True)
class State:
    """The supervisor's memory. Times are monotonic s; NaN: has not happened. Those that
    follow share all but heard and own."""

    epoch: int
    started_at: Time
    stage: Stage = Stage.STARTUP
    stage_since: Time = math.nan
    mode: Mode = Mode.ACTIVE
    next_id: int = 1
    #: What was decided last, also where that was only said.
    newest: Decision | None = None
    rules: Mapping[str, RuleEvidence] = field(default_factory=lambda: MappingProxyType({}))
    #: "link device" -> its newest wish for a kill.
    asks: Mapping[str, Ask] = field(default_factory=lambda: MappingProxyType({}))
    block: Pending | None = None
    #: "link device" of those that asked to block flight and have not released it -> why.
    device_blocks: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    #: (link, device) that have reported released since the last reset, whoever released them. One
    #: that starts anew and has forgotten it stays until a person resets.
    released_since_reset: frozenset[tuple[str, str]] = frozenset()
    #: (link, device) that said last that they are armed, however long ago: one that is received
    #: and says otherwise ends it, or a reset.
    last_armed: frozenset[tuple[str, str]] = frozenset()
    #: It was said that no more of them are remembered.
    block_refused: bool = False
    killing: Killing = field(default=Killing(), metadata=INLINE)
    deploying: DeployUnderWay = field(default=DeployUnderWay(), metadata=INLINE)
    flight: ThisFlight = field(default=ThisFlight(), metadata=INLINE)
    alarming: Alarms = field(default=Alarms(), metadata=INLINE)
    heard: HeardHere = field(default=HeardHere(), metadata=INLINE)
    own: Own = field(default=Own(), metadata=INLINE)

    @property
    def flight_blocked(self) -> bool:
        """Device nodes were told to keep the vehicle on the ground."""
        block = self.block.decision if self.block is not None else None
        return block is not None and block.action is Action.FLIGHT_BLOCK and not block.shadow

    @property
    def deploy(self) -> Pending | None:
        """The newest step of the ladder."""
        return self.deploying.deploys[-1] if self.deploying.deploys else None

    def ladder(self, config: SupervisorConfig) -> tuple[Rung, ...]:
        """The steps of the deploy, without those whose parachutes were out when it was ordered;
        one that launches itself has the first."""
        return self.deploying.deploy_ladder or config.ladder

    def asking(self, now: float) -> dict[str, Ask]:
        """The devices that want a kill now, each with what it asked."""
        return {who: ask for who, ask in self.asks.items() if now < ask.ends_at}

    def measured(self, name: str) -> Measured:
        """What is known of a measurement."""
        return self.heard.measurements.get(name, _NEVER_MEASURED)

    def evidence(self, link: str) -> LinkEvidence:
        """What is known of a link."""
        return self.heard.links.get(link, _NEVER_HEARD)

    def hears(self, config: SupervisorConfig, link: str, now: float) -> bool:
        """What this link says counts now."""
        return self.evidence(link).is_heard(config.limits(link), now)

    def unmonitored(self, link: str) -> bool:
        """Its node says that of its device nothing can be known."""
        return self.evidence(link).reported is LinkState.UNMONITORED

    def links_heard(self, config: SupervisorConfig, now: float) -> int:
        """How many links have a node that is not silent; the vehicle counts as one more."""
        links = [
            not self.evidence(link).silent(config.limits(link).lost_after, now)
            for link in config.links
        ]
        return sum(links) + (now - self.heard.vehicle_received <= config.vehicle_state_age)

    def newest_heartbeat(self) -> float:
        """When any link was last heard, monotonic s; NaN: none ever was."""
        heard = (one.heard for one in self.heard.links.values())
        return max((one for one in heard if not math.isnan(one)), default=math.nan)

    def rule(self, name: str) -> RuleEvidence:
        """What is known of a rule."""
        return self.rules.get(name, _NEVER_COUNTED)

    def released(self, config: SupervisorConfig) -> frozenset[tuple[str, str]]:
        """(link, device) of every parachute that says that it is released."""
        return frozenset(
            (link, device)
            for link in config.deploy_links
            for device in self.evidence(link).deployed
        )

    def armed(self) -> list[tuple[str, str]]:
        """(link, device) of every parachute that is received and armed."""
        return [one for one in sorted(self.last_armed) if self.receives(*one)]

    def receives(self, link: str, device: str) -> bool:
        """The node of this link said last that it receives this device."""
        status = self.evidence(link).devices.get(device)
        return status is not None and status.link_state is LinkState.OK

    def newly_released(self, config: SupervisorConfig, now: float) -> frozenset[tuple[str, str]]:
        """Those that were not before the flight, on links that are heard."""
        return frozenset(
            (link, device)
            for link, device in self.released(config) - self.flight.released_before
            if self.hears(config, link, now)
            or now < self.evidence(link).released_at + config.limits(link).lost_after
        )


_NEVER_MEASURED, _NEVER_HEARD, _NEVER_COUNTED = Measured(), LinkEvidence(), RuleEvidence()
