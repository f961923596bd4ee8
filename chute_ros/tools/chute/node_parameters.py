"""Asks a node for its parameters, by ROS's own services."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python

from chute_ros.tools.chute.session import ChuteSession

#: After the first node the others are found within this, s.
_ALL_WITHIN = 1.0


def nodes(session: ChuteSession, node: str | None, seconds: float) -> list[str]:
    """The nodes of the vehicle, or this one alone if it is there; empty: none within seconds."""
    if node is not None:
        return [node] if session.until(lambda: node in session.links(), seconds) else []
    if session.until(session.links, seconds):
        session.until(lambda: False, _ALL_WITHIN)
    return session.links()


def parameters_of_node(
    session: ChuteSession, node: str, seconds: float
) -> Mapping[str, Any] | None:
    """Parameter -> value; None: no answer within seconds."""
    # Not rclpy's client of parameters: it can set them as well, which SROS 2 allows nobody.
    lister = session.node.create_client(ListParameters, f"{node}/list_parameters")
    getter = session.node.create_client(GetParameters, f"{node}/get_parameters")
    if not session.until(lambda: _ready(lister, getter), seconds):
        return None
    listed = lister.call_async(ListParameters.Request())
    if not session.until(listed.done, seconds) or listed.result() is None:
        return None
    names = sorted(listed.result().result.names)
    got = getter.call_async(GetParameters.Request(names=names))
    if not session.until(got.done, seconds) or got.result() is None:
        return None
    values = map(parameter_value_to_python, got.result().values)
    return dict(zip(names, values, strict=False))


def _ready(*clients: Any) -> bool:
    return all(one.service_is_ready() for one in clients)
