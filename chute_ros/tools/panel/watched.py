"""One vehicle that somebody looks at: what is received of it, and its page's parts made of that.

ROS's thread fills it, the web server's reads it.
"""

from __future__ import annotations

import datetime
import math
import re
import time
from collections.abc import Callable, Mapping
from functools import partial
from threading import Lock
from typing import Any

from chute_msgs.msg import Telem
from chute_msgs.srv import GetInfo, GetNodeInfo
from diagnostic_msgs.msg import DiagnosticArray

from chute_ros.ros import qos
from chute_ros.ros.plain_border import with_plain_texts
from chute_ros.tools.chute.diagnostic_tasks import DiagnosticTasks
from chute_ros.tools.chute.hearing import ReceivedMessages
from chute_ros.tools.chute.listening import subscribe
from chute_ros.tools.chute.reach import out_of_reach
from chute_ros.tools.chute.view import VehiclePicture, view
from chute_ros.tools.chute.words import is_old
from chute_ros.tools.panel import sections
from chute_ros.tools.panel.rocket import rocket
from chute_ros.tools.panel.trace import DecisionMark, MotionPoint, Trace

#: The parts are made at most so often, however many look, s.
_SOONEST = 0.2
#: The curves are drawn on so often, s.
_FOLLOWS = 0.25
_NODE_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}")
#: Of DroneCAN.
_HIGHEST_NODE_ID = 127
#: Services that are asked at most; a stranger may invent many links.
_MOST_ASKED = 32
#: A device that did not answer who it is is asked again after so long, s.
_ASK_AGAIN = 30.0


