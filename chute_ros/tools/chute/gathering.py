"""Gathers the diagnostics of a vehicle, which each of its nodes sends once a second."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from chute_ros.ros import qos
from chute_ros.ros.plain_border import with_plain_texts
from chute_ros.tools.chute.diagnostic_tasks import DiagnosticTasks, Task, silent_task
from chute_ros.tools.chute.hearing import ReceivedMessages
from chute_ros.tools.chute.listening import Listening
from chute_ros.tools.chute.session import ChuteSession

#: After the first word others come that nobody names: of a node without a heartbeat, s.
_ALL_WITHIN = 2.2


def gather(
    session: ChuteSession, seconds: float, listening: Listening | None = None
) -> list[Task]:
    """The tasks of this vehicle, worst first; empty: none came within seconds. A node that should
    send some, and sent none within seconds, has one that says so. listening: to the vehicle."""
    tasks = DiagnosticTasks(session.namespace)
    picture = (listening or Listening(session)).picture
    end = time.monotonic() + seconds

    def heard(message: Any) -> None:
        tasks.hear(with_plain_texts(message), time.monotonic())

    def silent() -> set[str]:
        sent = {one.node for one in tasks.tasks(time.monotonic())}
        return expected(picture) - sent

    def complete() -> bool:
        return bool(picture.states) and not silent()

    # Of this vehicle alone: /diagnostics has those of all, over the radio as well.
    profile = qos.newest(qos.STATUS)
    subscription = session.node.create_subscription(DiagnosticArray, "diagnostics", heard, profile)
    try:
        if session.until(lambda: tasks.tasks(time.monotonic()), seconds):
            session.until(lambda: False, _ALL_WITHIN)
            session.until(complete, max(0.0, end - time.monotonic()))
    finally:
        session.node.destroy_subscription(subscription)
    found = tasks.tasks(time.monotonic())
    return [*_silent_tasks(session, silent(), seconds), *found] if found else []


def expected(picture: ReceivedMessages) -> set[str]:
    """The nodes that the vehicle should have: its supervisor and the links that this one names,
    and all that send heartbeats."""
    heard = picture.state(time.monotonic())
    named = {heard.message.supervisor, *heard.message.links} if heard else set()
    return named | picture.heartbeats.keys()


def _silent_tasks(session: ChuteSession, nodes: Iterable[str], seconds: float) -> list[Task]:
    prefix = f"{session.namespace}/".lstrip("/")
    return [silent_task(f"{prefix}{node}", seconds) for node in sorted(nodes)]
