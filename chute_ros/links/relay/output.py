"""The output of a relay as a wire: a file that is written, or a serial port."""

from __future__ import annotations

import errno
import os
from collections.abc import Hashable
from pathlib import Path

from chute_ros.errors import ParameterError
from chute_ros.transport.address import SERIAL_FORMS, parse_serial_address
from chute_ros.transport.given_path import given_path
from chute_ros.transport.wire import Wire, make_wire

FORMS = f"file:PATH, {SERIAL_FORMS}"
#: Errors after which a file is opened again.
_GONE = (errno.ENODEV, errno.ENXIO, errno.EIO, errno.EBADF)


class FileWire:
    """A file that is there and is written from its beginning each time, as those of GPIO and PWM
    in /sys; a device or a pipe as well."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = -1

    @property
    def is_open(self) -> bool:
        return self._file >= 0

    def open(self) -> None:
        # Neither made nor waited for: a pipe that nobody reads is no output.
        self._file = os.open(self._path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)

    def close(self) -> None:
        if self.is_open:
            os.close(self._file)
        self._file = -1

    def files(self) -> list[int]:
        return []

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        return []

    def write(self, data: bytes) -> None:
        try:
            written = self._write(data)
        except OSError as error:
            if error.errno in _GONE:
                raise ConnectionError(*error.args) from None
            raise
        if written != len(data):
            raise OSError(f"{written} of {len(data)} bytes were taken")

    def describe(self) -> str:
        return f"file:{self._path}"

    def _write(self, data: bytes) -> int:
        try:
            return os.pwrite(self._file, data, 0)
        except OSError as error:
            if error.errno != errno.ESPIPE:
                raise
            return os.write(self._file, data)


def make_output(text: str) -> Wire:
    """The wire of parameter connection; not opened yet. ParameterError: it is none."""
    kind, _, rest = text.partition(":")
    if kind == "file" and rest:
        return FileWire(given_path(rest, "parameter connection"))
    if kind not in ("serial", "usb"):
        raise ParameterError(f"connection {text!r} is no output: need {FORMS}")
    return make_wire(parse_serial_address(text))