class Watched:
    """namespace: of the vehicle; around: in what it is looked for, in words. begin and end are
    called in ROS's thread, parts and drawn in any."""

    def __init__(self, node: Any, namespace: str, around: str) -> None:
        self.namespace = namespace
        self._node, self._around = node, around
        self._lock = Lock()
        self._picture = ReceivedMessages()
        self._tasks = DiagnosticTasks(namespace)
        self._telem: tuple[Any, float] | None = None
        self._trace = Trace()
        #: Epoch and id of the newest decision on the curves.
        self._marked = (0, 0)
        self._identities: dict[str, str] = {}
        self._asked: dict[str, float] = {}
        self._clients: dict[tuple[str, Any], Any] = {}
        self._ends: list[Callable[[], Any]] = []
        self._began = time.monotonic()
        self._made = (-math.inf, dict[str, str]())

    def begin(self) -> None:
        """Listen."""
        node, base = self._node, self.namespace.rstrip("/")
        held = subscribe(node, self.namespace, self._picture, self._lock)
        for kind, topic, hear in (
            (DiagnosticArray, "diagnostics", self._hear_diagnostics),
            (Telem, "umbilical/telem", self._hear_telem),
        ):
            profile = qos.newest(qos.STATUS)
            held.append(node.create_subscription(kind, f"{base}/{topic}", hear, profile))
        timer = node.create_timer(_FOLLOWS, partial(node.guarded, self._follow))
        self._ends = [partial(node.destroy_subscription, one) for one in held]
        self._ends.append(partial(node.destroy_timer, timer))

    def end(self) -> None:
        """Listen no more."""
        for destroy in self._ends:
            destroy()
        self._ends.clear()

    def parts(self) -> Mapping[str, str]:
        """Name -> HTML; and unreached, in words: why no parachute can be reached, if so."""
        with self._lock:
            made_at, parts = self._made
            now = time.monotonic()
            if now - made_at >= _SOONEST:
                parts = self._make(now)
                self._made = (now, parts)
            return parts

    def drawn(self) -> tuple[list[MotionPoint], list[DecisionMark]]:
        """The curves."""
        with self._lock:
            return self._trace.drawn(), list(self._trace.marks)

    def _make(self, now: float) -> dict[str, str]:
        picture = view(self._picture, self.namespace, now)
        if picture is None:
            return {"banner": sections.nothing(self.namespace, self._around, now - self._began)}
        tasks = self._tasks.tasks(now)
        parts = {
            "banner": sections.banner(picture),
            "blocks": sections.blocks(picture),
            "parachutes": sections.parachutes(picture, self._identities, datetime.date.today()),
            "vehicle": sections.vehicle(picture),
            "links": sections.links(picture.links, is_old(picture.age)),
            "rules": sections.rules(picture.rules, is_old(picture.age)),
            "decisions": sections.decisions(picture.decisions),
            "diagnostics": sections.diagnostics(tasks),
        }
        if why := out_of_reach(picture):
            parts["unreached"] = why
        if self._telem is not None:
            telem, received = self._telem
            parts["rocket"] = rocket(telem, now - received, tasks)
        return parts

    # -- in ROS's thread ------------------------------------------------------------------------

    def _hear_diagnostics(self, message: Any) -> None:
        with self._lock:
            self._tasks.hear(with_plain_texts(message), time.monotonic())

    def _hear_telem(self, message: Any) -> None:
        with self._lock:
            self._telem = (with_plain_texts(message), time.monotonic())

    def _follow(self) -> None:
        """Draw on, and ask new devices who they are."""
        now, wall = time.monotonic(), time.time()
        with self._lock:
            picture = view(self._picture, self.namespace, now)
            if picture is None:
                return
            self._draw(picture, wall)
            unknown = [
                (one.link, one.device)
                for one in picture.parachutes
                # A stranger's names may be none of a node.
                if _NODE_NAME.fullmatch(one.link)
                and f"{one.link} {one.device}" not in self._identities
                and now >= self._asked.get(f"{one.link} {one.device}", -math.inf) + _ASK_AGAIN
            ]
            self._asked |= {f"{link} {device}": now for link, device in unknown}
        for link, device in unknown:
            self._ask_identity(link, device)

    def _draw(self, picture: VehiclePicture, wall: float) -> None:
        height = speed = math.nan
        if (vehicle := picture.vehicle) is not None:
            height = math.nan if is_old(vehicle.height_age) else vehicle.height
            speed = math.nan if is_old(vehicle.vertical_speed_age) else vehicle.vertical_speed
        self._trace.add(MotionPoint(wall, height, speed))
        for one in picture.decisions:
            if (one.epoch, one.id) > self._marked:
                self._marked = (one.epoch, one.id)
                self._trace.mark(wall - one.age, one.action)

    def _ask_identity(self, link: str, device: str) -> None:
        base = f"{self.namespace.rstrip('/')}/{link}"
        is_id = device.isascii() and device.isdigit() and int(device[:4]) <= _HIGHEST_NODE_ID
        asks: tuple[tuple[Any, str, dict[str, Any]], ...] = (
            (GetInfo, "get_info", {"device": device}),
            (GetNodeInfo, "get_node_info", {"node_id": int(device) if is_id else 0}),
        )
        for kind, name, fields in asks:
            if (link, kind) not in self._clients:
                if len(self._clients) >= _MOST_ASKED:
                    return
                client = self._node.create_client(kind, f"{base}/{name}")
                self._clients[link, kind] = client
                self._ends.append(partial(self._node.destroy_client, client))
            client = self._clients[link, kind]
            if client.service_is_ready():
                future = client.call_async(kind.Request(**fields))
                future.add_done_callback(partial(self._take_identity, f"{link} {device}"))

    def _take_identity(self, key: str, future: Any) -> None:
        answer = with_plain_texts(future.result())
        if answer is None or not answer.success:
            return
        named = (
            ("", getattr(answer, "vendor_name", "")),
            ("", getattr(answer, "model_name", "") or getattr(answer, "name", "")),
            ("serial number ", getattr(answer, "serial_number", "")),
            ("unique id ", getattr(answer, "unique_id", "")),
            ("firmware ", answer.software_version),
            ("hardware ", answer.hardware_version),
        )
        told = ", ".join(f"{name}{value}" for name, value in named if value)
        with self._lock:
            self._identities[key] = told or "its device names nothing"
