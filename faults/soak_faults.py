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

#: Takes a fault away.
Undo = Callable[[], None]
_LOSS = 0.3
_BLOCK = bytes(65536)


class Fault:
    """The fault of one loop."""

    def __init__(self, vehicle: Vehicle, plan: Plan) -> None:
        self._vehicle, self._plan = vehicle, plan
        self._undo: Undo = _nothing

    def begin(self) -> None:
        """Now."""
        begin: Callable[[], Undo] = {
            "kill -9": self._kill,
            "SIGSTOP": self._stop,
            "serial port vanishes": self._pull_out,
            "UDP port closed": self._close_ports,
            "interface down": self._interface_down,
            "cable cut": self._cut,
            "30 % lost both ways": lambda: self._spoil("loss", _LOSS, 0.0),
            "flood of valid frames": lambda: self._spoil("flood", VALID, ""),
            "flood of invalid frames": lambda: self._spoil("flood", INVALID, ""),
            "disk full": self._fill_disk,
            "no descriptors left": self._exhaust,
            "wall clock set": self._set_clock,
        }[self._plan.kind]
        self._undo = begin()

    def end(self) -> None:
        """It is over."""
        self._undo()

    def _kill(self) -> Undo:
        self._vehicle.watch.expect(self._plan.target)
        self._vehicle.keeper.kill(self._plan.target)
        return _nothing

    def _stop(self) -> Undo:
        keeper, target = self._vehicle.keeper, self._plan.target
        keeper.signal(target, signal.SIGSTOP)
        return lambda: keeper.signal(target, signal.SIGCONT)

    def _pull_out(self) -> Undo:
        serial = self._vehicle.wires.serial
        return self._locked(serial.pull_out, serial.plug_in)

    def _close_ports(self) -> Undo:
        mavlink = self._vehicle.wires.mavlink
        return self._locked(mavlink.close_ports, mavlink.open_ports)

    def _locked(self, do: Callable[[], None], undo: Callable[[], None]) -> Undo:
        """Each while nobody reads the wires."""

        def held(function: Callable[[], None]) -> None:
            with self._vehicle.wires.lock:
                function()

        held(do)
        return lambda: held(undo)

    def _interface_down(self) -> Undo:
        name = self._plan.target
        _ip("link", "set", name, "down")

        def up() -> None:
            _ip("link", "set", name, "up")
            if name == INTERFACE:
                # With the interface the kernel forgot it.
                _ip("route", "replace", "224.0.0.0/4", "dev", name)

        return up

    def _cut(self) -> Undo:
        if self._plan.target != "mavlink":
            return self._spoil("cut", True, False)
        network = self._vehicle.network
        network.cable(VEHICLE, "cut")
        return lambda: network.cable(VEHICLE, "heal")

    def _spoil(self, what: str, value: object, whole: object) -> Undo:
        """Of the relays that it strikes."""
        relays = self._vehicle.wires.chosen(self._plan.target)

        def set_to(one: object) -> None:
            for relay in relays:
                setattr(relay, what, one)

        set_to(value)
        return lambda: set_to(whole)

    def _fill_disk(self) -> Undo:
        path = self._vehicle.home / "full"
        fill(path)
        return path.unlink

    def _exhaust(self) -> Undo:
        keeper, plan = self._vehicle.keeper, self._plan
        keeper.exhaust_descriptors(plan.target)
        if plan.beside:
            self._vehicle.watch.expect(plan.beside)
            keeper.kill(plan.beside)
        return lambda: keeper.restore_descriptors(plan.target)

    def _set_clock(self) -> Undo:
        clocks, target = self._vehicle.clocks, self._plan.target
        some = list(clocks.values()) if target == "all nodes" else [clocks[target]]

        def set_by(seconds: float) -> None:
            for clock in some:
                clock.set_by(seconds)

        set_by(self._plan.step)
        return lambda: set_by(0.0)


def _nothing() -> None:
    """What was killed is started again without us."""


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
