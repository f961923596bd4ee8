"""A device's own clock, time_boot_ms: did the device restart?

A message may be delayed and so seem to come from before. A restart is believed only when two
messages in a row show a clock that runs anew: a delayed one is followed by the running clock.
"""

from __future__ import annotations

import enum

#: A clock that runs back by more than this (ms) may have restarted; less is reordering.
REBOOT_JUMP_MS = 1000
_WRAP_MS = 2**32
_WRAP_MARGIN_MS = 60_000


class Age(enum.Enum):
    """What a message's time says."""

    NEW = "as new as any before"
    OLD = "older than one that came before it"
    DOUBTFUL = "from before, or the first after a restart"
    RESTARTED = "from after a restart"


class BootClock:
    """Follows one device's time_boot_ms."""

    def __init__(self) -> None:
        #: The newest time, ms; None: none was seen.
        self.newest: int | None = None
        self._doubtful: int | None = None

    @property
    def uptime(self) -> float:
        """s; NaN: not known."""
        return float("nan") if self.newest is None else self.newest / 1000.0

    def observe(self, boot_ms: int) -> Age:
        """A message of this time came. 0 is a sender without a clock: always new."""
        last = self.newest
        wrapped = (
            last is not None and last > _WRAP_MS - _WRAP_MARGIN_MS and boot_ms < _WRAP_MARGIN_MS
        )
        if last is None or boot_ms >= last or wrapped:
            self.newest, self._doubtful = boot_ms, None
            return Age.NEW
        if boot_ms == 0:
            return Age.NEW
        if last - boot_ms <= REBOOT_JUMP_MS:
            return Age.OLD
        if self._doubtful is not None and boot_ms >= self._doubtful:
            self.newest, self._doubtful = boot_ms, None
            return Age.RESTARTED
        self._doubtful = boot_ms
        return Age.DOUBTFUL
