"""Address of a CAN bus, in one string.

mcast:BUS[:PORT]         CAN over UDP multicast on this host, as pydronecan, the DroneCAN GUI Tool
                         and ArduPilot's simulation speak it: bus 0 to 255, port 57732 if not said
INTERFACE:CHANNEL        any interface of python-can: socketcan:can0, slcan:/dev/ttyACM0,
                         pcan:PCAN_USBBUS1, udp_multicast:239.74.163.2[:PORT], ...; slcan
                         takes the speed of its serial line as slcan:/dev/ttyUSB0@115200
"""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass

from chute_ros.errors import ParameterError

CAN_FORMS = (
    "mcast:BUS[:PORT] (UDP multicast on this host, bus 0 to 255), or INTERFACE:CHANNEL of "
    "python-can, for example socketcan:can0 or slcan:/dev/ttyACM0"
)
MULTICAST_PORT = 57732
UDP_MULTICAST_PORT = 43113


@dataclass(frozen=True)
class CanAddress:
    """A parsed connection string. port: of the two multicast kinds, else 0; bitrate: bit/s, 0: as
    the interface is set up, or the library's default."""

    interface: str
    channel: str
    port: int = 0
    bitrate: int = 0


def parse_can_address(text: str, bitrate: int = 0) -> CanAddress:
    """The address in text; ParameterError with the allowed forms if it is none."""
    if bitrate < 0:
        raise ParameterError(f"bitrate {bitrate} is no number of bit/s: need 0 or more")
    interface, _, channel = text.partition(":")
    if not interface or not channel:
        raise ParameterError(f"connection {text!r} is not understood: need {CAN_FORMS}")
    if interface == "mcast":
        bus, colon, port = channel.partition(":")
        number = _number(bus, 255, "bus", text)
        at = _port(port, text) if colon else MULTICAST_PORT
        return CanAddress(interface, str(number), at, bitrate)
    # Here: a bus over mcast does not wait for the import (0.2 s).
    import can

    known = can.VALID_INTERFACES
    if interface not in known:
        raise ParameterError(
            f"connection {text!r}: {interface!r} is no interface: need mcast or one of "
            f"{', '.join(sorted(known))}; that is {CAN_FORMS}"
        )
    if interface == "udp_multicast":
        return CanAddress(interface, *_group_and_port(channel, text), bitrate)
    # Whatever the interface takes: names under /dev/serial/by-path hold colons of their own.
    return CanAddress(interface, channel, 0, bitrate)


def _number(text: str, highest: int, what: str, whole: str) -> int:
    if text.isascii() and text.isdigit() and len(text) < 10 and int(text) <= highest:
        return int(text)
    raise ParameterError(
        f"connection {whole!r}: {what} {text!r} is no number from 0 to {highest}: need {CAN_FORMS}"
    )


def _port(text: str, whole: str) -> int:
    number = _number(text, 65535, "port", whole)
    if not number:
        raise ParameterError(
            f"connection {whole!r}: nothing can be sent to port 0: need {CAN_FORMS}"
        )
    return number


def _group_and_port(channel: str, whole: str) -> tuple[str, int]:
    """An IPv6 group takes no port: it could not be told from the group's last part."""
    group, colon, port = channel.partition(":")
    if _is_group(channel):
        return channel, UDP_MULTICAST_PORT
    if colon and _is_group(group):
        return group, _port(port, whole)
    raise ParameterError(
        f"connection {whole!r}: {channel!r} is no multicast address, with a port or without, such "
        f"as 239.74.163.2:43113 or ff15::1: need {CAN_FORMS}"
    )


def _is_group(text: str) -> bool:
    try:
        return ipaddress.ip_address(text).is_multicast
    except ValueError:
        return False
