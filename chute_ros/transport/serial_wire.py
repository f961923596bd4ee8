"""A serial port as a wire, exclusive and reopened when it comes back."""

from __future__ import annotations

import os
import termios
from collections.abc import Hashable
from itertools import count

import serial

_CHUNK = 4096
_stream_numbers = count(1)


class SerialWire:
    """serial:PATH:BAUD."""

    def __init__(self, path: str, baud: int) -> None:
        self._path, self._baud = path, baud
        self._port: serial.Serial | None = None
        self._stream: tuple[str, int] = (path, 0)

    @property
    def is_open(self) -> bool:
        return self._port is not None

    def open(self) -> None:
        # SerialException is an OSError; the descriptor is read directly, as pyserial's own read
        # hides a hang-up behind an empty answer.
        try:
            self._port = serial.Serial(self._path, self._baud, timeout=0, exclusive=True)
        except termios.error as error:
            # How a port that vanishes while it is set up shows itself; it is no OSError.
            raise OSError(*error.args) from None
        os.set_blocking(self._port.fileno(), False)
        self._stream = (self._path, next(_stream_numbers))

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
        return f"serial:{self._path}:{self._baud}"
