"""What the benches of all devices share: what was sent and received, and waiting for more."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from chute_ros.conformance.clause import Packet, Risk, Trial, Wait
from chute_ros.errors import ChuteError


class NotAllowedError(ChuteError):
    """A trial tried to send what the person has not allowed: a mistake of ours."""


@dataclass(frozen=True)
class ReceivedPacket:
    """What the device sent, by the name of its message. at: monotonic s."""

    at: float
    kind: str
    packet: Packet


ReceivedT = TypeVar("ReceivedT", bound=ReceivedPacket)


def in_words(fields: Mapping[str, Any]) -> str:
    """The fields of a message, as a Packet has them."""
    return ", ".join(f"{name}={value}" for name, value in fields.items())


def first_of(
    heard: Sequence[ReceivedT], since: int, fits: Callable[[ReceivedT], bool]
) -> Callable[[], ReceivedT | None]:
    """What returns the first one from this place of heard on that fits; None: it has not come.
    Each is looked at once, however often this is asked."""
    place, first = since, None

    def found() -> ReceivedT | None:
        nonlocal place, first
        while first is None and place < len(heard):
            one = heard[place]
            place += 1
            first = one if fits(one) else None
        return first

    return found


class RecordingBench(Generic[ReceivedT]):
    """heard: of the device, in their order; watched: what the last watch saw. risk: the highest
    that the person allows."""

    def __init__(self, risk: Risk = Risk.NONE) -> None:
        self.allowed = risk
        #: The highest risk of all that was done to the device so far.
        self.done = Risk.NONE
        self.now, self.heard_at = 0.0, -math.inf
        self.traffic: list[Packet] = []
        self.heard: list[ReceivedT] = []
        self.watched: list[ReceivedT] = []
        #: What the clause that is tried has judged of what came before: it proves its verdict.
        self.looked_at: list[Packet] = []
        #: How often the device was seen to start anew.
        self.starts = 0
        self._began = self._up = math.nan

    def at(self, now: float) -> None:
        """The time is now, monotonic s."""
        self.now = now
        if math.isnan(self._began):
            self._began = now

    def device_is_up(self, since_start: float, wraps: float) -> None:
        """The device tells the time since its start, which begins again at 0 after this much."""
        if 0.0 < self._up - since_start < wraps / 2.0:
            self.starts += 1
        self._up = since_start

    def takes(self, risk: Risk, what: str) -> None:
        """What is about to be done to the device has this risk; NotAllowedError: it must not."""
        if risk > self.allowed:
            raise NotAllowedError(f"{what} needs {risk.name}, allowed is {self.allowed.name}")
        self.done = max(self.done, risk)

    def noted(self, sent: bool, sender: str, name: str, text: str, raw: bytes) -> Packet:
        """Remember what was sent or received."""
        packet = Packet(self.now - self._began, sent, sender, name, text, raw)
        self.traffic.append(packet)
        return packet

    def watch(self, seconds: float) -> Trial:
        """Look on for so long; what came is watched."""
        began = self.now
        yield Wait(began + seconds)
        self.watched = [one for one in self.heard if one.at >= began]
        return ""

    def watch_once(self, seconds: float, *kinds: str) -> Any:
        """The same, unless something was watched before: for a clause that looks at what another
        one has watched, and may be tried without it. All of it, of these kinds (none: all)."""
        if not self.watched:
            yield from self.watch(seconds)
        return self.look_at(one for one in self.watched if not kinds or one.kind in kinds)

    def watch_on(self, seconds: float) -> Trial:
        """Let so long pass."""
        yield Wait(self.now + seconds)
        return ""

    def wait_for(
        self, kind: str, within: float, fits: Callable[[ReceivedT], bool] = lambda one: True
    ) -> Any:
        """The next message of this kind from the device that fits; None: none came within (s)."""
        found = first_of(self.heard, len(self.heard), lambda one: one.kind == kind and fits(one))
        yield Wait(self.now + within, found)
        return found()

    def look_at(self, heard: Iterable[ReceivedT]) -> list[ReceivedT]:
        """These, which the clause that is tried judges, and which may have come before it."""
        every = list(heard)
        self.looked_at += [one.packet for one in every]
        return every

    def packets(self, *kinds: str) -> Sequence[Packet]:
        """Of what was watched, those of these kinds."""
        return [one.packet for one in self.watched if one.kind in kinds]
