"""Conditions of rules. Each owns how it is read, found, waited for, and what it depends on."""

from __future__ import annotations

from chute_ros.supervisor.conditions.autopilot import AutopilotCondition
from chute_ros.supervisor.conditions.base import Condition
from chute_ros.supervisor.conditions.device import DeviceCondition
from chute_ros.supervisor.conditions.link import LinkCondition
from chute_ros.supervisor.conditions.measurement import MeasurementCondition

_KINDS: tuple[type[Condition], ...] = (
    MeasurementCondition,
    LinkCondition,
    AutopilotCondition,
    DeviceCondition,
)
#: The key of a profile -> the kind of condition that it names.
CONDITIONS = {kind.key: kind for kind in _KINDS}
