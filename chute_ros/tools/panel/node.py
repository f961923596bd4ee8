"""The panel's node: listens to what somebody looks at, and sends the orders of who may give them.

The web server has a thread of its own; whatever it wants of ROS is done in ROS's.
"""

from __future__ import annotations

import os
import secrets
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from threading import Lock
from typing import Any

from chute_msgs.msg import SafetySummary
from rclpy.node import Node

from chute_ros.plain_text import plain
from chute_ros.ros import qos
from chute_ros.ros.parameters import declare, settings_taken
from chute_ros.ros.plain_border import with_plain_texts
from chute_ros.settings import settings_from
from chute_ros.tools.chute.calling import KINDS, answer_of
from chute_ros.tools.chute.hearing import ReceivedMessage
from chute_ros.tools.chute.order import Order, ServiceAnswer
from chute_ros.tools.chute.session import namespaces
from chute_ros.tools.chute.surroundings import installed_middlewares, surroundings
from chute_ros.tools.panel.access import Access, Operator
from chute_ros.tools.panel.parameters import NODE, PARAMETERS, PanelSettings
from chute_ros.tools.panel.password import password_from
from chute_ros.tools.panel.server import PanelServer
from chute_ros.tools.panel.watched import Watched
from chute_ros.tools.person_record import PersonRecord

#: Before the start changes them.
_AROUND = surroundings(os.environ, installed_middlewares()).text()
#: Vehicles that are followed at most; a stranger on the network may invent many.
MOST_VEHICLES = 50
#: An order that waited longer in this process is not sent, s.
_SENT_WITHIN = 1.0


