"""Nodes of the dronecan library and ours on one bus in memory, in virtual time: what each saw.

A program, since load_dsdl rebuilds every type of the library: the folder of our types is its
argument, what came of each story goes to the standard output as JSON.
"""

import importlib
import json
import logging
import sys
import time

START = 1000.0


class Clock:
    now = START


# Before the library is imported: it reads this clock by itself.
time.monotonic = lambda: Clock.now

import dronecan  # noqa: E402

dronecan.load_dsdl(sys.argv[1])

from dronecan import transport, uavcan  # noqa: E402
from dronecan.app import dynamic_node_id, node_monitor  # noqa: E402
from dronecan.driver.common import AbstractDriver, CANFrame  # noqa: E402
from dronecan.node import Node  # noqa: E402

from chute_ros.protocol.dronecan.allocation import KeepTable  # noqa: E402
from chute_ros.protocol.dronecan.bus_node import BusNode, BusNodeConfig  # noqa: E402
from chute_ros.protocol.dronecan.calls import Call  # noqa: E402
from chute_ros.protocol.dronecan.can_frame import CanFrame, pack, unpack  # noqa: E402
from chute_ros.protocol.dronecan.endpoint import Endpoint  # noqa: E402
from chute_ros.transport.data_types import load_data_types  # noqa: E402

# They came with the library itself, and have the types that it has replaced since.
NodeMonitor = importlib.reload(node_monitor).NodeMonitor
CentralizedServer = importlib.reload(dynamic_node_id).CentralizedServer

TYPES = load_data_types(sys.argv[1], "here")
UID = bytes(range(16))
OTHER = bytes(range(100, 116))


class Bus(AbstractDriver):
    """The library's driver of a bus in memory, with our node at its other end."""

    def __init__(self, **config):
        super().__init__()
        config = {"allocator": False, "time_master": False, **config}
        self.ours = BusNode(TYPES, BusNodeConfig(10, "org.test.us", UID, **config))
        self.ours.owner_alive(START + 1e6)
        #: More of ours that listen to all and speak by themselves.
        self.endpoints = []
        self.handed_on = []
        self.events = []
        self.ended = {}
        self._to_library = []

    def receive(self, timeout=None):
        if not self._to_library:
            return None
        one = unpack(self._to_library.pop(0))
        return CANFrame(one.identifier, one.data, True, ts_monotonic=Clock.now, ts_real=Clock.now)

    def send_frame(self, frame):
        self.deliver(pack(CanFrame(frame.id, bytes(frame.data))), self)

    def deliver(self, data, sender):
        if sender is not self:
            self._to_library.append(data)
        if sender is not self.ours:
            heard = self.ours.receive(data, Clock.now)
            if heard is not None:
                self.handed_on.append((heard.kind.name, heard.name, heard.source, heard.values))
        for endpoint, handle in self.endpoints:
            if sender is not endpoint:
                heard = endpoint.receive(data, Clock.now)
                if heard is not None:
                    handle(heard)

    def run(self, seconds, *nodes):
        """Everybody, in steps of 10 ms."""
        for _ in range(round(seconds * 100)):
            Clock.now += 0.01
            self.ours.update(Clock.now)
            for event in self.ours.take_events():
                self.events.append(event)
                if isinstance(event, KeepTable):
                    self.ours.table_kept(event.number)
            for one in (self.ours, *[endpoint for endpoint, _ in self.endpoints]):
                for data in one.take_output():
                    self.deliver(data, one)
            self.ended.update(self.ours.take_ended())
            for node in nodes:
                node.spin(0)


def library_node(bus, node_id=50):
    info = uavcan.protocol.GetNodeInfo.Response()
    info.name = "org.test.library"
    info.hardware_version.unique_id.from_bytes(OTHER)
    return Node(bus, node_id=node_id, node_info=info)


def who_is_there():
    bus = Bus()
    node = library_node(bus)
    monitor = NodeMonitor(node)
    bus.run(3.0, node)
    (entry,) = list(monitor.find_all(lambda _: True))
    seen = bus.ours.nodes.get(50)
    return {
        "seen_by_the_library": [
            entry.node_id,
            str(entry.info.name),
            entry.info.hardware_version.unique_id.to_bytes().hex(),
            entry.status.uptime_sec,
        ],
        "seen_by_us": [seen.node_id, seen.name, seen.unique_id.hex(), seen.uptime],
        "counts": bus.ours.counts,
    }


def what_is_served():
    bus = Bus()
    node = library_node(bus)
    answers = {}

    def ask(name, request):
        node.request(
            request, 10, lambda event: answers.update({name: event and repr(event.response)})
        )

    bus.run(1.0, node)
    ask("stats", uavcan.protocol.GetTransportStats.Request())
    ask("restart", uavcan.protocol.RestartNode.Request(magic_number=0xACCE551B1E))
    ask("opcode", uavcan.protocol.param.ExecuteOpcode.Request(opcode=1))
    ask("parameter", uavcan.protocol.param.GetSet.Request(index=0))
    ask("shell", uavcan.protocol.AccessCommandShell.Request())
    bus.run(1.5, node)
    return answers


