"""Events of a UpfLink besides those of every link."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from chute_ros.links.upf.protocol.errands import ErrandDone
from chute_ros.protocol.dronecan.allocation import KeepTable
from chute_ros.protocol.events import AskSupervisor, Event


@dataclass(frozen=True)
class TriggerChanged:
    """A trigger said something, or its silence grew too long. picture: see roster."""

    picture: Mapping[str, Any]


@dataclass(frozen=True)
class ErrandFinished:
    """What was asked of a device besides flying ended."""

    token: int
    done: ErrandDone


UpfEvent = Event | TriggerChanged | ErrandFinished | AskSupervisor | KeepTable
