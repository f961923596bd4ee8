"""Who ordered what of a vehicle, on its safety/person: the panel's orders, and those of chute."""

from __future__ import annotations

import math
import time
from typing import Any

from chute_msgs.msg import PersonRequest
from rclpy.duration import Duration
from rclpy.node import Node

from chute_ros.ros import messages, person_requests, qos
from chute_ros.tools.chute.order import ServiceAnswer

#: A process that ends after its order waits no longer for the record to take the answer, s.
_LEFT_WITHIN = 0.5


class PersonRecord:
    """Of one vehicle. link: who calls its services; topic: its safety/person."""

    def __init__(self, node: Node, link: str, topic: str) -> None:
        self._node, self._link = node, link
        self._publisher = node.create_publisher(PersonRequest, topic, qos.STATUS)

    def ordered(self, service: str, request: Any, who: str) -> RecordedOrder:
        """An order is about to be sent: it is published, with who gives it."""
        words, by = messages.request_words(request), f"by={who!r}"
        told = PersonRequest(
            link=self._link,
            service=service,
            request=f"{words}, {by}" if words else by,
            after=math.nan,
        )
        told.header.stamp = self._node.get_clock().now().to_msg()
        self.publish(told)
        return RecordedOrder(self, told)

    def publish(self, told: PersonRequest) -> None:
        """As far as that can be."""
        person_requests.publish(self._node, self._publisher, told)

    def leave(self) -> None:
        """What was published is received, or nobody does: the process may end."""
        self._publisher.wait_for_all_acked(Duration(seconds=_LEFT_WITHIN))


class RecordedOrder:
    """One that was sent."""

    def __init__(self, record: PersonRecord, told: PersonRequest) -> None:
        self._record, self.told = record, told
        self._called = time.monotonic()

    def answered(self, answer: ServiceAnswer) -> None:
        """Its answer, published as well."""
        self.told.answered, self.told.success = True, answer.success
        self.told.accepted, self.told.message = bool(answer.accepted), answer.message
        self.told.after = time.monotonic() - self._called
        self._record.publish(self.told)
