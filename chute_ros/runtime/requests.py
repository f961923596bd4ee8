"""Requests to a link: each has a token, and whoever waits for it gets its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Any

from chute_ros.model import Decision, Outcome
from chute_ros.runtime.shell import Shell

#: Calls the link: (link, token, now).
Begin = Callable[[Any, int, float], None]
#: Of a link: the device that a request needs was heard.
Ready = Callable[[Any], bool]


@dataclass(frozen=True)
class CallFailed:
    """A request could not even be begun, by a mistake of ours."""

    token: int
    text: str


class RequestTracker:
    """report: tells the supervisor how far a decision got."""

    def __init__(self, shell: Shell, report: Callable[[Decision, Outcome, str], None]) -> None:
        self._shell, self._report = shell, report
        self._tokens = count(1)
        self._waiting: dict[int, Callable[[Any], None]] = {}
        self._decisions: dict[int, Decision] = {}
        #: Those that wait for their device: (token, begin, ready, until). Of the link's turn.
        self._held: list[tuple[int, Begin, Ready, float]] = []

    @property
    def holds(self) -> bool:
        """A request waits for its device."""
        return bool(self._held)

    def request(self, begin: Begin, answered: Callable[[Any], None]) -> None:
        """Have begin called in the link's turn; answered gets its end."""
        token = next(self._tokens)
        self._waiting[token] = answered
        self._call(token, begin)

    def request_for(self, decision: Decision, begin: Begin) -> None:
        """The same on behalf of a decision: its steps are reported on safety/action."""
        token = next(self._tokens)
        self._decisions[token] = decision
        self._call(token, begin)

    def request_once(
        self, decision: Decision, begin: Begin, ready: Ready, give_up_after: float
    ) -> None:
        """The same once ready says that there is a device for it: a node that has just started
        has heard none yet, and waits for it at most give_up_after s. try_held is called often
        meanwhile."""
        token = next(self._tokens)
        self._decisions[token] = decision

        def begin_or_hold(link: Any, now: float) -> None:
            if ready(link):
                self._begin(link, token, begin, now)
            else:
                self._held.append((token, begin, ready, now + give_up_after))

        self._shell.in_link(begin_or_hold)

    def try_held(self, link: Any, now: float) -> None:
        """In the link's turn: begin those that waited for their device, or for too long."""
        held, self._held = self._held, []
        for token, begin, ready, until in held:
            if ready(link) or now >= until:
                # A call of its own: a mistake in it must not cost those that follow.
                self._call(token, begin)
            else:
                self._held.append((token, begin, ready, until))

    def finished(self, token: int, end: Any) -> None:
        """A request ended: its caller gets end."""
        self._decisions.pop(token, None)
        answered = self._waiting.pop(token, None)
        if answered is not None:
            answered(end)

    def report(self, token: int, outcome: Outcome, detail: str) -> None:
        """A request got a step further; if a decision stands behind it, the supervisor is told."""
        decision = self._decisions.get(token)
        if decision is not None:
            self._report(decision, outcome, detail)

    def _call(self, token: int, begin: Begin) -> None:
        self._shell.in_link(lambda link, now: self._begin(link, token, begin, now))

    def _begin(self, link: Any, token: int, begin: Begin, now: float) -> None:
        try:
            begin(link, token, now)
        except Exception as error:
            # Whoever waits must get an answer; the loop reports the mistake itself.
            self._shell.deliver([CallFailed(token, f"{type(error).__name__}: {error}")])
            raise
