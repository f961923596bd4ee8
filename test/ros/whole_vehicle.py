"""A vehicle with a node of every kind and, where one can be simulated quickly, its device."""

import upf_bench
from mavlink_bench import Autopilot, Module, Network
from node_bench import Bench

from chute_ros.links.relay.node import RelayNode
from chute_ros.links.umbilical.node import UmbilicalNode
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode

#: Names of its nodes.
NODES = {"mavlink_parachute", "upf_can", "umbilical", "relay", "safety_supervisor"}


def start_whole_vehicle(bench: Bench) -> None:
    """In the bench's namespace. The supervisor records."""
    network = Network(bench)
    network.plug(Module())
    network.plug(Autopilot())
    upf_bench.Devices(upf_bench.Network(bench))
    bench.add(UmbilicalNode, connection="serial:/nowhere/ttyACM0", publish_vehicle_state=True)
    bench.add(RelayNode, connection="serial:/nowhere/ttyUSB0")
    bench.add(SafetySupervisorNode, black_box_folder=str(bench.folder / "box"))
