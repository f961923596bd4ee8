"""From the bytes of a MAVLink datagram or a CAN frame to a message: what a message costs.

Our decoder, and the whole link that it is a part of, beside what the libraries offer. Batches take
turns, in one run.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from typing import Any, Protocol

from bench.command import at_least, run
from bench.decoding import Batch, Peer, Times, take_turns, times_table
from bench.report import load
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.links.upf.protocol.config import AllocatorUse, UpfConfig
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.protocol.link import UpfLink
from chute_ros.links.upf.simulator.bus import UpfBus
from chute_ros.links.upf.simulator.controller import UpfController
from chute_ros.links.upf.simulator.trigger import UpfTrigger
from chute_ros.protocol.dronecan.can_frame import unpack
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameDecoder
from chute_ros.sim.autopilot_device import AutopilotDevice
from chute_ros.transport.data_types import load_data_types
from chute_ros.transport.shared_folder import shared_folder

HEADING = "Decoding"

LINK, DECODER = "chute_ros, whole link", "chute_ros, decoder"
PYMAVLINK, DRONECAN = "pymavlink", "dronecan"
#: Datagrams, or CAN frames, of a batch.
BATCH = 100


class Device(Protocol):
    """A simulated one, or several."""

    def update(self, now: float) -> None: ...
    def next_deadline(self) -> float: ...
    def take_output(self) -> list[bytes]: ...


class Network:
    """Several devices as one."""

    def __init__(self, devices: list[Device]) -> None:
        self._devices = devices

    def update(self, now: float) -> None:
        for device in self._devices:
            device.update(now)

    def next_deadline(self) -> float:
        return min(device.next_deadline() for device in self._devices)

    def take_output(self) -> list[bytes]:
        return [data for device in self._devices for data in device.take_output()]


class Bare:
    """pymavlink alone, as its examples use it."""

    def __init__(self) -> None:
        self._parser = dialect.MAVLink(None)
        self._parser.robust_parsing = True

    def feed(self, data: bytes, _: float) -> int:
        return len(self._parser.parse_buffer(data) or ())


class Decoder:
    """Bytes to messages, each checked, and who sent them."""

    def __init__(self) -> None:
        self._decoder = FrameDecoder()

    def feed(self, data: bytes, now: float) -> int:
        return len(self._decoder.feed_datagram(data, now))


class Link:
    """What the loop between wire and protocol does with a link each time that bytes came."""

    def __init__(self, link: Any, received: Any) -> None:
        self._link, self._received = link, received
        link.owner_alive(math.inf)

    def feed(self, data: bytes, now: float) -> int:
        link = self._link
        before: int = self._received()
        link.receive(data, now, "wire")
        link.update(now)
        link.take_output()
        link.take_events()
        link.next_deadline()
        after: int = self._received()
        return after - before


class BareCan:
    """dronecan alone: its frames, its transfers, its types."""

    def __init__(self) -> None:
        import dronecan
        from dronecan import transport

        dronecan.load_dsdl(str(shared_folder("dsdl/flyfire", "the DroneCAN data types")))
        self._frame, self._transfer = transport.Frame, transport.Transfer
        self._manager = transport.TransferManager()

    def feed(self, data: bytes, now: float) -> int:
        frame = unpack(data)
        assert frame is not None
        frames = self._manager.receive_frame(
            self._frame(frame.identifier, frame.data, ts_monotonic=now)
        )
        if not frames:
            return 0
        transfer = self._transfer()
        transfer.from_frames(frames)
        return transfer.payload is not None


class CanDecoder:
    """Frames to transfers to values, each checked."""

    def __init__(self, definitions: Definitions) -> None:
        self._endpoint = Endpoint(definitions.types, 100)

    def feed(self, data: bytes, now: float) -> int:
        return self._endpoint.receive(data, now) is not None


def add_options(options: argparse.ArgumentParser) -> None:
    """How much is measured."""
    options.add_argument(
        "--message-batches",
        type=at_least(int, 2),
        default=150,
        help=f"of {BATCH} datagrams or CAN frames to decode, to each peer (default: 150)",
    )


def section(chosen: argparse.Namespace) -> str:
    """Measure; the section without its heading."""
    before = load()
    definitions = Definitions(load_data_types("", "bench"))
    network = Network([AutopilotDevice(1, []), ParachuteDevice(ParachuteSettings(), [])])
    bus = UpfBus([UpfController(definitions), UpfTrigger(definitions)])
    mavlink = MavlinkLink(MavlinkConfig())
    upf = UpfLink(UpfConfig(allocator=AllocatorUse.NO), definitions.types)
    measured = {
        "MAVLink": take_turns(
            "MAVLink",
            {
                LINK: Link(mavlink, lambda: mavlink.received_count),
                DECODER: Decoder(),
                PYMAVLINK: Bare(),
            },
            _said(network, chosen.message_batches, Bare()),
        )
    }
    print("  decoding: MAVLink", file=sys.stderr, flush=True)
    endpoint = upf.bus.endpoint
    measured["DroneCAN"] = take_turns(
        "DroneCAN",
        {
            LINK: Link(upf, lambda: endpoint.received_count),
            DECODER: CanDecoder(definitions),
            DRONECAN: BareCan(),
        },
        _said(bus, chosen.message_batches, CanDecoder(definitions)),
    )
    print("  decoding: DroneCAN", file=sys.stderr, flush=True)
    return report(measured, chosen.message_batches, before)


def _said(device: Device, batches: int, counter: Peer) -> Iterator[tuple[Batch, int]]:
    """What a device says by itself, from its start on, and how many messages that is."""
    now = 0.0
    waiting: list[tuple[float, bytes]] = []
    for _ in range(batches):
        while len(waiting) < BATCH:
            device.update(now)
            waiting += [(now, data) for data in device.take_output()]
            now = max(device.next_deadline(), now + 1e-6)
        batch, waiting = waiting[:BATCH], waiting[BATCH:]
        yield batch, sum(counter.feed(data, at) for at, data in batch)


def report(measured: dict[str, dict[str, Times]], batches: int, before: str) -> str:
    """The section without its heading. before: the load of the machine when it began."""
    text = (
        f"{before}\n\n"
        "The simulated devices' own messages: an autopilot and a parachute on MAVLink,\n"
        "one datagram a read; a UPF controller and trigger on DroneCAN, one CAN frame a read.\n"
        "Decoder: bytes to messages, each checked. Whole link: all that the node's link does\n"
        "with it, with the pictures of its devices. The ratios are to the library alone.\n"
        f"{batches} batches of {BATCH} reads to each, taking turns, in one run.\n\n"
    )
    tables = (
        times_table("microseconds a message", {name: times}, base)
        for (name, times), base in zip(measured.items(), (PYMAVLINK, DRONECAN), strict=True)
    )
    return text + "\n\n".join(tables) + "\n"


if __name__ == "__main__":
    run("bench.device_decoding", __doc__ or "", [sys.modules[__name__]])
