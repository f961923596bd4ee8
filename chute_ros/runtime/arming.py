"""Arming through the device nodes: the supervisor calls each one's arm service and waits."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

from chute_ros.supervisor.inputs import ArmDevices, ArmDone

#: A device node's arm service that has not answered by then is given up, s.
ARM_TIMEOUT = 10.0


#: Gets success, message and monotonic s.
Answered = Callable[[bool, str, float], None]


class ArmCaller(Protocol):
    """Calls the arm services of device nodes."""

    def arm(self, link: str, order: ArmDevices, answered: Answered) -> str:
        """Call that of this link; answered gets the answer. Returns why it cannot be called;
        empty: it was."""


class DeviceArming:
    """One round for each order; tell gets the ArmDone once every link has answered."""

    def __init__(self, caller: ArmCaller, tell: Callable[[ArmDone, float], None]) -> None:
        self._caller, self._tell = caller, tell
        self._rounds: dict[int, tuple[ArmDevices, dict[str, tuple[bool, str]], float]] = {}

    def begin(self, order: ArmDevices, now: float) -> None:
        """Call the services that the order names. now: monotonic s."""
        self._rounds[order.token] = (order, {}, now + ARM_TIMEOUT)
        for link in order.links:
            answered = partial(self._answered, order.token, link)
            if refusal := self._caller.arm(link, order, answered):
                answered(False, refusal, now)

    def give_up(self, now: float) -> None:
        """Look at the clock: a link that does not answer has failed."""
        for token, (order, answers, until) in list(self._rounds.items()):
            if now >= until:
                for link in [link for link in order.links if link not in answers]:
                    late = f"no answer within {ARM_TIMEOUT:g} s"
                    self._answered(token, link, False, late, now)

    def _answered(self, token: int, link: str, success: bool, message: str, now: float) -> None:
        if token not in self._rounds:
            return
        order, answers, _ = self._rounds[token]
        answers[link] = (success, message)
        if len(answers) < len(order.links):
            return
        del self._rounds[token]
        text = "; ".join(f"{name}: {answers[name][1]}" for name in order.links)
        success = all(answer[0] for answer in answers.values())
        self._tell(ArmDone(token, order.arm, success, text), now)
