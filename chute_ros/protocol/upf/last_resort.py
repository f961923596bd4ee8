"""A deploy that the controller does not answer goes to the triggers directly.

Source: Flyfire UPF UAVCAN protocol V1.0, "system architecture": the trigger is usually driven by
the controller, but open to the vehicle. A controller that refuses is not gone round; one that
accepts and then falls silent is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass
class _Watched:
    node_id: int
    fire_at: float
    begun: bool = False
    accepted: bool = False


class LastResort:
    """Watches deploys under way. interval: between two tries at the triggers, s."""

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self._watched: dict[int, _Watched] = {}

    def watch(self, token: int, node_id: int, due: float, begun: bool = False) -> None:
        """The controller with this node id must answer the deploy with this token by due.
        begun: the triggers are fired anyway; it is only repeated."""
        self._watched[token] = _Watched(node_id, due, begun)

    def answered(self, node_id: int, accepted: bool) -> None:
        """This controller answered a deploy. One that accepted may yet fall silent."""
        for token in [t for t, one in self._watched.items() if one.node_id == node_id]:
            if accepted:
                self._watched[token].accepted = True
                self._watched[token].fire_at = math.inf
            else:
                del self._watched[token]

    def accepted_by(self) -> set[int]:
        """Node ids of the controllers that have accepted a deploy which has not ended."""
        return {one.node_id for one in self._watched.values() if one.accepted}

    def silent(self, node_id: int, now: float) -> None:
        """This controller is not heard any more."""
        for one in self._watched.values():
            if one.node_id == node_id and one.accepted:
                one.accepted, one.fire_at = False, now

    def over(self, token: int) -> None:
        """It ended."""
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