class PanelNode(Node):
    """started_with: the arguments of its process."""

    def __init__(self, started_with: Sequence[str] = ()) -> None:
        self.server: PanelServer | None = None
        super().__init__(NODE)
        names = [one.name for one in PARAMETERS]
        self.settings_taken = settings_taken(self, names, started_with)
        self.settings = settings_from(PanelSettings, declare(self, PARAMETERS))
        password = password_from(self.settings.password_file)
        self.access = Access(password, lambda: secrets.token_urlsafe(32))
        self._lock = Lock()
        #: What the web server's thread wants done.
        self._wanted: deque[Callable[[], None]] = deque()
        self._wake = self.create_guard_condition(self._do_wanted)
        #: Namespace -> it, and how many look at it.
        self._watched: dict[str, tuple[Watched, int]] = {}
        #: Of the fleet's page: how many look at it; subscriptions and newest word of each vehicle.
        self._fleet_viewers = 0
        self._summaries: dict[str, tuple[Any, ReceivedMessage | None]] = {}
        #: Full name of a service or topic -> what is used for it.
        self._callers: dict[str, Any] = {}
        #: By namespace.
        self._records: dict[str, PersonRecord] = {}
        self.server = PanelServer(self)
        self.server.start()

    def destroy_node(self) -> None:
        """The web server first: its pages ask this node."""
        if self.server is not None:
            self.server.stop()
            self.server = None
        super().destroy_node()

    # -- for the web server's thread ------------------------------------------------------------

    def vehicles(self) -> list[str]:
        """The namespaces in which a supervisor publishes its state."""
        return namespaces(self)[:MOST_VEHICLES]

    def is_there(self, namespace: str) -> bool:
        """A supervisor publishes its state in this namespace."""
        return bool(self.count_publishers(f"{namespace.rstrip('/')}/safety/state"))

    def look(self, namespace: str) -> Watched:
        """From now on somebody looks at this vehicle, until leave."""
        with self._lock:
            watched, viewers = self._watched.get(namespace, (None, 0))
            if watched is None:
                watched = Watched(self, namespace, _AROUND)
                self._want(watched.begin)
            self._watched[namespace] = (watched, viewers + 1)
            return watched

    def leave(self, namespace: str) -> None:
        """One looks no more; when nobody does it costs nothing any more."""
        with self._lock:
            watched, viewers = self._watched[namespace]
            self._watched[namespace] = (watched, viewers - 1)
            if viewers == 1:
                del self._watched[namespace]
                self._want(watched.end)

    def look_at_all(self) -> None:
        """From now on somebody looks at the fleet, until leave_all."""
        with self._lock:
            self._fleet_viewers += 1

    def leave_all(self) -> None:
        """One looks no more."""
        with self._lock:
            self._fleet_viewers -= 1
            if not self._fleet_viewers:
                held = [subscription for subscription, _ in self._summaries.values()]
                self._summaries.clear()
                for one in filter(None, held):
                    self._want(partial(self.destroy_subscription, one))

    def fleet(self) -> list[tuple[str, ReceivedMessage | None]]:
        """Each vehicle with its newest summary. Somebody looks at all."""
        there = self.vehicles()
        with self._lock:
            # One that was received stays on the page when it is gone: that is what must be seen.
            for namespace, (subscription, heard) in list(self._summaries.items()):
                if heard is None and namespace not in there:
                    del self._summaries[namespace]
                    if subscription is not None:
                        self._want(partial(self.destroy_subscription, subscription))
            for namespace in there:
                room = len(self._summaries) < MOST_VEHICLES
                if self._fleet_viewers and room and namespace not in self._summaries:
                    self._summaries[namespace] = (None, None)
                    self._want(partial(self._follow, namespace))
        with self._lock:
            return [(name, heard) for name, (_, heard) in self._summaries.items()]

    def offered(self, namespace: str, folder: str) -> list[str]:
        """The names of the services in a folder of this vehicle's."""
        own = f"{namespace.rstrip('/')}/{folder}"
        names = [name for name, _ in self.get_service_names_and_types()]
        return sorted(plain(name.removeprefix(own)) for name in names if name.startswith(own))

    def order(
        self, namespace: str, order: Order, person: Operator | None
    ) -> Future[ServiceAnswer]:
        """Send it, and record who ordered it and what was answered; person: None: it is done to a
        simulated vehicle, and nobody's."""
        future: Future[ServiceAnswer] = Future()
        wanted = time.monotonic()
        self._want(lambda: self._call(namespace, order, person, future, wanted))
        return future

    def _want(self, function: Callable[[], None]) -> None:
        self._wanted.append(function)
        self._wake.trigger()

    # -- in ROS's thread ------------------------------------------------------------------------

    def _do_wanted(self) -> None:
        while self._wanted:
            self.guarded(self._wanted.popleft())

    def guarded(self, function: Callable[[], None]) -> None:
        """Call it; whatever a stranger on the network has done, the panel goes on."""
        try:
            function()
        except Exception as error:  # noqa: BLE001
            kind = type(error).__name__
            self.get_logger().error(plain(f"{kind}: {error}"), throttle_duration_sec=10.0)

    def _follow(self, namespace: str) -> None:
        def hear(message: Any) -> None:
            with self._lock:
                if namespace in self._summaries:
                    subscription, before = self._summaries[namespace]
                    number = before.number + 1 if before else 1
                    now, wall = time.monotonic(), time.time()
                    heard = ReceivedMessage(with_plain_texts(message), now, wall, number)
                    self._summaries[namespace] = (subscription, heard)

        topic = f"{namespace.rstrip('/')}/safety/summary"
        with self._lock:
            if namespace in self._summaries:
                one = self.create_subscription(SafetySummary, topic, hear, qos.LATCHED)
                self._summaries[namespace] = (one, None)

    def _call(
        self,
        namespace: str,
        order: Order,
        person: Operator | None,
        answer: Future[ServiceAnswer],
        wanted: float,
    ) -> None:
        """wanted: when, monotonic s: what waited for too long nobody expects any more."""
        kind, service = KINDS[order.kind], order.service
        name = f"{namespace.rstrip('/')}/{service}"
        if name not in self._callers:
            self._callers[name] = self.create_client(kind, name)
        client, request = self._callers[name], kind.Request(**order.fields)
        if not answer.set_running_or_notify_cancel():
            return
        if time.monotonic() - wanted > _SENT_WITHIN:
            answer.set_result(
                ServiceAnswer(False, "nothing was sent: the panel was held up", None)
            )
            return
        if not client.service_is_ready():
            answer.set_result(
                ServiceAnswer(False, f"nothing was sent: {service} is not offered", None)
            )
            return
        record = self._record(namespace, service, request, person) if person else None

        def answered(future: Any) -> None:
            one = answer_of(future)
            if record is not None:
                record(one)
            answer.set_result(one)

        client.call_async(request).add_done_callback(answered)

    def _record(
        self, namespace: str, service: str, request: Any, person: Operator
    ) -> Callable[[ServiceAnswer], None]:
        """Put who orders what on safety/person and into the log; what is returned puts the
        answer there."""
        if namespace not in self._records:
            topic = f"{namespace.rstrip('/')}/safety/person"
            self._records[namespace] = PersonRecord(self, NODE, topic)
        one = self._records[namespace].ordered(service, request, person.text)
        self.get_logger().info(f"{namespace} {service}: {one.told.request}")

        def answered(answer: ServiceAnswer) -> None:
            one.answered(answer)
            self.get_logger().info(f"{namespace} {service}: {answer.message}")

        return answered
