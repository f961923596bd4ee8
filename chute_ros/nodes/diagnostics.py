"""Diagnostics by the conventions of diagnostic_updater: "node: task", level, one line, values."""

from __future__ import annotations

from collections.abc import Mapping

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)


def status(
    node: str, task: str, level: bytes, message: str, values: Mapping[str, object], hardware: str
) -> DiagnosticStatus:
    """One task's status. Floats are written with three digits after the point."""
    return DiagnosticStatus(
        level=level,
        name=f"{node}: {task}",
        message=message,
        hardware_id=hardware,
        values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()],
    )


def array(stamp: Time, statuses: list[DiagnosticStatus]) -> DiagnosticArray:
    """All tasks of a node."""
    message = DiagnosticArray(status=statuses)
    message.header.stamp = stamp
    return message


def _text(value: object) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)
