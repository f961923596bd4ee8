"""What the stories of the DroneCAN protocol share: the data types, devices' frames, a bus node."""

import json
import subprocess
import sys
from functools import cache
from pathlib import Path

from chute_ros.protocol.dronecan.allocation import KeepTable
from chute_ros.protocol.dronecan.bus_node import BusNode, BusNodeConfig
from chute_ros.protocol.dronecan.can_frame import CanFrame, pack, unpack
from chute_ros.protocol.dronecan.endpoint import Endpoint, ReceivedTransfer
from chute_ros.protocol.events import Notice
from chute_ros.transport.data_types import load_data_types

FLYFIRE = Path(__file__).resolve().parents[3] / "msg_defs" / "dsdl" / "flyfire"
REFERENCE = Path(__file__).with_name("dronecan_reference.py")

NODE_STATUS = "uavcan.protocol.NodeStatus"
GET_NODE_INFO = "uavcan.protocol.GetNodeInfo"
GET_SET = "uavcan.protocol.param.GetSet"
OPCODE = "uavcan.protocol.param.ExecuteOpcode"
RESTART = "uavcan.protocol.RestartNode"
STATS = "uavcan.protocol.GetTransportStats"
ALLOCATION = "uavcan.protocol.dynamic_node_id.Allocation"
TIME = "uavcan.protocol.GlobalTimeSync"

START = 1000.0
OWN = 10
UID = bytes(range(16))


@cache
def types():
    """The standard types and those of this repository, not of an older build."""
    return load_data_types(str(FLYFIRE), "here")


def reference(tasks):
    """What the dronecan library itself makes of these, in a process of its own: see there."""
    done = subprocess.run(
        [sys.executable, REFERENCE, FLYFIRE],
        input=json.dumps(tasks),
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def raw(identifier, data):
    """A frame from its identifier and its data in hex."""
    return pack(CanFrame(identifier, bytes.fromhex(data)))


def shown(frames):
    """Frames as one reads them: identifier#data."""
    made = [unpack(frame) for frame in frames]
    return [f"{one.identifier:08x}#{one.data.hex()}" for one in made if one is not None]


class Bench:
    """Our node on a bus; t is seconds since the start of the story."""

    def __init__(self, node_id=OWN, **config):
        config = {"allocator": False, "time_master": False, **config}
        self.node = BusNode(types(), BusNodeConfig(node_id, "org.test.us", UID, **config))
        self.t = 0.0
        self.sent: list[tuple[float, ReceivedTransfer]] = []
        self.frames: list[bytes] = []
        self.events: list[Notice | KeepTable] = []
        self.handed_on: list[ReceivedTransfer] = []
        self._listeners: dict[int, Endpoint] = {}
        self._speakers: dict[int, Endpoint] = {}
        self.node.owner_alive(START + 1e6)
        self._update()

    @property
    def now(self):
        return START + self.t

    def at(self, t):
        """Go to t, waking at each deadline on the way."""
        assert t >= self.t
        for _ in range(10_000):
            wake = self.node.next_deadline() - START
            if wake > t:
                break
            assert wake >= self.t, "a deadline in the past"
            self.t = wake
            self._update()
        else:
            raise AssertionError("the node wants to be woken without end")
        self.t = t
        self._update()
        return self

    def speaker(self, node_id):
        """What node_id speaks with."""
        return self._speakers.setdefault(node_id, Endpoint(types(), node_id))

    def hear(self, node_id, name, /, **values):
        """This message comes from node_id."""
        self.speaker(node_id).broadcast(name, values)
        return self.carry(node_id)

    def asked(self, node_id, name, transfer_id=0, /, **values):
        """This request comes from node_id."""
        self.speaker(node_id).request(self.node.config.node_id, name, transfer_id, values, 16)
        return self.carry(node_id)

    def answer(self, request, server, /, **values):
        """node server answers a request of ours."""
        self.speaker(server).respond(request, values)
        return self.carry(server)

    def carry(self, node_id):
        return self.feed(*self.speaker(node_id).take_output())

    def feed(self, *frames):
        for frame in frames:
            heard = self.node.receive(frame, self.now)
            if heard is not None:
                self.handed_on.append(heard)
        self._update()
        return self

    def _update(self):
        self.node.update(self.now)
        self.events += self.node.take_events()
        for frame in self.node.take_output():
            self.frames.append(frame)
            made = unpack(frame)
            assert made is not None
            service = bool(made.identifier & 0x80)
            to = made.identifier >> 8 & 0x7F if service else 126
            listener = self._listeners.setdefault(to, Endpoint(types(), to))
            heard = listener.receive(frame, self.now)
            if heard is not None:
                self.sent.append((self.t, heard))

    # -- what came out -------------------------------------------------------------------------

    def said(self, name):
        """(t, values) of what was sent of this type."""
        return [(t, heard.values) for t, heard in self.sent if heard.name == name]

    def requests(self, name):
        return [h for _, h in self.sent if h.name == name and h.kind.value == "request"]

    def notices(self):
        return [one.text for one in self.events if isinstance(one, Notice)]

    def tables(self):
        return [one for one in self.events if isinstance(one, KeepTable)]

    def clear(self):
        self.sent.clear()
        self.frames.clear()
        self.events.clear()
        return self


def information(unique_id=b"\x77" * 16, name="org.test.other"):
    """Values of a GetNodeInfo response."""
    return {"hardware_version": {"unique_id": unique_id}, "name": name.encode()}
