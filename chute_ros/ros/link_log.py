"""One log line for what a link says to a person."""

from __future__ import annotations

import math
from typing import Any

from chute_ros.protocol.events import Notice, Severity

#: A device needs no longer to start and to be heard, s; then its silence is worth a line.
QUIET_FOR = 5.0


class UselessWire:
    """Says once what is wrong with a wire that is open and of which nothing good is heard, as with
    another port, baud rate or key: who reads only the log would else see that it is open."""

    def __init__(self) -> None:
        self._since = math.inf
        self._told = False

    def look(self, log: Any, trouble: str, now: float) -> None:
        """trouble: in words; empty: there is none, a device was heard, or the wire is known to be
        shut. now: s."""
        if not trouble:
            self._since, self._told = math.inf, False
            return
        self._since = min(self._since, now)
        if now - self._since >= QUIET_FOR and not self._told:
            self._told = True
            log.warning(f"{trouble}, for {now - self._since:.0f} s now")


def log_notice(log: Any, notice: Notice) -> None:
    """At the level that it deserves."""
    # A line each: rclpy refuses a place in the source that logs at two levels.
    if notice.severity is Severity.ERROR:
        log.error(notice.text)
    elif notice.severity is Severity.WARNING:
        log.warning(notice.text)
    else:
        log.info(notice.text)
