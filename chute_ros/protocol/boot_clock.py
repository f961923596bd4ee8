"""A device's own clock, time_boot_ms: did the device restart?

A message may be delayed and so seem to come from before. A restart is believed only when two
messages in a row show a clock that runs anew: a delayed one is followed by the running clock.

Text without a checksum may be damaged as well: there a clock that leaps ahead of ours is doubted
likewise, and that it runs back from the very first one that came is no restart.
"""

from __future__ import annotations

import enum
import math

#: A clock that runs back by more than this (ms) may have restarted; less is reordering. One that
#: leaps ahead of ours by more may be damaged.
REBOOT_JUMP_MS = 1000
_WRAP_MS = 2**32
_WRAP_MARGIN_MS = 60_000


class Age(enum.Enum):
    """What a message's time says."""

    NEW = "as new as any before"
    OLD = "older than one that came before it"
    DOUBTFUL = "from before, the first after a restart, or damaged"
    RESTARTED = "from after a restart"


class BootClock:
    """Follows one device's time_boot_ms."""

    def __init__(self) -> None:
        #: The newest time, ms; None: none was seen.
        self.newest: int | None = None
        self._doubtful: int | None = None
        #: When they came by our clock, s.
        self._newest_at = -math.inf
        self._doubtful_at = -math.inf
        #: A second one has agreed with the first.
        self._sure = False

    @property
    def uptime(self) -> float:
        """s; NaN: not known."""
        return float("nan") if self.newest is None else self.newest / 1000.0

    def observe(self, boot_ms: int, now: float = math.inf) -> Age:
        """A message of this time came. 0 is a sender without a clock: always new.

        now: monotonic s, where a message may be damaged; infinity: it has a checksum."""
        last = self.newest
        if last is None:
            self._sure = False
            return self._accept(boot_ms, now, Age.NEW)
        wrapped = last > _WRAP_MS - _WRAP_MARGIN_MS and boot_ms < _WRAP_MARGIN_MS
        if wrapped or (boot_ms >= last and not _leaps(last, self._newest_at, boot_ms, now)):
            self._sure = True
            return self._accept(boot_ms, now, Age.NEW)
        if boot_ms == 0:
            return Age.NEW
        if 0 <= last - boot_ms <= REBOOT_JUMP_MS:
            return Age.OLD
        before = self._doubtful
        agrees = before is not None and boot_ms >= before
        if agrees and not _leaps(before, self._doubtful_at, boot_ms, now):
            # Of the very first, a damaged one says as little as of a restart.
            ran_back = boot_ms < last and (self._sure or now == math.inf)
            self._sure = True
            return self._accept(boot_ms, now, Age.RESTARTED if ran_back else Age.NEW)
        self._doubtful, self._doubtful_at = boot_ms, now
        return Age.DOUBTFUL

    def _accept(self, boot_ms: int, now: float, age: Age) -> Age:
        self.newest, self._newest_at, self._doubtful = boot_ms, now, None
        return age


def _leaps(before: int | None, came: float, boot_ms: int, now: float) -> bool:
    """It is further ahead of the one before than ours is; never where nothing is damaged."""
    if before is None or math.inf in (now, came):
        return False
    return boot_ms - before > (now - came) * 1000.0 + REBOOT_JUMP_MS
