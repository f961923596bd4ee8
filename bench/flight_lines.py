"""The $TELEM lines of a whole rocket flight, as the simulated flight computer prints them."""

from __future__ import annotations

import itertools

from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.links.umbilical.simulator.flight_computer import FlightComputer
from chute_ros.links.umbilical.simulator.settings import ComputerMode, FlightComputerSettings

#: What the flight computer sends, lines a second.
REAL_RATE = 13.0
#: The key is armed, the motor lit, s after the start; and it lies so long on the ground, s.
_ARM, _LAUNCH, _LANDED = 2.0, 4.0, 5.0


class FlightLines:
    """One flight after the other, each the same but for the device's clock, which goes on."""

    def __init__(self, layout: Layout) -> None:
        bodies = fly(layout)
        assert layout.fields[-1].name == "ms_since_boot_cfc"
        self._cut = [body.rpartition(",")[0] for body in bodies]
        self.restart()

    def __len__(self) -> int:
        """Lines of one flight."""
        return len(self._cut)

    def restart(self) -> None:
        """The next line is the first of a flight."""
        self._coming = itertools.cycle(enumerate(self._cut))

    def next(self, ms: int) -> tuple[bytes, bool]:
        """The next line with its end, and whether it is the first of a flight; ms: the device's
        clock."""
        number, cut = next(self._coming)
        return f"$TELEM,{cut},{ms}\n".encode(), number == 0


def fly(layout: Layout) -> list[str]:
    """The bodies of all lines from before arming until it has landed."""
    computer = FlightComputer(FlightComputerSettings(rate=REAL_RATE, packet_rate=1e6), layout)
    commands = [(_ARM, b"<KA>"), (_LAUNCH, b"<L>")]
    data, now, landed = bytearray(), 0.0, 0.0
    while not landed or now < landed + _LANDED:
        computer.update(now)
        for chunk in computer.take_output():
            data += chunk
        if commands and now >= commands[0][0]:
            computer.receive(commands.pop(0)[1], now)
        down = computer.mode == ComputerMode.MainDeployed and computer.flight.rocket.on_ground
        landed = landed or (now if down else 0.0)
        now = max(computer.next_deadline(), now + 1e-6)
    return [line.removeprefix("$TELEM,") for line in data.decode().splitlines()]
