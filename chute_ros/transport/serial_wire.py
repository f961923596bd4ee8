"""A serial port as a wire, exclusive and reopened when it comes back."""

from __future__ import annotations

import os
import termios
from collections.abc import Callable, Hashable
from itertools import count

import serial

from chute_ros.transport.serial_ports import explain

_CHUNK = 4096
_stream_numbers = count(1)


class SerialWire:
    """name: as it is described; find: the port's path at this moment, OSError if there is none."""

    def __init__(self, name: str, find: Callable[[], str], baud: int) -> None:
        self._name, self._find, self._baud = name, find, baud
        self._port: serial.Serial | None = None
        self._path = ""
        self._stream: tuple[str, int] = (name, 0)

    @property
    def is_open(self) -> bool:
        return self._port is not None

    def open(self) -> None:
        # Each time anew: a device that comes back may have another path.
        path = self._find()
        # The descriptor is read directly, as pyserial's own read hides a hang-up behind an empty
        # answer.
        try:
            self._port = serial.Serial(path, self._baud, timeout=0, exclusive=True)
        except termios.error as error:
            # How a port that vanishes while it is set up shows itself; it is no OSError.
            raise explain(OSError(*error.args), path) from None
        except OSError as error:  # SerialException is one
            raise explain(error, path) from None
        os.set_blocking(self._port.fileno(), False)
        self._path = path
        self._stream = (path, next(_stream_numbers))

    def close(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            try:
                port.close()
            except OSError:
                pass  # the device is gone; there is nothing left to close

    def files(self) -> list[int]:
        return [] if self._port is None else [self._port.fileno()]

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        try:
            data = os.read(file, _CHUNK)
        except BlockingIOError:
            return []
        if not data:
            raise ConnectionResetError(f"{self._path} was unplugged")
        return [(data, self._stream)]

    def write(self, data: bytes) -> None:
        assert self._port is not None
        if os.write(self._port.fileno(), data) != len(data):
            raise BlockingIOError(f"{self._path} takes no more data")

    def describe(self) -> str:
        at = f" ({self._path})" if self._path and self._path not in self._name else ""
        return f"{self._name}{at}"
