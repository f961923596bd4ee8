"""Where a CAN bus is, in one string.

mcast:BUS[:PORT]         CAN over UDP multicast on this host, as pydronecan, the DroneCAN GUI Tool
                         and ArduPilot's simulation speak it: bus 0 to 255, port 57732 if not said
INTERFACE:CHANNEL        any interface of python-can: socketcan:can0, slcan:/dev/ttyACM0,
                         pcan:PCAN_USBBUS1, udp_multicast:239.74.163.2[:PORT], ...
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
    the interface is set up."""

    interface: str
    channel: str
    port: int = 0
    bitrate: int = 0


def _number(text: str, highest: int, what: str, whole: str) -> int:
    if text.isascii() and text.isdigit() and int(text) <= highest:
        return int(text)
    raise ParameterError(
        f"connection {whole!r}: {what} {text!r} is no number from 0 to {highest}: need {CAN_FORMS}"
    )


def parse_can_address(text: str, bitrate: int = 0) -> CanAddress:
    """The address in text; ParameterError with the allowed forms if it is none."""
    interface, colon, channel = text.partition(":")
    if not colon or not interface or not channel:
        raise ParameterError(f"connection {text!r} is not understood: need {CAN_FORMS}")
    if interface == "mcast":
        bus, _, port = channel.partition(":")
        number = _number(bus, 255, "bus", text)
        at = _number(port, 65535, "port", text) if port else MULTICAST_PORT
        return CanAddress(interface, str(number), at, bitrate)
    if interface not in _python_can_interfaces():
        known = ", ".join(sorted(_python_can_interfaces()))
        raise ParameterError(
            f"connection {text!r}: {interface!r} is no interface: need mcast or one of {known}"
        )
    if interface == "udp_multicast":
        group, _, port = channel.rpartition(":")
        if not _is_group(channel) and _is_group(group):
            return CanAddress(interface, group, _number(port, 65535, "port", text), bitrate)
        if not _is_group(channel):
            raise ParameterError(
                f"connection {text!r}: {channel!r} is no multicast address with an optional port, "
                "for example 239.74.163.2:43113"
            )
        return CanAddress(interface, channel, UDP_MULTICAST_PORT, bitrate)
    return CanAddress(interface, channel, 0, bitrate)


def _python_can_interfaces() -> frozenset[str]:
    # Here: a bus over mcast does not wait for the import.
    import can

    return frozenset(can.VALID_INTERFACES)


def _is_group(text: str) -> bool:
    try:
        return ipaddress.ip_address(text).is_multicast
    except ValueError:
        return False
