"""A person at a vehicle: sees safety/state, calls the services, and plays a link of its own."""

from __future__ import annotations

import threading
import time

from chute_msgs.msg import LinkHeartbeat, ParachuteStatus, SafetyState
from chute_msgs.srv import Deploy
from std_srvs.srv import Trigger

from bench.ros_thread import RosThread
from chute_ros.ros import qos

_INTERVAL = 0.05  # s, of the heartbeats


class Person(RosThread):
    """In a thread of its own; namespace: of the vehicle."""

    BLOCKED, READY, DEPLOYED = SafetyState.BLOCKED, SafetyState.READY, SafetyState.DEPLOYED

    def __init__(self, namespace: str) -> None:
        super().__init__("person", namespace)
        #: SafetyState.stage as it was told last; 0: never.
        self.stage = 0
        self.node.create_subscription(SafetyState, "safety/state", self._state, qos.LATCHED)
        #: The parachute says that it is out.
        self.out = False
        self.node.create_subscription(
            ParachuteStatus, "parachute/status", self._parachute, qos.newest(qos.STATUS)
        )
        self._beats = self.node.create_publisher(LinkHeartbeat, "safety/heartbeat", qos.STATUS)
        self._deploys = self.node.create_client(Deploy, "safety/deploy")
        self._resets = self.node.create_client(Trigger, "safety/reset")
        self.node.create_timer(_INTERVAL, self._beat)
        self._speaks, self._seq, self._last = True, 0, 0
        self._lock = threading.Lock()

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
            message.header.stamp = self.node.get_clock().now().to_msg()
            self._last = time.perf_counter_ns()
            self._beats.publish(message)

    def _state(self, message: SafetyState) -> None:
        self.stage = message.state

    def _parachute(self, message: ParachuteStatus) -> None:
        self.out = message.deployed
