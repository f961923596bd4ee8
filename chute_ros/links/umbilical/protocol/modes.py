"""The flight modes of the flight computer.

Source: Umbilical Reference, section 3 (flight_mode); the numbers as measured in the field.
"""

from __future__ import annotations

import enum


class FlightMode(enum.IntEnum):
    """flight_mode of $TELEM."""

    STARTUP = 0
    STANDBY = 1
    ASCENT = 2
    COAST = 3
    DROGUE_DEPLOYED = 4
    MAIN_DEPLOYED = 5
    FAULT = 6

    @property
    def label(self) -> str:
        """As the reference writes it."""
        return self.name.title().replace("_", "")


#: On the ground by the flight computer's own word.
GROUND = (FlightMode.STARTUP, FlightMode.STANDBY)
#: In the air by the flight computer's own word.
IN_FLIGHT = (
    FlightMode.ASCENT,
    FlightMode.COAST,
    FlightMode.DROGUE_DEPLOYED,
    FlightMode.MAIN_DEPLOYED,
)
