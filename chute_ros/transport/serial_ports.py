"""Finding a serial port by its USB ids, and saying clearly why a port cannot be opened."""

from __future__ import annotations

import errno
import os

from serial.tools import list_ports

from chute_ros.transport.serial_users import users_of


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
            f"{len(found)} devices have these ids: add the serial number of one ({numbers})",
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
