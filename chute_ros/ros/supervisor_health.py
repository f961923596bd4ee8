"""The supervisor watches itself: late updates, lost messages, internal errors, and its lease."""

from __future__ import annotations

import math

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.event_handler import SubscriptionEventCallbacks

from chute_ros.ros import diagnostics
from chute_ros.runtime.supervisor import SupervisorRuntime
from chute_ros.supervisor import inputs

#: A mistake inside, or messages that were lost, are shown as an error for so many looks (s).
_SHOWN_FOR = 60


class Health:
    """Counts, and tells it in diagnostics."""

    def __init__(self) -> None:
        #: The newest internal error in words; empty: none.
        self.newest = ""
        self._failures = 0
        self._lost: dict[str, int] = {}
        self._seen = (0, 0, 0)
        self._shown = 0
        self._own_fault = False

    def watch(self, topic: str) -> SubscriptionEventCallbacks:
        """For the subscription of an input: counts the messages that its queue lost."""

        def lost(event: object) -> None:
            count = getattr(event, "total_count_change", 1)
            self._lost[topic] = self._lost.get(topic, 0) + count

        return SubscriptionEventCallbacks(message_lost=lost)

    def refused(self, error: Exception, new: tuple[inputs.Input, ...]) -> None:
        """The core could not take this."""
        what = ", ".join(type(one).__name__ for one in new) or "a look at the clock"
        self.failed(error, f"left out {what}")

    def failed(self, error: Exception, what: str) -> None:
        """Something of a turn could not be done."""
        self._failures += 1
        self.newest = f"{what}: {type(error).__name__}: {error}"

    def task(self, name: str, runtime: SupervisorRuntime, now: float) -> DiagnosticStatus:
        """For diagnostics."""
        state, lease = runtime.state, runtime.lease
        lost = sum(self._lost.values())
        seen = (self._failures, lost, state.own.late_count)
        self._shown = _SHOWN_FOR if seen != self._seen else max(0, self._shown - 1)
        own_fault = (seen[0], seen[2]) != (self._seen[0], self._seen[2])
        self._own_fault = bool(self._shown) and (self._own_fault or own_fault)
        self._seen = seen
        level, text = diagnostics.OK, "leader" if lease.leading else "standby"
        if trouble := lease.trouble(now):
            level, text = diagnostics.ERROR, trouble
        elif self._shown:
            # What a network loses is said again soon; what the loop did not do is not.
            level = diagnostics.ERROR if self._own_fault else diagnostics.WARN
            named = zip(("internal errors", "messages lost", "updates late"), seen, strict=True)
            text = ", ".join(f"{name} {count}" for name, count in named if count)
        elif not lease.leading and math.isnan(lease.lease.leader_heard):
            level, text = diagnostics.WARN, "standby, and receives no leader"
        elif lease.leading and lease.config.standby and not lease.followers(now):
            level, text = diagnostics.WARN, "leader, and no standby is ready to take over"
        values: dict[str, object] = {
            "ready to take over": ", ".join(lease.followers(now)),
            "is leader": lease.leading,
            "leader": lease.config.name if lease.leading else lease.lease.leader,
            "rank": lease.config.rank,
            "hot standby": lease.config.standby,
            "newest heartbeat late by (s)": runtime.beat_late,
            "updates late": state.own.late_count,
            "internal errors": self._failures,
            "newest internal error": self.newest,
            "leader received (s ago)": now - lease.lease.leader_heard,
        }
        values |= {f"messages lost on {topic}": n for topic, n in sorted(self._lost.items())}
        return diagnostics.status(name, "itself", level, text, values, "")
