"""The relay on the serial cable of the soak."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from chute_ros.sim.pty_wire import PtyWire
from faults.soak_relay import DEPLOY, KILL, TIMES, VALID, Relay, Seen

_PACKET = 64


class SerialRelay(Relay):
    """Between the port that the node opens and the device's own pseudo terminal."""

    def __init__(self, seen: Seen, port: Path, device: Path) -> None:
        super().__init__("serial", seen)
        self._port = PtyWire(str(port))
        self._port.open()
        self._device, self._file = device, -1
        self._try_at = 0.0

    def plug_in(self) -> None:
        """The port is there, under its name."""
        self._port.open()

    def pull_out(self) -> None:
        """The port is gone."""
        self._port.close()

    def files(self) -> dict[int, Callable[[], None]]:
        readers = dict.fromkeys(self._port.files(), self._down)
        if self._file >= 0:
            readers[self._file] = self._up
        return readers

    def look(self, now: float) -> None:
        if self._file >= 0 or now < self._try_at:
            return
        self._try_at = now + 0.1
        try:
            self._file = os.open(self._device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError:
            pass  # the device is not there yet

    def close(self) -> None:
        self._port.close()
        if self._file >= 0:
            os.close(self._file)

    def _up(self) -> None:
        try:
            data = os.read(self._file, _PACKET)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            os.close(self._file)
            self._file = -1
            return
        if not self._port.is_open or not self.takes():
            return
        for one in (data, *(self._more() if data.endswith(b"\n") else ())):
            try:
                self._port.write(one)
            except OSError:
                pass  # the node does not read as fast: lost, as on any line

    def _down(self) -> None:
        (file,) = self._port.files()
        try:
            chunks = self._port.read(file)
        except OSError:
            return
        for data, _ in chunks:
            if not self.takes():
                continue
            for token, what in ((b"<V>", KILL), (b"<D>", DEPLOY), (b"<d>", DEPLOY)):
                if token in data:
                    self.seen(self.name, what, token.decode())
            if self._file >= 0:
                try:
                    os.write(self._file, data)
                except OSError:
                    pass  # the device is gone, or does not read

    def _more(self) -> list[bytes]:
        if not self.flood:
            return []
        if self.flood == VALID:
            return [b"[INFO] flood %d\n" % number for number in range(TIMES)]
        return [self.chance.randbytes(self.chance.randint(1, 60)) + b"\n" for _ in range(TIMES)]
