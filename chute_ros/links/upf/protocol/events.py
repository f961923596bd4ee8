"""Events of a UpfLink besides those of every link."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from chute_ros.links.upf.protocol.bus_requests import BusRequestDone
from chute_ros.protocol.dronecan.allocation import KeepTable
from chute_ros.protocol.events import AskSupervisor, Event


@dataclass(frozen=True)
class TriggerChanged:
    """A trigger said something, or its silence grew too long. picture: see device table; received:
    when its newest data was, monotonic s."""

    picture: Mapping[str, Any]
    received: float


@dataclass(frozen=True)
class BusRequestFinished:
    """What was asked of a device besides flying ended."""

    token: int
    done: BusRequestDone


UpfEvent = Event | TriggerChanged | BusRequestFinished | AskSupervisor | KeepTable
