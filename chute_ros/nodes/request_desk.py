"""Requests to a link: each has a token, and whoever waits for it gets its end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Any

from rclpy.task import Future

from chute_ros import model

Begin = Callable[[Any, int, float], None]
#: Of a link: the device that a request needs was heard.
Ready = Callable[[Any], bool]


@dataclass(frozen=True)
class CallFailed:
    """A request could not even be begun, by a mistake of ours."""

    token: int
    text: str


class RequestDesk:
    """call: has a function called in the link's turn; deliver: hands events to the executor;
    report: tells the supervisor how far a decision got."""

    def __init__(
        self,
        call: Callable[[Callable[[Any, float], None]], None],
        deliver: Callable[[list[Any]], None],
        report: Callable[[model.Decision, model.Outcome, str], None],
    ) -> None:
        self._in_link, self._deliver, self._report = call, deliver, report
        self._tokens = count(1)
        self._waiting: dict[int, Future] = {}
        self._decisions: dict[int, model.Decision] = {}
        #: Those that wait for their device: (token, begin, ready, until). Of the link's turn.
        self._held: list[tuple[int, Begin, Ready, float]] = []

    @property
    def holds(self) -> bool:
        """A request waits for its device."""
        return bool(self._held)

    def request(self, begin: Begin) -> Future:
        """Have begin(link, token, now) called in the link's turn; the future is its end."""
        token = next(self._tokens)
        self._waiting[token] = future = Future()
        self._call(token, begin)
        return future

    def request_for(self, decision: model.Decision, begin: Begin) -> None:
        """The same on behalf of a decision: its steps are reported on safety/action."""
        token = next(self._tokens)
        self._decisions[token] = decision
        self._call(token, begin)

    def request_once(
        self, decision: model.Decision, begin: Begin, ready: Ready, give_up_after: float
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

        self._in_link(begin_or_hold)

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
        future = self._waiting.pop(token, None)
        if future is not None:
            future.set_result(end)

    def report(self, token: int, outcome: model.Outcome, detail: str) -> None:
        """A request got a step further; if a decision stands behind it, the supervisor is told."""
        decision = self._decisions.get(token)
        if decision is not None:
            self._report(decision, outcome, detail)

    def _call(self, token: int, begin: Begin) -> None:
        self._in_link(lambda link, now: self._begin(link, token, begin, now))

    def _begin(self, link: Any, token: int, begin: Begin, now: float) -> None:
        try:
            begin(link, token, now)
        except Exception as error:
            # Whoever waits must get an answer; the loop reports the mistake itself.
            self._deliver([CallFailed(token, f"{type(error).__name__}: {error}")])
            raise
