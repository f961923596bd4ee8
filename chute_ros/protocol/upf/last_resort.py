"""A deploy that the controller does not acknowledge goes to the triggers directly.

Source: Flyfire UPF UAVCAN protocol V1.0, "system architecture": the trigger is usually driven by
the controller, but open to the vehicle. A controller that answers, and be it with a refusal, is
not gone round.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class _Watched:
    due: float
    fire_at: float
    begun: bool = False


class LastResort:
    """Watches deploys under way. interval: between two tries at the triggers, s."""

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self._watched: dict[int, _Watched] = {}

    def watch(self, token: int, due: float) -> None:
        """The deploy with this token must be acknowledged by due."""
        self._watched[token] = _Watched(due, due)

    def over(self, token: int) -> None:
        """It was acknowledged, answered or ended."""
        self._watched.pop(token, None)

    def update(self, now: float) -> tuple[list[int], bool]:
        """(tokens whose last resort begins now, whether the triggers are to be fired now)."""
        begun, fire = [], False
        for token, one in self._watched.items():
            if now >= one.fire_at:
                if not one.begun:
                    one.begun = True
                    begun.append(token)
                one.fire_at = now + self._interval
                fire = True
        return begun, fire

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        return min((one.fire_at for one in self._watched.values()), default=math.inf)
