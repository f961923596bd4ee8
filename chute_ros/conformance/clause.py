"""A clause of a document, how it is tried, and what came of it."""

from __future__ import annotations

import enum
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from chute_ros.errors import ChuteError


class Verdict(enum.Enum):
    """What came of a clause. NOT_SUPPORTED: the document lets a device leave it out; it does."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_SUPPORTED = "not supported"
    NOT_TRIED = "not tried"


class Risk(enum.IntEnum):
    """What the device may do while a clause is tried; each includes those before it."""

    NONE = 0
    ARMS = 1
    FIRES = 2

    @property
    def option(self) -> str:
        """What of the command line allows it; empty: nothing has to."""
        return ("", "--arm", "--fire")[self]


@dataclass(frozen=True)
class Packet:
    """What was sent or received. at: s since the start; sender: who sent it, in the device's own
    way; text: its content in words."""

    at: float
    sent: bool
    sender: str
    name: str
    text: str
    raw: bytes


class DecidedError(ChuteError):
    """Ends the trial of a clause: its verdict, and why. proof: the packets that show it; none: all
    of the trial do."""

    def __init__(self, verdict: Verdict, why: str, proof: Sequence[Packet] = ()) -> None:
        super().__init__(why)
        self.verdict, self.proof = verdict, tuple(proof)


def failed(why: str, proof: Sequence[Packet] = ()) -> DecidedError:
    """It is not as the document says."""
    return DecidedError(Verdict.FAILED, why, proof)


def not_supported(why: str) -> DecidedError:
    """The device says that it does not have this, which the document allows."""
    return DecidedError(Verdict.NOT_SUPPORTED, why)


def not_tried(why: str) -> DecidedError:
    """It takes what is not there, or what the person has not allowed."""
    return DecidedError(Verdict.NOT_TRIED, why)


@dataclass(frozen=True)
class OutOfReach:
    """The trial of a clause that no bench can show. why: the reason."""

    why: str

    def __call__(self, bench: object) -> Trial:
        yield from ()
        raise not_tried(self.why)


@dataclass(frozen=True)
class Wait:
    """A trial goes on at this time (monotonic s), or as soon as ready says so. It is sent back
    whether ready did."""

    until: float
    ready: Callable[[], Any] = lambda: False


#: The option that clauses need which look on for long.
SOAK = "--soak"
#: A trial waits by yielding, and returns why it passed.
Trial = Generator[Wait, bool, str]
BenchT = TypeVar("BenchT")


#: What a device may do that is only read, or asked for what it knows.
READS, ASKS = "nothing: it is only listened to", "nothing: it is only asked for what it knows"


@dataclass(frozen=True)
class Clause(Generic[BenchT]):
    """In the order in which a document is read. document, section: where text stands, in the words
    of the document; name: without spaces, for command lines; does: what the device may do
    meanwhile; needs: the options (a space between two) without which it is not tried; without: one
    with which it is not; restarts: the device is told to start anew, which else fails the
    clause."""

    document: str
    section: str
    name: str
    text: str
    trial: Callable[[BenchT], Trial]
    does: str = ASKS
    risk: Risk = Risk.NONE
    needs: str = ""
    without: str = ""
    restarts: bool = False

    @property
    def out_of_reach(self) -> str:
        """Why no bench can show it; empty: one can."""
        return self.trial.why if isinstance(self.trial, OutOfReach) else ""


@dataclass(frozen=True)
class Result:
    """took: s."""

    clause: Clause[Any]
    verdict: Verdict
    why: str
    proof: tuple[Packet, ...]
    took: float
