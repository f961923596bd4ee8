"""`chute arm`, `disarm`, `deploy`, `kill`, `reset` and `mode`: one call of a service."""

from __future__ import annotations

import getpass
import os
import socket
import sys
import termios
from collections.abc import Sequence

from chute_ros.plain_text import plain
from chute_ros.tools.chute.calling import OrderCall
from chute_ros.tools.chute.errors import CommandError, MistakeError
from chute_ros.tools.chute.json_text import json_text
from chute_ros.tools.chute.listening import Listening
from chute_ros.tools.chute.options import ANSWER, Chosen
from chute_ros.tools.chute.order import (
    SUPERVISOR,
    Order,
    ServiceAnswer,
    answer_text,
    not_answered,
    order_of,
)
from chute_ros.tools.chute.reach import warning
from chute_ros.tools.chute.session import ChuteSession, opened
from chute_ros.tools.chute.status_text import order_lines
from chute_ros.tools.streams import NotPrintedError

#: A person who is asked does not wait longer for the state, nor for a node of it, s.
_SHOWN_WITHIN = 2.0
#: An order with --yes is held up no longer for the state, from which its giver may be warned, s.
_WARNED_WITHIN = 0.3


def main(chosen: Chosen) -> int:
    """Exit code 0: done, and the answer says so; 1: anything else; 2: nobody could be asked."""
    who = _who()
    order = order_of(chosen, who)
    asks = bool(order.word) and not chosen.more.yes
    if asks:
        _require_terminal(order.name)
    with opened(chosen.namespace) as session:
        call = OrderCall(session, order, who)
        listening = Listening(session) if asks or order.unreached else None
        within, warned = chosen.wait(), asks
        if not session.until(call.found, within):
            what = f"{order.name}: {order.service} is not offered"
            raise session.not_heard(what, within, _other_way(session, order))
        if asks and listening is not None:
            _ask(session, listening, order)
        elif listening is not None:
            session.until(listening.view, _WARNED_WITHIN)
            warned = _warn(order, listening)
        try:
            answer = call.send(chosen.wait(ANSWER))
        except KeyboardInterrupt:
            told = not_answered(order, "before it was interrupted")
            print(f"\nchute: {told}", file=sys.stderr)
            raise
        if listening is not None and not (warned or answer.success):
            _warn(order, listening, unheard=False)
    try:
        told = json_text(_told(order, chosen.namespace, answer)) if chosen.json else ""
        print(told or answer_text(order, answer), flush=True)
    except NotPrintedError as error:
        # The order was carried out or not, whoever reads of it.
        error.instead = plain(answer_text(order, answer))
        raise
    return answer.code


def _ask(session: ChuteSession, listening: Listening, order: Order) -> None:
    """A vehicle that says nothing can be ordered all the same."""
    session.until(listening.view, _SHOWN_WITHIN)
    picture = listening.settle(_SHOWN_WITHIN) if listening.view() else None
    lines = order_lines(session.namespace, picture, order.does)
    _ask_word(order.name, order.word, [*lines, *filter(None, [warning(order, picture)])])


def _require_terminal(name: str) -> None:
    """MistakeError where nobody can be asked."""
    if not sys.stdin.isatty():
        raise MistakeError(f"{name}: no terminal to ask at: nothing was sent; --yes does not ask")


def _ask_word(name: str, word: str, told: Sequence[str]) -> None:
    """Show what is told, on standard error, and wait for the word; CommandError if another is
    typed."""
    for line in told:
        print(line, file=sys.stderr)
    print(
        f"type {word} to {name}, anything else to leave it: ", end="", file=sys.stderr, flush=True
    )
    # What was typed before the question is no answer to it.
    termios.tcflush(sys.stdin.fileno(), termios.TCIFLUSH)
    answer = os.read(sys.stdin.fileno(), 1000).decode(errors="replace").strip()
    if answer != word:
        raise CommandError(f"{name}: not confirmed, nothing was sent", {"sent": False})


def _warn(order: Order, listening: Listening, unheard: bool = True) -> bool:
    """Whether it was told that no parachute is reached."""
    if told := warning(order, listening.view(), unheard):
        print(f"chute: {order.name}: {told}", file=sys.stderr)
    return bool(told)


def _told(order: Order, namespace: str, answer: ServiceAnswer) -> dict[str, object]:
    """For --json."""
    told: dict[str, object] = {"order": order.name, "namespace": namespace}
    told |= {"service": order.service, "sent": True, "answered": True}
    told |= {"success": answer.success, "message": answer.message}
    return told if answer.accepted is None else {**told, "accepted": answer.accepted}


def _other_way(session: ChuteSession, order: Order) -> str:
    """A device node takes the order itself where no supervisor is there; empty: none does."""
    prefix, _, service = order.service.partition("/")
    offered = session.services() if prefix == SUPERVISOR else set()
    takers = [node for node in session.links() if f"{node}/{service}" in offered]
    return f"{takers[0]} takes the order itself: --link {takers[0]}" if takers else ""


def _who() -> str:
    """The person, for the record: user and computer."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):  # a container may have no name for its user
        user = "somebody"
    return f"{user}@{socket.gethostname()}"
