"""Interface of every byte wire, and its making from an address."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, Protocol, runtime_checkable

from chute_ros.transport.address import Address
from chute_ros.transport.serial_wire import SerialWire, find_usb_port
from chute_ros.transport.tcp import TcpClientWire, TcpServerWire
from chute_ros.transport.udp import UdpWire
from chute_ros.transport.wire_events import WireTrouble

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


@runtime_checkable
class WatchfulWire(Protocol):
    """A wire that can be in trouble while it is open."""

    def look(self, now: float) -> str:
        """Look at the clock. Returns what is wrong, in words; empty: nothing is."""


@runtime_checkable
class ServingWire(Protocol):
    """A wire that keeps places for clients."""

    def data_heard(self, stream: Hashable, framed: bool, now: float) -> None:
        """The protocol has taken the next of the data that were read last. framed: it held a
        frame."""


class WireWatch:
    """Troubles of one open wire, and its clients that send frames.

    frames: how many frames the protocol has taken; None: all that comes counts.
    deliver: gets a WireTrouble whenever it changes."""

    def __init__(
        self, wire: Wire, frames: Callable[[], int] | None, deliver: Callable[[list[Any]], None]
    ) -> None:
        self._watchful = wire if isinstance(wire, WatchfulWire) else None
        self._serving = wire if isinstance(wire, ServingWire) else None
        self._frames = frames
        self._before = 0
        self._deliver = deliver
        self._trouble = ""

    def before_data(self) -> None:
        """Data is about to be given to the protocol."""
        if self._frames is not None:
            self._before = self._frames()

    def data_heard(self, stream: Hashable, now: float) -> None:
        """The protocol has data of this stream."""
        framed = self._frames is None or self._frames() > self._before
        if self._serving is not None:
            self._serving.data_heard(stream, framed, now)

    def look(self, now: float) -> None:
        """Look at the clock."""
        text = "" if self._watchful is None else self._watchful.look(now)
        if text != self._trouble:
            self._trouble = text
            self._deliver([WireTrouble(text)])


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
