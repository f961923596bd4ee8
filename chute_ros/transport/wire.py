"""Interface of every byte wire, and its making from an address."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Protocol

from chute_ros.transport.address import Address
from chute_ros.transport.serial_ports import find_usb_port
from chute_ros.transport.serial_wire import SerialWire
from chute_ros.transport.tcp import TcpClientWire, TcpServerWire
from chute_ros.transport.udp import UdpWire

USB_BAUD = 115200


class Wire(Protocol):
    """A way for bytes. No method blocks; every failure of the medium is an OSError."""

    @property
    def is_open(self) -> bool:
        """The medium is there; files can be waited on."""

    def open(self) -> None:
        """Open or connect; OSError says why it cannot be."""

    def close(self) -> None:
        """Close; may be opened again."""

    def files(self) -> list[int]:
        """Descriptors that become readable when something has come."""

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        """What has come on file: (bytes, stream), with stream None for a datagram.

        Empty bytes: that stream has ended. OSError: the whole wire has.
        """

    def write(self, data: bytes) -> None:
        """Send to whoever is at the other end; OSError if it cannot be."""

    def describe(self) -> str:
        """Address of the wire, with the port that was really bound."""


def make_wire(address: Address) -> Wire:
    """The wire for an address; not opened yet."""
    if address.kind == "serial":
        path = address.host
        return SerialWire(f"serial:{path}:{address.port}", lambda: path, address.port)
    if address.kind == "usb":
        vendor, product, number = address.port, address.send_port, address.host
        name = f"usb:{vendor:04x}:{product:04x}" + (f":{number}" if number else "")
        # A port on USB has no baud rate of its own; some drivers want one all the same.
        return SerialWire(name, lambda: find_usb_port(vendor, product, number), USB_BAUD)
    if address.kind == "tcp":
        return TcpClientWire(address.host, address.port)
    if address.kind == "tcpin":
        return TcpServerWire(address.host, address.port)
    return UdpWire(address)
