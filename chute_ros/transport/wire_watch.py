"""Troubles of an open wire, and the clients that send frames."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, Protocol, runtime_checkable

from chute_ros.transport.wire import Wire
from chute_ros.transport.wire_events import WireTrouble


@runtime_checkable
class WatchfulWire(Protocol):
    """A wire that can be in trouble while it is open."""

    def look(self, now: float) -> str:
        """Look at the clock. Returns what is wrong, in words; empty: nothing is."""


@runtime_checkable
class ServingWire(Protocol):
    """A wire that keeps places for clients."""

    def frame_heard(self, stream: Hashable, now: float) -> None:
        """What this stream sent held a frame."""


class WireWatch:
    """Of one wire. frames: how many frames the protocol has taken; None: all that comes counts.
    deliver: gets a WireTrouble whenever it changes."""

    def __init__(
        self, wire: Wire, frames: Callable[[], int] | None, deliver: Callable[[list[Any]], None]
    ) -> None:
        self._watchful = wire if isinstance(wire, WatchfulWire) else None
        self._serving = wire if isinstance(wire, ServingWire) else None
        self._frames = frames
        self._before = 0
        self._deliver = deliver
        self._trouble = ""

    def before_data(self) -> None:
        """Data is about to be given to the protocol."""
        if self._frames is not None:
            self._before = self._frames()

    def data_heard(self, stream: Hashable, now: float) -> None:
        """The protocol has data of this stream."""
        framed = self._frames is None or self._frames() > self._before
        if self._serving is not None and framed:
            self._serving.frame_heard(stream, now)

    def look(self, now: float) -> None:
        """Look at the clock."""
        text = "" if self._watchful is None else self._watchful.look(now)
        if text != self._trouble:
            self._trouble = text
            self._deliver([WireTrouble(text)])
