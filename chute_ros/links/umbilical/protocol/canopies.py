"""Drogue and main of one flight: what came out, and what was fired from here.

Source: Umbilical Reference, section 3 (ssa_drogue_deployed, ssa_main_deployed, flight_mode).
"""

from __future__ import annotations

from chute_ros.links.umbilical.protocol.layouts import Record
from chute_ros.links.umbilical.protocol.modes import FlightMode

#: Command -> the flag and the flight mode that show it.
CANOPIES = {
    "drogue": ("ssa_drogue_deployed", FlightMode.DROGUE_DEPLOYED),
    "main": ("ssa_main_deployed", FlightMode.MAIN_DEPLOYED),
}


class Canopies:
    """Each set holds names of commands."""

    def __init__(self) -> None:
        #: A flag rose, or a mode said so.
        self.came_out: set[str] = set()
        #: Two records in a row said so: text without a checksum may be damaged.
        self.surely_out: set[str] = set()
        #: The command left.
        self.fired: set[str] = set()
        #: Since when any of these was so, monotonic s.
        self.since: dict[str, float] = {}
        self._said: set[str] = set()

    def watch(self, before: Record | None, record: Record, mode: FlightMode | None) -> None:
        """A record came; before: the one before it."""
        said_before, self._said = self._said, set()
        for name, (flag, shown_by) in CANOPIES.items():
            rose = before is not None and not before[flag] and record[flag]
            if rose or mode is shown_by:
                self.came_out.add(name)
            if name in self.came_out and (record[flag] or mode is shown_by):
                self._said.add(name)
        if mode is FlightMode.MAIN_DEPLOYED:
            # Its mode comes after the drogue's.
            self.came_out.add("drogue")
            self._said.add("drogue")
        for name in self.came_out:
            self.since.setdefault(name, record.received)
        self.surely_out |= said_before & self._said
