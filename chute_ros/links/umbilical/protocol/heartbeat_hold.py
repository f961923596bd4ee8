"""No <H> in flight, where the firmware takes a connected umbilical for a fault.

A connected umbilical matters to the flight computer on the ground only: there it takes the key and
the launch, and has the tank vented when the heartbeat ends. From Ascent on some firmware goes to
Fault, in which no parachute comes out by itself, if the umbilical is still connected.
"""

from __future__ import annotations

import math

from chute_ros.links.umbilical.protocol.config import HeartbeatInFlight
from chute_ros.links.umbilical.protocol.layouts import Layout

#: A <L> that has left may have begun a flight that telemetry does not show yet, s; and where none
#: can be read, as beside a second reader of the port, for so long: the firmware takes the
#: umbilical for lost after 15 s without <H>.
_LAUNCH_SHOWS, _LAUNCH_MAY_BE_UNSEEN = 1.0, 10.0
#: So many records in a row say that it flies: one may be damaged, and on the ground a missing <H>
#: has the tank vented.
_FLIES = 2


class HeartbeatHold:
    """Knows when no <H> may be sent."""

    def __init__(self, setting: HeartbeatInFlight) -> None:
        self._setting = setting
        self._records_in_flight = 0
        #: When a <L> left of which it is not known what became; infinity: there is none.
        self._launch_sent = math.inf

    def record(self, flying: bool, now: float) -> None:
        """A record came, by which it flies or not."""
        self._records_in_flight = self._records_in_flight + 1 if flying else 0
        if not flying and now >= self._launch_sent + _LAUNCH_SHOWS:
            self._launch_sent = math.inf

    def token_sent(self, name: str, now: float) -> None:
        """This command leaves."""
        if name == "launch":
            self._launch_sent = now

    def holds(self, layout: Layout | None, now: float) -> bool:
        """None may be sent now. layout: of the telemetry; None: not recognised yet."""
        if now >= self.next_deadline():
            self._launch_sent = math.inf
        by_layout = layout is not None and layout.heartbeat_in_flight
        auto = self._setting is HeartbeatInFlight.AUTO
        if self._setting is HeartbeatInFlight.YES or (auto and by_layout):
            return False
        return self._launch_sent < math.inf or self._records_in_flight >= _FLIES

    def next_deadline(self) -> float:
        """When time alone lets them go on; infinity: it does not."""
        return self._launch_sent + _LAUNCH_MAY_BE_UNSEEN
