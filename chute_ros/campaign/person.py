"""A person at the services of the supervisor that leads; who gets no answer, or is told that
another leads, calls again."""

from __future__ import annotations

import math
from collections.abc import Callable

from chute_ros.campaign.rig import Rig
from chute_ros.supervisor import inputs as i

#: An answer is waited for so long; nobody is there: the next try comes after this, s.
_PATIENCE, _AGAIN = 2.0, 0.5
_MOST_CALLS = 12


class Call:
    """One wish. make: the input of the core with a token."""

    def __init__(self, rig: Rig, make: Callable[[int], i.Input]) -> None:
        self._rig, self._make = rig, make
        self._calls = 0
        self.answer: i.Finish | None = None
        self.answered_at = math.nan

    def begin(self, now: float) -> None:
        """Call, and again until there is an answer."""
        if self.answer is not None or self._calls >= _MOST_CALLS:
            return
        self._calls += 1
        leader = self._rig.leader
        if leader is not None:
            leader.call(self._make, self._answered)
        self._rig.world.post(now + (_AGAIN if leader is None else _PATIENCE), self.begin)

    def _answered(self, answer: i.Finish) -> None:
        if self.answer is not None:
            return
        now = self._rig.world.now
        if i.CALL_AGAIN in answer.message and not answer.accepted:
            self._rig.world.post(now + _AGAIN, self.begin)
        else:
            self.answer, self.answered_at = answer, now
