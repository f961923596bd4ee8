"""What a rule is: conditions, how many must hold for how long, where it lives, what follows.

Rules are data, read from a profile (profile_reader.py); here are only their types.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import ClassVar

from chute_ros.model import Action
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measurements import (
    CLIMB_RATE,
    DERIVED,
    FALL_SIGNS,
    STANDARD_LIMITS,
    VERTICAL_SPEED,
    Limits,
)

#: Instead of a link's name: it is enough if one is so, or all must be.
ANY, ALL = "any", "all"


class Clears(enum.Enum):
    """When a rule that was acted on is done with."""

    NEVER = "never"  # until a reset
    ON_DISARM = "on_disarm"
    BY_ITSELF = "by_itself"  # when its counter has leaked to 0


class BelowMinimum(enum.Enum):
    """What a profile allows below its minimum height, where a rule wants a deploy."""

    DEPLOY = "deploy"
    KILL = "kill"
    NOTHING = "nothing"


class AutopilotFact(enum.Enum):
    """What can be true of the autopilot."""

    LOST = "lost"  # vehicle/state, or the autopilot behind it, is silent
    REBOOTED = "rebooted"  # it started anew in flight
    DISARMED = "disarmed"  # it says that the motors are off
    EMERGENCY = "emergency"  # it says MAV_STATE_EMERGENCY or MAV_STATE_FLIGHT_TERMINATION
    #: We stopped its motors in the air, so long ago that it still falls, and nothing tells how.
    KILLED_ALOFT = "killed_aloft"
    #: We stopped its motors in the air, which is confirmed, and nobody asked for the kill alone.
    MOTORS_STOPPED = "motors_stopped"


class DeviceFact(enum.Enum):
    """What can be true of a device on a link."""

    ASKS_FOR_KILL = "asks_for_kill"
    DEPLOYED = "deployed"
    ABNORMAL = "abnormal"


@dataclass(frozen=True)
class MeasurementCondition:
    """A usable measurement, or one of DERIVED, is above or below a limit (NaN: not asked for)."""

    measurement: str
    above: float = math.nan
    below: float = math.nan
    weight: float = 1.0
    #: Where nothing usable tells, it is taken to hold: a second sign that may be missing.
    if_unknown: bool = False
    #: Once the rule's counter is full, it goes on to hold until it is beyond this (or LINGERS
    #: have passed); NaN: it does not.
    until: float = math.nan
    #: Of a wing that leans as it was commanded it is a dive, and does not hold.
    unless_dived: bool = False
    counted: ClassVar[bool] = True

    @cached_property
    def limits(self) -> str:
        """What is asked for, in words; made once, as it is told at every update."""
        above = [f"above {self.above:g}"] if not math.isnan(self.above) else []
        below = [f"below {self.below:g}"] if not math.isnan(self.below) else []
        until = f", then until {self.until:g}" if not math.isnan(self.until) else ""
        return " and ".join(above + below) + until

    def lingers(self, value: float) -> bool:
        """Where it has held for long enough, it is not over yet by this value."""
        if math.isnan(self.until):
            return False
        return not (value <= self.until if math.isnan(self.below) else value >= self.until)


@dataclass(frozen=True)
class LinkCondition:
    """A link, any or all of the required ones, is judged as one of these. Silence proves
    nothing about the vehicle: alone it never deploys."""

    link: str
    judged: tuple[LinkJudgement, ...]
    weight: float = 1.0
    counted: ClassVar[bool] = True


@dataclass(frozen=True)
class AutopilotCondition:
    """The autopilot is so.

    counted False: the rule's counter goes up without it as well. It must hold once the rule is
    acted on; but what has been waited for already, as silence has, need not be waited for twice.
    """

    fact: AutopilotFact
    weight: float = 1.0
    counted: bool = True


@dataclass(frozen=True)
class DeviceCondition:
    """A device on this link (or any) is so."""

    fact: DeviceFact
    link: str = ANY
    weight: float = 1.0
    counted: ClassVar[bool] = True


Condition = MeasurementCondition | LinkCondition | AutopilotCondition | DeviceCondition


def is_silence(condition: Condition) -> bool:
    """Does it tell only that somebody is not heard, or may it?"""
    if isinstance(condition, MeasurementCondition):
        return condition.if_unknown
    if isinstance(condition, AutopilotCondition):
        return condition.fact is AutopilotFact.LOST
    return isinstance(condition, LinkCondition)


@dataclass(frozen=True)
class Rule:
    """One rule. Fulfilled once the weights of the true conditions have been at least needed, for
    hold s by a counter that goes up while they are and leaks leak s each s while they are not.
    (Without those that are not counted, until they are true as well.)"""

    name: str
    conditions: tuple[Condition, ...]
    #: NONE: it only raises an alarm.
    action: Action
    states: tuple[Stage, ...]
    needed: float
    hold: float = 0.0
    leak: float = 0.5
    #: Distinct samples that must have shown it, where it rests on measurements.
    samples: int = 1
    #: So much of its weight a measurement counts that is in doubt (Measured.doubt), 0 to 1.
    doubted: float = 1.0
    clears: Clears = Clears.NEVER
    #: What it means, and where its values come from, in words.
    says: str = ""
    source: str = ""

    @cached_property
    def measured(self) -> tuple[str, ...]:
        """The measurements that it rests on."""
        known = (one for one in self.conditions if isinstance(one, MeasurementCondition))
        return tuple(
            name for one in known for name in DERIVED.get(one.measurement, (one.measurement,))
        )

    @cached_property
    def asks_the_autopilot(self) -> bool:
        """One of its conditions is what the autopilot says of itself."""
        return any(isinstance(one, AutopilotCondition) for one in self.conditions)

    @cached_property
    def asks_for_a_kill(self) -> bool:
        """One of its conditions is that any device asks for one."""
        return DeviceCondition(DeviceFact.ASKS_FOR_KILL) in self.conditions

    @cached_property
    def has_until(self) -> bool:
        """One of its conditions may go on to hold."""
        conditions = (one for one in self.conditions if isinstance(one, MeasurementCondition))
        return any(not math.isnan(one.until) for one in conditions)

    @cached_property
    def silences(self) -> frozenset[str]:
        """The measurements of which it may come to hold as they are told no more."""
        names = {
            one.measurement
            for one in self.conditions
            if isinstance(one, MeasurementCondition) and one.if_unknown
        }
        if self.asks_for_a_kill_aloft:
            names |= set(FALL_SIGNS)
        # The vertical speed is told by the heights as well.
        derived = names & DERIVED.keys() | ({CLIMB_RATE} if VERTICAL_SPEED in names else set())
        told_by = {name for one in derived for name in DERIVED[one]}
        return frozenset(names - DERIVED.keys() | told_by)

    @cached_property
    def turned_by_time(self) -> frozenset[str]:
        """The measurements of which it may come to hold though nothing new is told."""
        return self.silences if self.doubted == 1.0 else self.silences.union(self.measured)

    @cached_property
    def rests_on_the_vehicle(self) -> bool:
        """All its conditions are what the vehicle tells, and nothing of what we did."""
        kinds = (MeasurementCondition, AutopilotCondition)
        ours = self.asks_for_a_kill_aloft or self.asks(AutopilotFact.MOTORS_STOPPED)
        return not ours and all(isinstance(one, kinds) for one in self.conditions)

    @cached_property
    def asks_for_a_kill_aloft(self) -> bool:
        """One of its conditions is AutopilotFact.KILLED_ALOFT."""
        return self.asks(AutopilotFact.KILLED_ALOFT)

    def asks(self, fact: AutopilotFact) -> bool:
        """One of its conditions is this of the autopilot."""
        return any(
            isinstance(one, AutopilotCondition) and one.fact is fact for one in self.conditions
        )


@dataclass(frozen=True)
class Profile:
    """The rules of one kind of vehicle and what goes with them."""

    name: str
    rules: tuple[Rule, ...]
    #: m above take-off.
    minimum_height: float = 0.0
    below_minimum: BelowMinimum = BelowMinimum.DEPLOY
    #: m above home, or above where it took off if that is lower. What falls from below it has no
    #: time to wait long for a kill; 0: nothing is low.
    low_height: float = 0.0
    #: Faster than this (m/s, up or down), no landed state is believed.
    moving_speed: float = 2.0
    #: How long a vehicle that flew must say that it has landed, s.
    landed_hold: float = 0.0
    limits: Mapping[str, Limits] = field(
        default_factory=lambda: MappingProxyType(dict(STANDARD_LIMITS))
    )


#: What holds for any vehicle: the motors stop when its parachute asks for it, or is out.
DEVICE_RULES = (
    Rule(
        "device asks for a kill",
        (DeviceCondition(DeviceFact.ASKS_FOR_KILL),),
        Action.KILL,
        tuple(Stage),
        needed=1.0,
        clears=Clears.BY_ITSELF,
    ),
    Rule(
        "parachute open",
        (DeviceCondition(DeviceFact.DEPLOYED),),
        Action.KILL,
        (Stage.IN_FLIGHT, Stage.DEPLOYED),
        needed=1.0,
        clears=Clears.BY_ITSELF,
    ),
)
