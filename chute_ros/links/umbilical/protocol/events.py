"""Events of the umbilical link besides those of every link."""

from __future__ import annotations

from dataclasses import dataclass

from chute_ros.links.umbilical.protocol.layouts import Record
from chute_ros.links.umbilical.protocol.line_parser import LogLine
from chute_ros.protocol import events


@dataclass(frozen=True)
class TelemetryReceived:
    """A record. sequence: counts them from 1."""

    record: Record
    sequence: int


@dataclass(frozen=True)
class DumpStarted:
    """A memory is being dumped: "flash" or "fram". token: who asked, 0: nobody of ours.

    suffix: of a file that holds it.
    """

    token: int
    memory: str
    suffix: str


@dataclass(frozen=True)
class DumpData:
    """The next bytes of the dump that started."""

    data: bytes


@dataclass(frozen=True)
class DumpFinished:
    """The dump is over. complete: it came whole, as far as the flight computer marks it."""

    token: int
    complete: bool
    text: str


@dataclass(frozen=True)
class WorkProgress:
    """How far a long work is, in words; total 0: not known."""

    text: str
    done: int
    total: int


UmbilicalEvent = (
    events.Event
    | TelemetryReceived
    | LogLine
    | DumpStarted
    | DumpData
    | DumpFinished
    | WorkProgress
)
