"""A deploy that the controller does not answer goes to the triggers directly.

Source: Flyfire UPF UAVCAN protocol V1.0, "system architecture": the trigger is usually driven by
the controller, but open to the vehicle. A controller that refuses is not gone round while it
lives; one that accepts and then falls silent, or starts anew, is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chute_ros.protocol.dronecan.calls import Call


@dataclass
class _Watched:
    #: What the controller must answer; None: there is no controller.
    call: Call | None
    fire_at: float
    wait: float
    begun: bool
    answered: bool = False
    accepted: bool = False


class LastResort:
    """Watches deploys under way. interval: between two tries at the triggers, s."""

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self._watched: dict[int, _Watched] = {}

    def watch(self, token: int, call: Call | None, now: float, wait: float) -> None:
        """The controller must answer this call of the deploy with this token within wait s.
        None: the triggers are fired anyway; it is only repeated."""
        self._watched[token] = _Watched(call, now + wait, wait, begun=call is None)

    def answered(self, call: Call, accepted: bool) -> None:
        """The controller answered this call, perhaps long after it was given up."""
        for one in self._watched.values():
            if one.call == call:
                one.answered, one.accepted = True, accepted
                one.fire_at = math.inf

    def answered_by(self) -> set[int]:
        """Node ids of the controllers that answered a deploy which has not ended."""
        return {one.call.server for one in self._watched.values() if one.call and one.answered}

    def silent(self, node_id: int, now: float) -> None:
        """This controller is not heard any more: whatever it answered, it will not do."""
        for one in self._of(node_id):
            if one.answered:
                one.answered, one.fire_at = False, now

    def restarted(self, node_id: int, now: float) -> None:
        """This controller started anew: what it had accepted it knows no more."""
        for one in self._of(node_id):
            if one.answered:
                one.answered = False
                one.fire_at = now if one.accepted else now + one.wait

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

    def _of(self, node_id: int) -> list[_Watched]:
        return [one for one in self._watched.values() if one.call and one.call.server == node_id]
