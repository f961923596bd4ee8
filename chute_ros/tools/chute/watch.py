"""`chute watch`: the vehicle on a full screen, until q or Ctrl-C; with --json as lines."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable

from chute_ros.tools.chute.errors import MistakeError
from chute_ros.tools.chute.json_text import json_text
from chute_ros.tools.chute.listening import Listening
from chute_ros.tools.chute.options import DONE, Chosen
from chute_ros.tools.chute.screen import full_screen, wants_to_quit
from chute_ros.tools.chute.session import ChuteSession, opened
from chute_ros.tools.chute.view import VehiclePicture
from chute_ros.tools.chute.watch_text import empty_page, page_of
from chute_ros.tools.chute.words import is_old

#: At most so often, and at least so often, something is drawn or printed, s.
SOONEST, LATEST = 0.25, 1.0


def main(chosen: Chosen) -> int:
    """Exit code 0: ended by q; 1: no supervisor was received within --timeout; 2: no terminal."""
    if chosen.json:
        with opened(chosen.namespace) as session:
            return _lines(session, chosen.timeout)
    if not sys.stdout.isatty() or os.environ.get("TERM", "dumb") == "dumb":
        raise MistakeError("watch: needs a terminal; `chute status` and --json do not")
    with opened(chosen.namespace) as session, full_screen() as screen:
        listening, began = Listening(session), time.monotonic()

        def draw() -> bool:
            picture, now = listening.view(), time.monotonic()
            if picture is not None:
                page = page_of(picture)
            else:
                around = session.around.text()
                page = empty_page(session.namespace, around, session.vehicles(), now - began)
            screen.show(page, now)
            return not wants_to_quit()

        _each(session, listening, chosen.timeout, draw)
    return DONE


def _lines(session: ChuteSession, timeout: float | None) -> int:
    listening = Listening(session)
    printed = 0.0
    before: tuple[object, ...] = ()

    def tell() -> bool:
        nonlocal printed, before
        picture, now = listening.view(), time.monotonic()
        if picture is not None and (essence(picture) != before or now >= printed + LATEST):
            print(json_text(picture), flush=True)
            printed, before = now, essence(picture)
        return True

    _each(session, listening, timeout, tell)
    return DONE


def _each(
    session: ChuteSession, listening: Listening, timeout: float | None, step: Callable[[], bool]
) -> None:
    """Have step called each SOONEST until it returns False, while all messages are taken."""
    began = time.monotonic()
    next_at = began
    while True:
        session.spin()
        now = time.monotonic()
        if timeout is not None and now >= began + timeout and listening.view() is None:
            raise session.not_heard("no supervisor is received", timeout)
        if now >= next_at:
            next_at = now + SOONEST
            if not step():
                return


def essence(picture: VehiclePicture) -> tuple[object, ...]:
    """What a change of is told at once: not the measurements, nor the ages."""
    return (
        *(picture.supervisor, picture.state, picture.state_text, picture.mode, picture.alarms),
        *(picture.flight_blocked, picture.block_reasons, picture.newest_decision),
        is_old(picture.age),
        tuple((one.name, one.state, one.device_healthy) for one in picture.links),
        tuple((p.link, p.device, p.state, p.armed, p.deployed) for p in picture.parachutes),
        tuple((one.id, one.outcomes) for one in picture.decisions),
    )
