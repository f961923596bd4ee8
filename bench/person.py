"""A person at a vehicle: sees safety/state, calls the services, and plays a link of its own."""

from __future__ import annotations

import threading
import time

import rclpy
from chute_msgs.msg import LinkHeartbeat, ParachuteStatus, SafetyState
from chute_msgs.srv import Deploy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from chute_ros.nodes import qos

_INTERVAL = 0.05  # s, of the heartbeats


class Person:
    """In a thread of its own; namespace: of the vehicle."""

    BLOCKED, READY, DEPLOYED = SafetyState.BLOCKED, SafetyState.READY, SafetyState.DEPLOYED

    def __init__(self, namespace: str) -> None:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node("person", namespace=namespace)
        #: SafetyState.stage as it was told last; 0: never.
        self.stage = 0
        self._node.create_subscription(SafetyState, "safety/state", self._state, qos.LATCHED)
        #: The parachute says that it is out.
        self.out = False
        self._node.create_subscription(
            ParachuteStatus, "parachute/status", self._parachute, qos.newest(qos.STATUS)
        )
        self._beats = self._node.create_publisher(LinkHeartbeat, "safety/heartbeat", qos.STATUS)
        self._deploys = self._node.create_client(Deploy, "safety/deploy")
        self._resets = self._node.create_client(Trigger, "safety/reset")
        self._node.create_timer(_INTERVAL, self._beat)
        self._speaks, self._seq, self._last = True, 0, 0
        self._lock = threading.Lock()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, daemon=True)

    def start(self) -> None:
        """From now on."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        rclpy.try_shutdown()
        self._thread.join()
        self._executor.shutdown()
        self._node.destroy_node()

    def fall_silent(self) -> int:
        """No more heartbeats; perf_counter_ns of the last one."""
        with self._lock:
            self._speaks = False
            return self._last

    def speak(self) -> None:
        """Heartbeats again."""
        self._speaks = True

    def deploy(self) -> int:
        """Call safety/deploy by force; perf_counter_ns just before."""
        at = time.perf_counter_ns()
        self._deploys.call_async(Deploy.Request(reason="bench", force=True))
        return at

    def reset(self) -> None:
        """Call safety/reset."""
        self._resets.call_async(Trigger.Request())

    def _beat(self) -> None:
        with self._lock:
            if not self._speaks:
                return
            self._seq += 1
            healthy = LinkHeartbeat.LINK_OK
            message = LinkHeartbeat(
                link="person", link_state=healthy, seq=self._seq, device_healthy=True
            )
            message.header.stamp = self._node.get_clock().now().to_msg()
            self._last = time.perf_counter_ns()
            self._beats.publish(message)

    def _state(self, message: SafetyState) -> None:
        self.stage = message.state

    def _parachute(self, message: ParachuteStatus) -> None:
        self.out = message.deployed

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            pass
