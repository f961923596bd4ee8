"""The wire for the address of a CAN bus."""

from __future__ import annotations

from chute_ros.transport.can_address import CanAddress
from chute_ros.transport.can_bus import CanBusWire
from chute_ros.transport.can_multicast import CanMulticastWire


def make_can_wire(address: CanAddress) -> CanMulticastWire | CanBusWire:
    """Not opened yet."""
    if address.interface == "mcast":
        return CanMulticastWire(address)
    return CanBusWire(address)
