"""What the protocol of a link tells its owner. Times are monotonic seconds."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Any

from chute_ros.model import Outcome, ParachuteStatus, VehicleState
from chute_ros.protocol.goal import NO_ANSWER, EffectFinished, Report
from chute_ros.protocol.liveness import LinkChange


class Severity(enum.IntEnum):
    """How much a notice matters."""

    INFO = 0
    WARNING = 1
    ERROR = 2


@dataclass(frozen=True)
class ParachuteChanged:
    """A parachute of ours said something, or its silence grew too long. received: when its newest
    data was, monotonic s; NaN: never."""

    status: ParachuteStatus
    received: float


@dataclass(frozen=True)
class VehicleChanged:
    """Whoever knows the vehicle said something, or its silence grew too long. made: when the ages
    of state were counted, monotonic s."""

    state: VehicleState
    made: float


@dataclass(frozen=True)
class DeviceLinkChanged:
    """A device ("parachute 1/161") was first heard, fell silent, or came back."""

    name: str
    change: LinkChange


@dataclass(frozen=True)
class RequestReport:
    """A request got a step further."""

    report: Report


@dataclass(frozen=True)
class RequestFinished:
    """A request ended. data: what was asked for (a message, values), or None."""

    finished: EffectFinished
    data: Any = None


@dataclass(frozen=True)
class Notice:
    """Something that a person should read."""

    severity: Severity
    text: str


class SafetyAsk(enum.IntEnum):
    """What a device asks of the vehicle; numbers of chute_msgs/SafetyRequest."""

    KILL = 1
    FLIGHT_BLOCK = 2
    FLIGHT_BLOCK_RELEASE = 3


@dataclass(frozen=True)
class AskSupervisor:
    """Pass this on to the supervisor on the device's behalf."""

    ask: SafetyAsk
    device: str
    reason: str


Event = (
    ParachuteChanged
    | VehicleChanged
    | DeviceLinkChanged
    | RequestReport
    | RequestFinished
    | Notice
    | AskSupervisor
)


class EventLog:
    """What happened, until the owner takes it."""

    def __init__(self) -> None:
        self._events: list[Any] = []

    def notice(self, severity: Severity, text: str) -> None:
        """Put a notice among the events."""
        self._events.append(Notice(severity, text))

    def link_changed(self, name: str, changes: list[LinkChange]) -> None:
        """So the link of the device with this name changed."""
        self._events += [DeviceLinkChanged(name, change) for change in changes]

    def take_events(self) -> list[Any]:
        """New events, oldest first; each is handed out once."""
        events, self._events = self._events, []
        return events


def ended(
    token: int, outcome: Outcome, text: str, sent: bool = False, shown: bool = False
) -> tuple[RequestReport, RequestFinished]:
    """What is told of the end of a request that no loop (effect.py) carried through."""
    success = outcome is Outcome.CONFIRMED
    finished = EffectFinished(token, success, False, NO_ANSWER, text, sent, shown)
    return RequestReport(Report(token, outcome, text)), RequestFinished(finished)


def failed_request(token: int, why: str) -> RequestFinished:
    """The end of a request that could not be begun."""
    return ended(token, Outcome.FAILED, why)[1]
