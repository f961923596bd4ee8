"""One test's corner of ROS: nodes, simulators over real UDP, and a client, all in this process."""

import gc
import itertools
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from chute_ros.ros import qos
from chute_ros.ros.node_executor import NodeExecutor
from chute_ros.sim.bundle import WireBundle
from chute_ros.sim.faults import FaultKnobs, FaultyLink
from chute_ros.transport.address import parse_address
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.wire import Wire, make_wire

LOCAL = "127.0.0.1"
#: How long anything that must happen may take on a busy machine, s.
PATIENCE = 20.0
_numbers = itertools.count(1)


def port_of(loop: WireLoop[Any]) -> int:
    """The port that a listening loop has really bound."""
    return int(loop.wire.describe().split(" + ")[0].split(":")[2])


class Bench:
    """Makes nodes and simulators, waits for what must happen, and takes all down again."""

    def __init__(self, namespace: str) -> None:
        self.namespace = namespace
        #: For files of this test; removed at its end.
        self.folder = Path(tempfile.mkdtemp(prefix="chute_ros_test_"))
        self.executor = NodeExecutor()
        self.nodes: list[Node] = []
        self.loops: list[WireLoop[Any]] = []
        #: What else is taken down.
        self.at_end = ExitStack()
        self.client = Node("client", namespace=namespace)
        self.executor.add_node(self.client)
        self.nodes.append(self.client)
        self._publishers: dict[str, Any] = {}
        self._half_built = False

    def add(self, make: Callable[..., Node], *args: Any, **parameters: Any) -> Any:
        """A node of this namespace with these parameters, spun together with the others."""
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        try:
            node = make(*args, namespace=self.namespace, parameter_overrides=overrides)
        except Exception:
            self._half_built = True
            raise
        self.executor.add_node(node)
        self.nodes.append(node)
        return node

    def remove(self, node: Node) -> None:
        """As if the node's process had ended."""
        self.nodes.remove(node)
        self.executor.remove_node(node)
        node.destroy_node()

    def simulate(
        self, device: Any, *connections: str, knobs: FaultKnobs | None = None
    ) -> WireLoop[Any]:
        """Run a simulated device on these wires."""
        link = device if knobs is None else FaultyLink(device, knobs, seed=1)
        wires = [make_wire(parse_address(text)) for text in connections]
        return self.simulate_on(WireBundle(wires), link)

    def simulate_on(self, wire: Wire, device: Any) -> WireLoop[Any]:
        """The same on a wire that is made already."""
        loop = WireLoop(device, wire, lambda events: None)
        loop.start()
        self.loops.append(loop)
        return loop

    def unplug(self, loop: WireLoop[Any]) -> None:
        """Take a simulated device off its wire."""
        self.loops.remove(loop)
        loop.stop()

    def have(self, loop: WireLoop[Any], function: Callable[[Any], Any]) -> Any:
        """Have function(device) called in the thread of a simulated device; what it gives."""
        done: list[Any] = []
        loop.call(lambda device, now: done.append(function(device)))
        self.until(lambda: done, "the simulator has done so")
        return done[0]

    def close(self) -> None:
        """Take everything down."""
        for loop in self.loops:
            loop.stop()
        self.at_end.close()
        for node in self.nodes:
            self.executor.remove_node(node)
            node.destroy_node()
        self.executor.shutdown()
        if self._half_built:
            # What was not built to its end is in the graph for as long as it is in memory.
            gc.collect()
        shutil.rmtree(self.folder)

    # -- waiting --------------------------------------------------------------------------------

    def spin(self) -> None:
        """Let ROS do one thing, or wait for it a moment."""
        self.executor.spin_once(timeout_sec=0.01)

    def until(self, condition: Callable[[], Any], what: str, seconds: float = PATIENCE) -> Any:
        """Spin until condition() is true; its value."""
        end = time.monotonic() + seconds
        while True:
            value = condition()
            if value:
                return value
            assert time.monotonic() < end, f"not within {seconds:g} s: {what}"
            self.spin()

    def turns(self, seconds: float) -> None:
        """Spin for a time in which something must not happen."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.spin()

    # -- speaking -------------------------------------------------------------------------------

    def follow(self, kind: Any, topic: str, profile: Any = qos.STATUS) -> list[Any]:
        """A list that grows by every message on topic."""
        heard: list[Any] = []
        self.client.create_subscription(kind, topic, heard.append, profile)
        return heard

    def follow_log(self) -> list[Any]:
        """A list that grows by every line of any node's log."""
        return self.follow(Log, "/rosout", QoSProfile(depth=1000))

    def publish(self, message: Any, topic: str, profile: Any = qos.STATUS) -> None:
        """Publish once somebody listens."""
        if topic not in self._publishers:
            publisher = self.client.create_publisher(type(message), topic, profile)
            self._publishers[topic] = publisher
            self.until(publisher.get_subscription_count, f"somebody listens to {topic}")
        self._publishers[topic].publish(message)

    def ask(self, kind: Any, service: str, **fields: Any) -> Any:
        """Call a service; the future of its answer."""
        client = self.client.create_client(kind, service)
        self.until(client.service_is_ready, f"{service} is offered")
        return client.call_async(kind.Request(**fields))

    def call(self, kind: Any, service: str, **fields: Any) -> Any:
        """Call a service; its answer."""
        future = self.ask(kind, service, **fields)
        self.until(future.done, f"{service} answers")
        return future.result()


@pytest.fixture
def bench(namespace: str) -> Iterator[Bench]:
    """Nodes, simulators and a client of this test alone."""
    one = Bench(namespace)
    yield one
    one.close()


def stamped(node: Node, message: Any, age: float = 0.0) -> Any:
    """message with the wall clock, less age (s), as its stamp."""
    nanoseconds = time.time_ns() - int(age * 1e9)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(nanoseconds, 10**9)
    return message


def newest(messages: list[Any], **fields: Any) -> Callable[[], Any]:
    """A condition: the newest message has these fields."""
    return lambda: (
        messages
        and all(getattr(messages[-1], name) == value for name, value in fields.items())
        and messages[-1]
    )
