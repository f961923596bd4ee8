"""The default is deny: nothing that was not ordered may leave a link."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Protocol

from fuzz.target import WrongError

#: A link has this long for all that was asked of it, s; and may be woken so often for it.
LONGEST_REQUEST = 120.0
MOST_TURNS = 20_000


class Link(Protocol):
    """What all links have in common."""

    def update(self, now: float) -> None: ...

    def next_deadline(self) -> float: ...


class Orders:
    """What was asked of a link, and has not ended."""

    def __init__(self) -> None:
        self._open: dict[int, str] = {}
        #: What ended since something was taken off the link: it may have left before.
        self._just_ended: set[str] = set()
        self._last = 0

    def begin(self, name: str) -> int:
        """Something is asked for; its token."""
        self._last += 1
        self._open[self._last] = name
        return self._last

    def ended(self, token: int) -> None:
        """The link says so."""
        if token < 0:
            return  # one of its own
        name = self._open.pop(token, None)
        if name is None:
            raise WrongError(
                f"request {token} ended that was not under way: twice, or never asked"
            )
        self._just_ended.add(name)

    def left(self, what: str, allowed_by: Iterable[str]) -> None:
        """This left the link."""
        if not {*self._open.values(), *self._just_ended} & set(allowed_by):
            raise WrongError(f"{what} left the link, and nobody had ordered it")

    def settled(self) -> None:
        """All that left was looked at."""
        self._just_ended.clear()

    @property
    def open(self) -> list[str]:
        """What has not ended yet."""
        return list(self._open.values())


def check_not_spinning(link: Link, now: float) -> None:
    """A link that was updated has nothing to do before later."""
    if not link.next_deadline() > now:
        raise WrongError(f"spins: updated at {now!r}, it wants to be at {link.next_deadline()!r}")


def run_out(link: Link, orders: Orders, now: float, turn: Callable[[float], Any]) -> float:
    """Let time pass until all requests ended; the time then."""
    end = now + LONGEST_REQUEST
    for _ in range(MOST_TURNS):
        if not orders.open and now >= end - LONGEST_REQUEST + 1.0:
            return now
        now = min(max(link.next_deadline(), now), now + 1.0)
        turn(now)
        if now > end:
            break
    raise WrongError(f"never ended: {', '.join(orders.open)}")
