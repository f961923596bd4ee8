"""This process's node in ROS, for the time of one command."""

from __future__ import annotations

import contextlib
import os
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from chute_ros.interrupts import in_one_piece
from chute_ros.plain_text import plain
from chute_ros.ros.middleware import set_up_middleware
from chute_ros.tools.chute.errors import CommandError
from chute_ros.tools.chute.surroundings import Surroundings, installed_middlewares, surroundings

#: The longest wait for a message before the time is looked at again, s.
_STEP = 0.05
_STATE = "/safety/state"
_HEARTBEAT = "/safety/heartbeat"
_MOST_TOLD = 20


class ChuteSession:
    """A node in the vehicle's namespace. around: the environment as the user set it."""

    def __init__(self, namespace: str, around: Surroundings) -> None:
        self.namespace, self.around = namespace, around
        self.node = Node(f"chute_{secrets.token_hex(4)}", namespace=namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def spin(self, seconds: float = _STEP) -> None:
        """Let one message come, or wait for so long."""
        with in_one_piece():
            self._executor.spin_once(timeout_sec=seconds)

    def until(self, condition: Callable[[], Any], seconds: float) -> bool:
        """Spin until condition holds; whether it did within seconds."""
        end = time.monotonic() + seconds
        while not condition():
            left = end - time.monotonic()
            if left <= 0.0:
                return False
            self.spin(min(_STEP, left))
        return True

    def not_heard(self, what: str, seconds: float, hint: str = "") -> CommandError:
        """The error for what was not received within seconds. hint: what else can be done."""
        vehicles = self.vehicles()
        parts = [self.looked_for(what, seconds)]
        if hint:
            parts.append(hint)
        elif vehicles and self.namespace not in vehicles:
            parts.append(f"name one: --namespace {vehicles[0]}")
        elif not vehicles:
            parts.append("`chute doctor` looks for the cause")
        details = {
            "namespace": self.namespace,
            "surroundings": self.around.text(),
            "nodes": self.links(),
            "vehicles": vehicles,
        }
        return CommandError("; ".join(parts), details)

    def looked_for(self, what: str, seconds: float) -> str:
        """Where what was not received was looked for, and what there is instead."""
        parts = [f"{what} in {self.namespace} within {seconds:g} s ({self.around.text()})"]
        if there := self.links():
            parts.append(f"nodes there: {', '.join(there)}")
        parts.append(f"vehicles found: {', '.join(self.vehicles()) or 'none'}")
        return "; ".join(parts)

    def links(self) -> list[str]:
        """The nodes of this vehicle that send heartbeats, supervisors as well."""
        topic = f"{self.namespace.rstrip('/')}{_HEARTBEAT}"
        found = self.node.get_publishers_info_by_topic(topic)
        return sorted({plain(one.node_name) for one in found})[:_MOST_TOLD]

    def services(self) -> set[str]:
        """The services of this vehicle, by their relative names."""
        own = f"{self.namespace.rstrip('/')}/"
        names = [name for name, _ in self.node.get_service_names_and_types()]
        return {name.removeprefix(own) for name in names if name.startswith(own)}

    def vehicles(self) -> list[str]:
        """The namespaces in which a supervisor publishes its state."""
        return namespaces(self.node)[:_MOST_TOLD]

    def close(self) -> None:
        """Leave ROS: a call that has not left yet is taken back."""
        self._executor.shutdown()
        self.node.destroy_node()


def namespaces(node: Any) -> list[str]:
    """Those in which a supervisor publishes its state, as far as node has found them."""
    topics = [name for name, _ in node.get_topic_names_and_types()]
    found = [
        plain(name.removesuffix(_STATE)) or "/"
        for name in topics
        if name.endswith(_STATE) and node.count_publishers(name)
    ]
    return sorted(found)


@contextmanager
def opened(namespace: str) -> Iterator[ChuteSession]:
    """A session in ROS. CommandError where ROS does not let it start."""
    around = surroundings(os.environ, installed_middlewares())
    set_up_middleware()
    session = None
    try:
        # Ctrl-C is Python's: it ends a wait at once, wherever it is.
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        with in_one_piece():
            session = ChuteSession(namespace, around)
    except RuntimeError as error:
        text = " ".join(str(error).partition(", at /")[0].split())
        if os.environ.get("ROS_SECURITY_ENABLE") == "true":
            text += "; ROS_SECURITY_ENABLE is true, which needs what docs/guide/security.md lists"
        raise CommandError(f"ROS does not start: {text} ({around.text()})") from None
    finally:
        if session is None:
            rclpy.try_shutdown()
    try:
        yield session
    finally:
        session.close()
        with contextlib.suppress(RuntimeError):
            rclpy.try_shutdown()
