"""The subscriptions that fill the picture of a vehicle."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    ParachuteStatus,
    SafetyDecision,
    SafetyState,
    VehicleState,
)

from chute_ros.ros import qos
from chute_ros.ros.plain_border import with_plain_texts
from chute_ros.tools.chute.hearing import ReceivedMessages
from chute_ros.tools.chute.session import ChuteSession
from chute_ros.tools.chute.view import VehiclePicture, view
from chute_ros.tools.chute.words import is_old

#: A supervisor publishes its state at least each second, a parachute its status about as often:
#: so long after the first word everything that lives was received once, s.
SETTLE = 1.5
#: After the first heartbeat of a node each parachute of it that lives was received within this, s.
ROUND = 1.1


def subscribe(
    node: Any,
    namespace: str,
    picture: ReceivedMessages,
    held: AbstractContextManager[Any] | None = None,
) -> list[Any]:
    """The subscriptions of node that fill picture with the vehicle in namespace. held: while it
    is filled."""
    base = namespace.rstrip("/")
    return [
        node.create_subscription(kind, f"{base}/{topic}", _plainly(hear, held), profile)
        for kind, topic, profile, hear in (
            (SafetyState, "safety/state", qos.LATCHED, picture.hear_state),
            (LinkHeartbeat, "safety/heartbeat", qos.newest(qos.STATUS), picture.hear_heartbeat),
            (ParachuteStatus, "parachute/status", qos.newest(qos.STATUS), picture.hear_parachute),
            (VehicleState, "vehicle/state", qos.newest(qos.STATUS), picture.hear_vehicle),
            (SafetyDecision, "safety/decision", qos.newest(qos.DECISION), picture.hear_decision),
            (SafetyDecision, "safety/history", qos.HISTORY, picture.hear_history),
            (ActionReport, "safety/action", qos.newest(qos.DECISION), picture.hear_report),
        )
    ]


class Listening:
    """Listens from now on, with the least load for the vehicle: nothing is sent again for it but
    the latched state, and kills and deploys."""

    def __init__(self, session: ChuteSession) -> None:
        self._session = session
        self.picture = ReceivedMessages()
        subscribe(session.node, session.namespace, self.picture)

    def view(self) -> VehiclePicture | None:
        """What is shown now."""
        return view(self.picture, self._session.namespace, time.monotonic())

    def settle(self, seconds: float) -> VehiclePicture | None:
        """After the first word: wait for the rest. A link that lives is found within seconds, and
        from then on within SETTLE what its node has to say."""
        self._session.until(self._found, seconds)
        self._session.until(self._complete, SETTLE)
        return self.view()

    def whole(self, seconds: float) -> VehiclePicture | None:
        """As settle, and each parachute: a link may have several, and nothing but the status of
        each tells that it is there."""
        self.settle(seconds)
        self._session.until(self._each_told, ROUND)
        return self.view()

    def _each_told(self) -> bool:
        now = time.monotonic()
        return all(now - one.first >= ROUND for one in self.picture.heartbeats.values())

    def _found(self) -> bool:
        """Each link that the supervisor receives is received here as well."""
        picture = self.view()
        if picture is None:
            return False
        living = {one.name for one in picture.links if not is_old(one.age)}
        return living <= self.picture.heartbeats.keys()

    def _complete(self) -> bool:
        """The state is no old one, and the vehicle, the newest kill or deploy and a parachute of
        each link were received; of a link without a parachute that is waited for in vain."""
        picture = self.view()
        if picture is None or is_old(picture.age) or picture.vehicle is None:
            return False
        if picture.not_received:  # the oldest comes first
            return False
        return {one.name for one in picture.links} <= {one.link for one in picture.parachutes}


def _plainly(
    hear: Callable[[Any, float, float], None], held: AbstractContextManager[Any] | None
) -> Callable[[Any], None]:
    def heard(message: Any) -> None:
        with held or nullcontext():
            hear(with_plain_texts(message), time.monotonic(), time.time())

    return heard
