"""What a rule is: conditions, how many must hold for how long, where it lives, what follows.

Rules are data, read from a profile (profile_reader.py); here are only their types.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

from chute_ros.model import Action, Airframe
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.base import Condition
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measurements import STANDARD_LIMITS, Limits


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
        return tuple(name for one in self.conditions for name in one.measured)

    @cached_property
    def asks_for_a_kill(self) -> bool:
        """One of its conditions is that any device asks for one."""
        return DeviceCondition(DeviceFact.ASKS_FOR_KILL) in self.conditions

    @cached_property
    def goes_on(self) -> bool:
        """One of its conditions may go on to hold."""
        return any(one.goes_on for one in self.conditions)

    @cached_property
    def rests_on_the_vehicle(self) -> bool:
        """All its conditions are what the vehicle tells, and nothing of what we did."""
        return all(one.rests_on_the_vehicle for one in self.conditions)

    @cached_property
    def misses_the_autopilot(self) -> bool:
        """One of its conditions is that it is lost."""
        return any(
            isinstance(one, AutopilotCondition) and one.fact is AutopilotFact.LOST
            for one in self.conditions
        )


@dataclass(frozen=True)
class Profile:
    """The rules of one kind of vehicle and what goes with them."""

    name: str
    rules: tuple[Rule, ...]
    #: What it is for.
    vehicle: Airframe = Airframe.ANY
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

    @cached_property
    def measured(self) -> frozenset[str]:
        """The measurements that its rules rest on."""
        return frozenset(name for rule in self.rules for name in rule.measured)


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