def what_we_ask():
    bus = Bus()
    node = library_node(bus)

    def get_set(event):
        answer = uavcan.protocol.param.GetSet.Response()
        if not len(event.request.name) and event.request.index < 3:
            answer.name = f"parameter {event.request.index}"
            answer.value.integer_value = -event.request.index
        return answer

    node.add_handler(uavcan.protocol.param.GetSet, get_set)

    def script():
        names = []
        for index in range(4):
            answer = yield Call(50, "uavcan.protocol.param.GetSet", {"index": index})
            names.append([answer.values["name"].decode(), answer.values["value"]])
        return names

    bus.ours.begin("list", script(), Clock.now)
    status = dronecan.thirdparty.flyfire.ParachuteStatus
    message = status(state=status().STATE_ARMED, height_of_home=12.5, is_vehicle_connected=1)
    node.broadcast(message)
    bus.run(0.5, node)
    return {"list": bus.ended["list"], "heard": bus.handed_on[0]}


def time_of_the_bus():
    bus = Bus(time_master=True, utc_offset=1.7e9)
    node = library_node(bus)
    heard = []
    node.add_handler(
        uavcan.protocol.GlobalTimeSync,
        lambda event: heard.append(event.message.previous_transmission_timestamp_usec),
    )
    bus.run(2.5, node)
    return heard


def id_from_our_allocator(other_allocator=False):
    bus = Bus(allocator=True, never=(33, 34))
    node = library_node(bus)
    given, sent = [], []
    allocation = uavcan.protocol.dynamic_node_id.Allocation

    def ask(known):
        part = {0: 6, 6: 6, 12: 4}[known]
        message = allocation(first_part_of_unique_id=known == 0, node_id=33)
        message.unique_id.from_bytes(OTHER[known : known + part])
        transfer = transport.Transfer(
            payload=message,
            source_node_id=0,
            transfer_id=len(sent),
            transfer_priority=30,
            discriminator=len(sent) * 77,
        )
        sent.append(known)
        for frame in transfer.to_frames():
            # By a device that is neither of the two nodes: both hear it.
            bus.deliver(pack(CanFrame(frame.message_id, bytes(frame.bytes))), None)

    def heard(event):
        said = event.message.unique_id.to_bytes()
        if event.transfer.source_node_id and OTHER.startswith(said):
            if event.message.node_id:
                given.append([event.transfer.source_node_id, event.message.node_id])
            else:
                ask(len(said))

    node.add_handler(allocation, heard)
    if other_allocator:
        server = CentralizedServer(node, NodeMonitor(node))
        bus.run(3.0, node)
        ask(0)
        bus.run(1.0, node)
        server.close()
        return [event.text for event in bus.events if not isinstance(event, KeepTable)]
    bus.run(2.0, node)
    ask(0)
    bus.run(1.0, node)
    tables = [event.table for event in bus.events if isinstance(event, KeepTable)]
    return {
        "sent": sent,
        "given": given,
        "table": [[one.hex(), number] for one, number in tables[-1].items()],
    }


def our_frames_to_the_librarys_allocator():
    bus = Bus()
    node = library_node(bus)
    CentralizedServer(node, NodeMonitor(node))
    device, given = Endpoint(TYPES, 0), []
    name = "uavcan.protocol.dynamic_node_id.Allocation"
    unique_id = bytes(range(200, 216))

    def ask(known):
        part = unique_id[known : known + 6]
        device.broadcast(name, {"first_part_of_unique_id": known == 0, "unique_id": part})

    def handle(heard):
        if heard.name == name and heard.source:
            if heard.values["node_id"]:
                given.append([heard.values["unique_id"].hex(), heard.values["node_id"]])
            else:
                ask(len(heard.values["unique_id"]))

    bus.endpoints.append((device, handle))
    bus.run(3.0, node)
    ask(0)
    bus.run(1.0, node)
    return given


def _plain(one):
    return one.hex() if isinstance(one, bytes) else dict(one)


if __name__ == "__main__":
    # Its node monitor takes our GetNodeInfo request for a response, raises, and logs that.
    logging.disable(logging.CRITICAL)
    stories = {
        "who is there": who_is_there(),
        "what is served": what_is_served(),
        "what we ask": what_we_ask(),
        "time": time_of_the_bus(),
        "our allocator": id_from_our_allocator(),
        "two allocators": id_from_our_allocator(other_allocator=True),
        "their allocator": our_frames_to_the_librarys_allocator(),
    }
    json.dump(stories, sys.stdout, default=_plain)
