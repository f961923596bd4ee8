"""Texts for the ground station: reasons of a flight block, and the outcome of each order.

Each text begins with what matters most, for a small screen shows the first words only.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from chute_ros.links.mavlink.protocol.status_texts import chunked
from chute_ros.model import Outcome
from chute_ros.protocol.events import Event, RequestFinished, RequestReport
from chute_ros.protocol.mavlink.dialect import dialect

#: Another reason of the block is said no more often than this, s; the newest one wins.
REASON_INTERVAL = 2.0
#: A reason that stands is said again after this, s, as autopilots do with what keeps them from
#: arming (ArduPilot: each 30 s): a text is not acknowledged, and a ground station may join late.
REASON_AGAIN = 30.0
#: Orders whose end is waited for, at most, and texts that wait to be sent.
_MOST_ORDERS, _MOST_TEXTS = 32, 8
_LAST_ID = 65535

_CRITICAL: int = dialect.MAV_SEVERITY_CRITICAL
_WARNING: int = dialect.MAV_SEVERITY_WARNING


class Announcements:
    """Texts that are to be sent, oldest first. Times are monotonic s."""

    def __init__(self) -> None:
        self._texts: list[tuple[str, int]] = []
        self._reason = self._said = ""
        self._said_at = -math.inf
        self._again = False
        #: Token of a request -> what it was.
        self._orders: dict[int, str] = {}
        self._refused: set[int] = set()
        self._last_id = 0

    def reason(self, text: str) -> None:
        """Why flight is blocked; empty: it is not. Whether it is waits for nothing."""
        if bool(text) != bool(self._reason):
            self._said_at, self._again = -math.inf, False
        self._reason = text

    def reason_stands(self, listened_since: float, now: float) -> None:
        """It may be said again: who reads it listens since then, monotonic s."""
        unread = self._said_at < listened_since or now >= self._said_at + REASON_AGAIN
        self._again |= bool(self._reason) and unread

    def say(self, text: str, severity: int = _CRITICAL) -> None:
        """Say this once."""
        if len(self._texts) < _MOST_TEXTS:
            self._texts.append((text, severity))

    def ordered(self, token: int, what: str) -> None:
        """A request ("KILL", "DEPLOY") was begun: this is said, and so is its end."""
        if len(self._orders) < _MOST_ORDERS:
            self._orders[token] = what
            self.say(f"{what} ordered")

    def heard(self, events: Iterable[Event]) -> None:
        """What became of requests, of others as well."""
        for event in events:
            if isinstance(event, RequestReport):
                report = event.report
                what = self._orders.get(report.token)
                new = report.token not in self._refused
                if what is not None and report.outcome is Outcome.REFUSED and new:
                    self._refused.add(report.token)
                    self.say(f"{what} refused, still trying: {report.detail}")
            elif isinstance(event, RequestFinished):
                finished = event.finished
                what = self._orders.pop(finished.token, None)
                self._refused.discard(finished.token)
                if what is not None:
                    end = "confirmed" if finished.success else "FAILED"
                    self.say(f"{what} {end}: {finished.message}")

    def take(self, now: float) -> list[Any]:
        """The messages to send now; each is handed out once."""
        texts, self._texts = self._texts, []
        if self._reason_due() and now >= self._said_at + REASON_INTERVAL:
            self._said, self._said_at, self._again = self._reason, now, False
            text = f"{self._said}: flight blocked" if self._said else "flight block released"
            texts.append((text, _WARNING))
        return [part for text, severity in texts for part in self._chunks(text, severity)]

    def next_deadline(self) -> float:
        """When there is something to send; infinity: not until more is heard."""
        if self._texts:
            return -math.inf
        return self._said_at + REASON_INTERVAL if self._reason_due() else math.inf

    def _reason_due(self) -> bool:
        return self._reason != self._said or self._again

    def _chunks(self, text: str, severity: int) -> list[Any]:
        self._last_id = self._last_id % _LAST_ID + 1
        return chunked(text, severity, self._last_id)
