"""The ports and buses that nodes are set to, and whether this user may use them here."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from chute_ros.errors import ParameterError
from chute_ros.tools.chute.diagnostic_tasks import Task
from chute_ros.tools.chute.finding import NOTE, OK, WRONG, DoctorFinding
from chute_ros.transport.address import parse_address
from chute_ros.transport.serial_wire import explain, find_usb_port

_NETWORKS = Path("/sys/class/net")
#: Serial ports that a vehicle's devices are on, if nothing names one.
_PATTERNS = ("ttyUSB*", "ttyACM*", "ttyAMA*", "ttyTHS*")


def connection_finding(
    node: str, connection: str, link: Task | None, look: Callable[[str], str]
) -> DoctorFinding:
    """A node's parameter connection. link: what the node itself says of its wire, from whatever
    computer; look: what is wrong with it here."""
    name = f"connection {connection} of {node}"
    if link is not None and link.level != "ERROR":
        return DoctorFinding(OK, f"{name}: {link.message}")
    here = look(connection)
    remedy = f"if {node} runs on another computer, look there"
    if link is not None:
        told = f"{name}: {link.message}"
        return DoctorFinding(
            WRONG, told, f"here: {here}; {remedy}" if here else "docs/guide/ has its settings"
        )
    return DoctorFinding(WRONG, f"{name}: {here}", remedy) if here else DoctorFinding(OK, name)


def trouble_here(connection: str) -> str:
    """What is wrong with the port or bus on this computer; empty: nothing, or it is none."""
    kind, _, rest = connection.partition(":")
    if kind == "socketcan":
        return _bus_trouble(rest)
    if kind == "slcan":
        return _port_trouble(rest.partition("@")[0])
    if kind not in ("serial", "usb"):
        return ""
    try:
        address = parse_address(connection)
        path = address.host
        if kind == "usb":
            path = find_usb_port(address.port, address.send_port, address.host)
    except (ParameterError, OSError) as error:
        return str(error)
    return _port_trouble(path)


def port_findings(folder: Path = Path("/dev")) -> list[DoctorFinding]:
    """Serial ports here that this user may not open."""
    found = []
    for path in sorted(one for pattern in _PATTERNS for one in folder.glob(pattern)):
        if trouble := _port_trouble(str(path)):
            found.append(DoctorFinding(NOTE, f"serial port {path}", trouble))
    return found


def _port_trouble(path: str) -> str:
    if not os.path.exists(path):
        return f"{path}: {explain(FileNotFoundError(2, ''), path)}"
    if not os.access(path, os.R_OK | os.W_OK):
        return f"{path}: {explain(PermissionError(13, ''), path)}"
    return ""


def _bus_trouble(name: str) -> str:
    flags = _NETWORKS / name / "flags"
    up = f"sudo ip link set {name} up type can bitrate 1000000"
    try:
        is_up = int(flags.read_text(), 16) & 1
    except (OSError, ValueError):
        return f"there is no CAN interface {name}: plug it in, then {up}"
    return "" if is_up else f"the CAN interface {name} is down: {up}"
