"""A serial port as a wire, exclusive and reopened when it comes back."""

from __future__ import annotations

import errno
import os
import termios
import time
from collections.abc import Callable, Hashable
from itertools import count

import serial
from serial.tools import list_ports

from chute_ros.transport.serial_users import PortUsers, hung_up, users_of

_CHUNK = 4096
_stream_numbers = count(1)


class SerialWire:
    """name: as it is described; find: the port's path at this moment, OSError if there is none."""

    def __init__(self, name: str, find: Callable[[], str], baud: int) -> None:
        self._name, self._find, self._baud = name, find, baud
        self._port: serial.Serial | None = None
        self._users: PortUsers | None = None
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
        self._users = PortUsers(path, self._port.fileno())

    def close(self) -> None:
        users, self._users = self._users, None
        if users is not None:
            users.stop()
        port, self._port = self._port, None
        if port is not None:
            try:
                port.close()
            except OSError:
                pass  # the device is gone; there is nothing left to close

    def files(self) -> list[int]:
        return [] if self._port is None else [self._port.fileno()]

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        assert self._users is not None
        try:
            data = os.read(file, _CHUNK)
        except BlockingIOError:
            data = b""
        if data:
            return [(data, self._stream)]
        if hung_up(file):
            raise ConnectionResetError(f"{self._path} was unplugged")
        self._users.ready_without_data(time.monotonic())
        return []

    def write(self, data: bytes) -> None:
        assert self._port is not None
        if os.write(self._port.fileno(), data) != len(data):
            raise BlockingIOError(f"{self._path} takes no more data")

    def look(self, now: float) -> str:
        """Other readers of the port; empty: none known."""
        return "" if self._users is None else self._users.trouble(now)

    def describe(self) -> str:
        at = f" ({self._path})" if self._path and self._path not in self._name else ""
        return f"{self._name}{at}"


def find_usb_port(vendor: int, product: int, serial_number: str) -> str:
    """The path of the port with these USB ids; OSError if there is none, or more than one."""
    found = [
        port
        for port in list_ports.comports()
        if (port.vid, port.pid) == (vendor, product)
        and serial_number in ("", port.serial_number or "")
    ]
    if len(found) == 1:
        return str(found[0].device)
    if found:
        numbers = ", ".join(f"{port.device} {port.serial_number}" for port in found)
        raise OSError(
            f"{len(found)} devices have these ids: add the serial number of one ({numbers})"
        )
    raise FileNotFoundError(f"no such USB device is plugged in{_ports()}")


def explain(error: OSError, path: str) -> OSError:
    """The same failure with what a person can do about it."""
    if error.errno == errno.ENOENT:
        return FileNotFoundError(f"no such port, is it plugged in?{_ports()}")
    if error.errno == errno.EACCES:
        fix = "add yourself to the group of the port (ls -l shows it, often dialout) and log in"
        return PermissionError(f"permission denied: {fix} again")
    if error.errno in (errno.EAGAIN, errno.EBUSY):
        return BlockingIOError(f"the port is in use by another program ({_users(path)})")
    if error.errno == errno.ENOTTY or "Could not configure port" in str(error):
        return OSError(f"{path} is no serial port")
    return error


def _users(path: str) -> str:
    try:
        users = users_of(os.stat(path).st_rdev)
    except OSError:
        users = []  # unplugged meanwhile
    return ", ".join(users) or f"sudo fuser -v {path} shows which"


def _ports() -> str:
    """Which serial ports there are, for a message."""
    known = ", ".join(sorted(str(port.device) for port in list_ports.comports()))
    return f" (serial ports here: {known})" if known else " (there is no serial port here)"
