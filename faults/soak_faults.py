"""Puts a fault of a plan on the vehicle, and takes it away again."""

from __future__ import annotations

import errno
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

from faults.soak_plan import Plan
from faults.soak_relay import INVALID, VALID
from faults.soak_vehicle import Vehicle
from faults.soak_wires import INTERFACE, VEHICLE

_LOSS = 0.3
_BLOCK = bytes(65536)


class Fault:
    """The fault of one loop."""

    def __init__(self, vehicle: Vehicle, plan: Plan) -> None:
        self._vehicle, self._plan = vehicle, plan
        self._undo: Callable[[], None] = lambda: None

    def begin(self) -> None:
        """Now."""
        begin = {
            "kill -9": self._kill,
            "SIGSTOP": self._stop,
            "serial port vanishes": self._pull_out,
            "UDP port closed": self._close_ports,
            "interface down": self._interface_down,
            "cable cut": self._cut,
            "30 % lost both ways": self._lose,
            "flood of valid frames": lambda: self._flood(VALID),
            "flood of invalid frames": lambda: self._flood(INVALID),
            "disk full": self._fill_disk,
            "no descriptors left": self._exhaust,
            "wall clock set": self._set_clock,
        }[self._plan.kind]
        begin()

    def end(self) -> None:
        """It is over."""
        self._undo()

    def _kill(self) -> None:
        self._vehicle.watch.expect(self._plan.target)
        self._vehicle.keeper.kill(self._plan.target)

    def _stop(self) -> None:
        keeper, target = self._vehicle.keeper, self._plan.target
        keeper.signal(target, signal.SIGSTOP)
        self._undo = lambda: keeper.signal(target, signal.SIGCONT)

    def _pull_out(self) -> None:
        wires = self._vehicle.wires
        with wires.lock:
            wires.serial.pull_out()

        def plug_in() -> None:
            with wires.lock:
                wires.serial.plug_in()

        self._undo = plug_in

    def _close_ports(self) -> None:
        wires = self._vehicle.wires
        with wires.lock:
            wires.mavlink.close_ports()

        def open_ports() -> None:
            with wires.lock:
                wires.mavlink.open_ports()

        self._undo = open_ports

    def _interface_down(self) -> None:
        name = self._plan.target
        _ip("link", "set", name, "down")

        def up() -> None:
            _ip("link", "set", name, "up")
            if name == INTERFACE:
                # With the interface the kernel forgot it.
                _ip("route", "replace", "224.0.0.0/4", "dev", name)

        self._undo = up

    def _cut(self) -> None:
        if self._plan.target == "mavlink":
            network = self._vehicle.network
            network.cable(VEHICLE, "cut")
            self._undo = lambda: network.cable(VEHICLE, "heal")
            return
        relay = self._vehicle.wires.can
        relay.cut = True
        self._undo = lambda: setattr(relay, "cut", False)

    def _lose(self) -> None:
        relays = self._vehicle.wires.chosen(self._plan.target)

        def lose(share: float) -> None:
            for relay in relays:
                relay.loss = share

        lose(_LOSS)
        self._undo = lambda: lose(0.0)

    def _flood(self, what: str) -> None:
        relays = self._vehicle.wires.chosen(self._plan.target)

        def flood(kind: str) -> None:
            for relay in relays:
                relay.flood = kind

        flood(what)
        self._undo = lambda: flood("")

    def _fill_disk(self) -> None:
        path = self._vehicle.home / "full"
        fill(path)
        self._undo = path.unlink

    def _exhaust(self) -> None:
        keeper, plan = self._vehicle.keeper, self._plan
        keeper.exhaust_descriptors(plan.target)
        if plan.beside:
            self._vehicle.watch.expect(plan.beside)
            keeper.kill(plan.beside)
        self._undo = lambda: keeper.restore_descriptors(plan.target)

    def _set_clock(self) -> None:
        clocks, target = self._vehicle.clocks, self._plan.target
        some = list(clocks.values()) if target == "all nodes" else [clocks[target]]

        def set_by(seconds: float) -> None:
            for clock in some:
                clock.set_by(seconds)

        set_by(self._plan.step)
        self._undo = lambda: set_by(0.0)


def fill(path: Path) -> None:
    """Write until the disk that path is on takes nothing more."""
    with path.open("wb", buffering=0) as file:
        block = _BLOCK
        while block:
            try:
                written = file.write(block)
            except OSError as error:
                if error.errno != errno.ENOSPC:
                    raise
                block = block[: len(block) // 2]
            else:
                assert written


def _ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)
