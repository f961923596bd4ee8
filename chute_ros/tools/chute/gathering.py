"""Gathers the diagnostics of a vehicle, which each of its nodes sends once a second."""

from __future__ import annotations

import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from chute_ros.ros import qos
from chute_ros.ros.plain_border import with_plain_texts
from chute_ros.tools.chute.diagnostic_tasks import DiagnosticTasks, Task
from chute_ros.tools.chute.session import Session

#: After the first word the others come within this, s.
_ALL_WITHIN = 2.2


def gather(session: Session, seconds: float) -> list[Task]:
    """The tasks of this vehicle, worst first; empty: none came within seconds."""
    tasks = DiagnosticTasks(session.namespace)

    def heard(message: Any) -> None:
        tasks.hear(with_plain_texts(message), time.monotonic())

    # Of this vehicle alone: /diagnostics has those of all, over the radio as well.
    profile = qos.newest(qos.STATUS)
    subscription = session.node.create_subscription(DiagnosticArray, "diagnostics", heard, profile)
    try:
        if session.until(lambda: tasks.tasks(time.monotonic()), seconds):
            session.until(lambda: False, _ALL_WITHIN)
    finally:
        session.node.destroy_subscription(subscription)
    return tasks.tasks(time.monotonic())
