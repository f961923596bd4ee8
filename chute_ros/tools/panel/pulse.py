"""The page's sign of life: without it the page turns grey by itself (panel.js).

It also dates what the page sends: an event that waited for a connection that was cut comes with an
old beat.
"""

from __future__ import annotations

import math
import time
from collections import deque

from nicegui import ui

#: Beats that are remembered; more than a page may be behind.
_REMEMBERED = 100


class Pulse:
    """One element, that nobody sees."""

    def __init__(self) -> None:
        self._count = 0
        #: (number, when it was sent, s)
        self._beats: deque[tuple[int, float]] = deque(maxlen=_REMEMBERED)
        self._element = ui.html("", sanitize=False).classes("pulse").props("aria-hidden=true")
        ui.html(
            '<div class="banner tone-quiet"><span class="sign" aria-hidden="true">○</span> NO '
            "CONNECTION TO THE PANEL</div><p>What is below is old.</p>",
            sanitize=False,
        ).classes("lost-note").props('role="alert"')

    def beat(self) -> None:
        """What is shown is of now."""
        self._count += 1
        self._beats.append((self._count, _now()))
        self._element.set_content(str(self._count))

    def age(self, number: object) -> float:
        """Since this beat was sent, s; infinity: it was not, or long ago."""
        sent = dict(self._beats).get(number, -math.inf) if isinstance(number, int) else -math.inf
        return _now() - sent


def _now() -> float:
    """Goes on while the computer sleeps, s."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)
