"""Sends one order to its service, and waits for the answer."""

from __future__ import annotations

from typing import Any

from chute_msgs.srv import Arm, Deploy, Kill, SetMode
from std_srvs.srv import Trigger

from chute_ros.ros.plain_border import with_plain_texts
from chute_ros.tools.chute.errors import CommandError
from chute_ros.tools.chute.order import Order, ServiceAnswer, not_answered
from chute_ros.tools.chute.session import ChuteSession
from chute_ros.tools.person_record import PersonRecord

#: Type of a service, by Order.kind.
KINDS: dict[str, Any] = {
    "Arm": Arm, "Deploy": Deploy, "Kill": Kill, "SetMode": SetMode, "Trigger": Trigger,
}  # fmt: skip


def answer_of(future: Any) -> ServiceAnswer:
    """Of a call of one of KINDS that is done."""
    message = with_plain_texts(future.result())
    return ServiceAnswer(message.success, message.message, getattr(message, "accepted", None))


class OrderCall:
    """One order. Made first, so that its service, and who keeps the record, are found while the
    vehicle is listened to. who: gives it."""

    def __init__(self, session: ChuteSession, order: Order, who: str) -> None:
        self._session, self._order, self._who = session, order, who
        self._record = PersonRecord(session.node, "chute", "safety/person")
        self._kind = KINDS[order.kind]
        self._client = session.node.create_client(self._kind, order.service)

    def found(self) -> bool:
        """Its service is there."""
        return bool(self._client.service_is_ready())

    def send(self, seconds: float) -> ServiceAnswer:
        """The answer; CommandError if the service is gone, or does not answer within seconds."""
        if not self.found():
            text = f"{self._order.name}: {self._order.service} is gone: nothing was sent"
            raise CommandError(text, {"sent": False})
        request = self._kind.Request(**self._order.fields)
        recorded = self._record.ordered(self._order.service, request, self._who)
        future = self._client.call_async(request)
        if not self._session.until(future.done, seconds):
            text = not_answered(self._order, f"within {seconds:g} s")
            raise CommandError(text, {"sent": True, "answered": False})
        answer = answer_of(future)
        recorded.answered(answer)
        self._record.leave()
        return answer
