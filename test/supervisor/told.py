"""A finding that was asked for its words."""

from __future__ import annotations

from typing import NamedTuple

from chute_ros.supervisor.conditions.base import Condition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.state import State


class Told(NamedTuple):
    """As a Finding."""

    holds: bool | None
    text: str
    samples: int = -1


def told(config: SupervisorConfig, state: State, condition: Condition, now: float) -> Told:
    """Look at a condition, and ask for the words."""
    found = condition.find(config, state, now)
    return Told(found.holds, found.text, found.samples)
