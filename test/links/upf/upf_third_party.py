"""The dronecan library as a party on the bus, with its own driver. A program: FOLDER BUS STORY.

Each story writes what it has seen to the standard output, one JSON object a line.
"""

import json
import sys
import time

import dronecan

dronecan.load_dsdl(sys.argv[1])

# load_dsdl makes every type anew: what has taken hold of them before would see nothing.
import importlib  # noqa: E402

from dronecan import uavcan  # noqa: E402
from dronecan.app import dynamic_node_id, node_monitor  # noqa: E402
from dronecan.transport import TransferError  # noqa: E402

for module in (node_monitor, dynamic_node_id):
    importlib.reload(module)

NODE_ID, OURS, CONTROLLER = 60, 100, 33
PATIENCE = 60.0
flyfire = dronecan.thirdparty.flyfire


class Party:
    """One node of the library."""

    def __init__(self, bus):
        self.node = dronecan.make_node(f"mcast:{bus}", node_id=NODE_ID)
        self.node.mode = uavcan.protocol.NodeStatus().MODE_OPERATIONAL
        self.monitor = node_monitor.NodeMonitor(self.node)

    def until(self, condition, what):
        end = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > end:
                raise SystemExit(f"not within {PATIENCE:g} s: {what}")
            try:
                self.node.spin(0.005)
            except TransferError as error:
                print(f"ignored: {error}", file=sys.stderr)

    def ask(self, request, node_id=CONTROLLER):
        """A request; its response. Sent again where the answer does not come."""
        while True:
            came = []
            self.node.request(request, node_id, came.append, timeout=5.0)
            self.until(lambda came=came: came, f"{node_id} answers")
            if came[0] is not None:
                return came[0].response

    def parameter(self, **fields):
        """GetSet; (name, value) of the answer."""
        request = uavcan.protocol.param.GetSet.Request(**fields)
        answer = self.ask(request)
        union = dronecan.get_active_union_field(answer.value)
        return str(answer.name), union, plain(getattr(answer.value, union))


def plain(value):
    """What JSON can hold."""
    return str(value) if not isinstance(value, (int, float)) else value


def say(**seen):
    print(json.dumps(seen), flush=True)


def watch(party):
    """Who is there, and what ours says."""
    heard = {}

    def keep(event):
        if event.transfer.source_node_id == OURS:
            heard[dronecan.get_dronecan_data_type(event.message).full_name] = event.message

    for kind in (
        uavcan.protocol.NodeStatus,
        uavcan.protocol.GlobalTimeSync,
        flyfire.VehicleStatus,
    ):
        party.node.add_handler(kind, keep)

    def known():
        entries = [e for e in party.monitor.find_all(lambda _: True) if e.info is not None]
        return len(entries) >= 3 and len(heard) == 3 and is_set(heard)

    def is_set(heard):
        return heard["uavcan.protocol.GlobalTimeSync"].previous_transmission_timestamp_usec

    party.until(known, "all three nodes and messages are known")
    for entry in party.monitor.find_all(lambda _: True):
        hardware = entry.info.hardware_version
        unique = bytes(bytearray(hardware.unique_id)).hex()
        say(node=entry.node_id, name=str(entry.info.name), unique_id=unique)
    status = heard["uavcan.protocol.NodeStatus"]
    vehicle = heard["flyfire.VehicleStatus"]
    say(
        health=status.health,
        mode=status.mode,
        uptime=status.uptime_sec,
        state=vehicle.state,
        height=vehicle.height_of_home,
        vz=vehicle.vz,
        connected=bool(vehicle.is_parachute_connected),
        time=heard["uavcan.protocol.GlobalTimeSync"].previous_transmission_timestamp_usec,
    )
    stats = party.ask(uavcan.protocol.GetTransportStats.Request(), OURS)
    say(transfers_tx=stats.transfers_tx, transfers_rx=stats.transfers_rx)
    restart = uavcan.protocol.RestartNode.Request()
    restart.magic_number = restart.MAGIC_NUMBER
    say(restart=bool(party.ask(restart, OURS).ok))


def edit(party):
    """What a parameter editor does with the controller."""
    listed = []
    while True:
        name, union, value = party.parameter(index=len(listed))
        if not name:
            break
        listed.append((name, union, value))
    say(listed=listed)
    value = uavcan.protocol.param.Value(boolean_value=0)
    say(set=party.parameter(name="Enable Auto-Save", value=value))
    say(set=party.parameter(name="Enable Light", value=value))
    opcode = uavcan.protocol.param.ExecuteOpcode.Request()
    opcode.opcode = opcode.OPCODE_SAVE
    say(saved=bool(party.ask(opcode).ok))
    restart = uavcan.protocol.RestartNode.Request()
    restart.magic_number = 7
    say(restart=bool(party.ask(restart).ok))
    restart.magic_number = restart.MAGIC_NUMBER
    say(restart=bool(party.ask(restart).ok))
    say(get=party.parameter(name="Enable Light"))


def kill(party):
    """What a controller does before it launches."""
    request = flyfire.VehicleService.Request()
    request.type = request.TYPE_KILLSWITCH
    request.magic_number = 7
    bad = party.ask(request, OURS)
    say(bad=bad.result == bad.RESULT_BAD_MAGIC_NUMBER)
    request.magic_number = request.MAGIC_NUMBER
    answer = party.ask(request, OURS)
    say(success=answer.result == answer.RESULT_SUCCESS)


def allocate(party):
    """A second allocator, until it is ended."""
    server = dynamic_node_id.CentralizedServer(party.node, party.monitor)
    say(ready=len(server.get_allocation_table()) > 0)
    party.until(lambda: False, "the end")


STORIES = {"watch": watch, "edit": edit, "kill": kill, "allocate": allocate}

if __name__ == "__main__":
    STORIES[sys.argv[3]](Party(sys.argv[2]))
