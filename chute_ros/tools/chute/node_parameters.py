"""Asks a node for its parameters, by ROS's own services."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

from chute_ros.tools.chute.session import Session

#: After the first node the others are found within this, s.
_ALL_WITHIN = 1.0


def nodes(session: Session, node: str | None, seconds: float) -> list[str]:
    """The nodes of the vehicle, or this one alone if it is there; empty: none within seconds."""
    if node is not None:
        return [node] if session.until(lambda: node in session.links(), seconds) else []
    if session.until(session.links, seconds):
        session.until(lambda: False, _ALL_WITHIN)
    return session.links()


def parameters_of_node(session: Session, node: str, seconds: float) -> Mapping[str, Any] | None:
    """Parameter -> value; None: no answer within seconds."""
    client = AsyncParameterClient(session.node, f"{session.namespace.rstrip('/')}/{node}")
    if not session.until(client.services_are_ready, seconds):
        return None
    listed = client.list_parameters()
    if not session.until(listed.done, seconds) or listed.result() is None:
        return None
    names = sorted(listed.result().result.names)
    got = client.get_parameters(names)
    if not session.until(got.done, seconds) or got.result() is None:
        return None
    values = map(parameter_value_to_python, got.result().values)
    return dict(zip(names, values, strict=False))
