"""A flight that was recorded without this suite, as its autopilot would have told of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from chute_ros.errors import ChuteError
from chute_ros.model import Airframe, airframes_of

#: No link carries a message of one kind more often than this, s.
_APART = 0.02


class LogError(ChuteError):
    """A file cannot be read as a log. The text names the file and the reason."""


def reason(error: Exception) -> str:
    """An error of a library in words."""
    return str(error) or type(error).__name__


@dataclass
class FlightLog:
    """messages: (s from the start, message of the dialect), in the order of time; their
    time_boot_ms is filled in as they are sent, unless they came over a link (as_sent)."""

    path: Path
    #: Which format, in words.
    format: str
    #: HEARTBEAT.type and HEARTBEAT.autopilot.
    vehicle_type: int
    autopilot: int
    messages: list[tuple[float, Any]]
    #: Of the autopilot, by name.
    parameters: Mapping[str, float] = field(default_factory=dict)
    #: They are what came over a radio or a cable, at its rates; otherwise each kind comes as often
    #: as it is asked for, and was recorded.
    as_sent: bool = False
    #: What a reader must be told of the file.
    remarks: list[str] = field(default_factory=list)

    @property
    def duration(self) -> float:
        """s."""
        return self.messages[-1][0] if self.messages else 0.0

    @property
    def profile(self) -> str:
        """The shipped profile for what flew."""
        kinds = airframes_of(self.vehicle_type)
        fitting = (one for one in (Airframe.ROCKET, Airframe.FIXED_WING) if one in kinds)
        return next(fitting, Airframe.MULTIROTOR).value


class MessageLog:
    """Messages of one log as they are read: those that a link would carry."""

    def __init__(self) -> None:
        self._messages: list[tuple[float, Any]] = []
        self._newest: dict[tuple[int, Any], float] = {}

    def add(self, at: float, message: Any, which: Any = None) -> None:
        """which: of several of a kind. What comes sooner after the one before than any link
        carries it is left out; message None: nothing was told."""
        if message is None:
            return
        key = (message.get_msgId(), which)
        # A hundredth of a step: times are rounded.
        if math.isfinite(at) and at - self._newest.get(key, -math.inf) >= _APART * 0.99:
            self._newest[key] = at
            self._messages.append((at, message))

    def add_change(self, at: float, message: Any) -> None:
        """A message that is left out only if it is None."""
        if message is not None and math.isfinite(at):
            self._messages.append((at, message))

    def seconds(self) -> list[float]:
        """One moment of each second in which there is a message."""
        found = {math.floor(at): at for at, _ in reversed(self._messages)}
        return sorted(found.values())

    def in_order(self) -> list[tuple[float, Any]]:
        """From the first on, whose time is 0."""
        ordered = sorted(self._messages, key=lambda one: one[0])
        return [(at - ordered[0][0], message) for at, message in ordered]
