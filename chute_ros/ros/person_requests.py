"""Calls of a device node's services that order something, published on safety/person."""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from chute_msgs.msg import PersonRequest
from chute_msgs.srv import (
    GetInfo,
    GetNodeInfo,
    GetParam,
    ListParams,
    RequestMessage,
    TransportStats,
)
from rclpy.node import Node

from chute_ros.ros import messages, qos
from chute_ros.ros.plain_border import is_exempt

if TYPE_CHECKING:
    from chute_ros.ros.suite_node import SuiteNode

#: Services that only read. Every other one counts as an order, also that of a link in another
#: package: a line too many in the record harms nobody.
_READING = (GetInfo, GetNodeInfo, GetParam, ListParams, RequestMessage, TransportStats)


def orders(kind: Any) -> bool:
    """Whether a service of this type orders something of the device. ROS's own do not."""
    return kind not in _READING and not is_exempt(kind)


def publish(node: Node, publisher: Any, told: PersonRequest) -> None:
    """A failure is logged: keeping a record must not keep a parachute from being released."""
    try:
        publisher.publish(told)
    except Exception as error:  # noqa: BLE001
        node.get_logger().error(f"{told.service} is not in the record: {error}")


class PersonRequests:
    """Publishes them for node."""

    def __init__(self, node: SuiteNode) -> None:
        self._node = node
        self._publisher = node.create_publisher(PersonRequest, "safety/person", qos.STATUS)

    def followed(self, service: str, callback: Callable[[Any, Any], Any]) -> Any:
        """The callback of a service, whose calls and answers are published."""

        async def served(request: Any, response: Any) -> Any:
            called = time.monotonic()
            told = PersonRequest(
                link=self._node.get_name(),
                service=service,
                request=messages.request_words(request),
                after=math.nan,
            )
            told.header.stamp = self._node.stamp()
            publish(self._node, self._publisher, told)
            answer = callback(request, response)
            if inspect.isawaitable(answer):
                answer = await answer
            told.answered = True
            told.success = getattr(answer, "success", False)
            told.accepted = getattr(answer, "accepted", False)
            told.message = getattr(answer, "message", "")
            told.after = time.monotonic() - called
            publish(self._node, self._publisher, told)
            return answer

        return served
