"""One log line for what a link says to a person."""

from __future__ import annotations

from typing import Any

from chute_ros.model import LinkState
from chute_ros.protocol.events import DeviceLinkChanged, Notice, Severity


def log_event(log: Any, event: DeviceLinkChanged | Notice) -> None:
    """At the level that it deserves."""
    if isinstance(event, Notice):
        _log_notice(log, event)
        return
    change = event.change
    if change.before is LinkState.NEVER_SEEN:
        log.info(f"{event.name} heard for the first time")
    elif change.regained:
        log.warning(f"{event.name} regained after {change.silence:.1f} s of silence")
    elif change.after is LinkState.OK:
        log.info(f"{event.name} is OK again after {change.silence:.1f} s of silence")
    else:
        log.warning(f"{event.name} is {change.after.name}: silent for {change.silence:.1f} s")


def _log_notice(log: Any, notice: Notice) -> None:
    # A line each: rclpy refuses a place in the source that logs at two levels.
    if notice.severity is Severity.ERROR:
        log.error(notice.text)
    elif notice.severity is Severity.WARNING:
        log.warning(notice.text)
    else:
        log.info(notice.text)
