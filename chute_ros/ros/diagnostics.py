"""Diagnostics by the conventions of diagnostic_updater: "node: task", level, one line, values."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from chute_ros.protocol.liveness import Liveness
from chute_ros.ros import qos
from chute_ros.ros.middleware_diagnostics import middleware_task
from chute_ros.runtime.watch import WatchPicture

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)
#: Task, level, text, values and device: status() makes a message of it.
Task = tuple[str, bytes, str, Mapping[str, object], str]
#: For so long (s) drops are counted; so many are few; such a share of all is usual on a bad line.
_RECENTLY, _FEW_DROPS, _USUAL_SHARE = 10.0, 20, 0.2


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


class RecentDrops:
    """Says when much of what comes cannot be read, while something else can: as of a line with
    noise on it, a second sender or another key."""

    def __init__(self) -> None:
        #: (s, messages received, dropped by reason), the oldest first.
        self._looks: deque[tuple[float, int, Counter[str]]] = deque()

    def look(self, received: int, dropped: Mapping[str, int], now: float) -> str:
        """In words; empty: it is not much. received, dropped: since the start; now: s."""
        self._looks.append((now, received, Counter(dropped)))
        while len(self._looks) > 2 and self._looks[1][0] <= now - _RECENTLY:
            self._looks.popleft()
        since, received_before, dropped_before = self._looks[0]
        new = Counter(dropped) - dropped_before
        least = max(_FEW_DROPS, _USUAL_SHARE * (received - received_before + new.total()))
        if new.total() <= least:
            return ""
        reason, count = new.most_common(1)[0]
        return (
            f"in the last {now - since:.0f} s much could not be read, mostly: {reason} ({count})"
        )


@dataclass(frozen=True)
class WirePicture:
    """The wire of a link: is it open, what was last said of it, where it goes, what is wrong with
    it though it is open (empty: nothing), and now (s)."""

    is_open: bool
    text: str
    connection: str
    now: float
    drops: RecentDrops
    trouble: str = ""


def wire_task(
    node: str,
    wire: WirePicture,
    troubles: Sequence[str],
    received: int,
    values: Mapping[str, object],
    dropped: Mapping[str, int],
    for_others: Collection[str] = (),
) -> DiagnosticStatus:
    """The wire, what is doubtful on it while it is open, and what was dropped on it, by reason.
    for_others: reasons of what could be read."""
    level, text = (OK if wire.is_open else ERROR), wire.text
    unread = {reason: n for reason, n in dropped.items() if reason not in for_others}
    much = wire.drops.look(received, unread, wire.now)
    troubles = [*([wire.trouble] if wire.trouble else []), *troubles]
    if wire.is_open and troubles:
        level, text = ERROR, "; ".join(troubles)
    elif wire.is_open and not received and dropped:
        # As with another baud rate, or where one side has a key and the other has not.
        most = max(dropped, key=lambda reason: dropped[reason])
        level = ERROR
        text += f"; the received data cannot be read, mostly: {most} ({dropped[most]})"
    elif wire.is_open and not received:
        level, text = WARN, f"{text}, nothing received yet"
    elif wire.is_open and much:
        level, text = WARN, f"{text}; {much}"
    every = {**values, **{f"dropped: {reason}": n for reason, n in sorted(dropped.items())}}
    return status(node, "link", level, text, every, wire.connection)


def supervisor_task(
    node: str, one: WatchPicture, values: Mapping[str, object]
) -> DiagnosticStatus:
    """State of the supervisor's link, with values beside."""
    level, text = OK, "received"
    if math.isnan(one.silence):
        level, text = STALE, "never received"
    elif one.lost:
        level, text = ERROR, f"silent for {one.silence:.1f} s"
    elif one.delay:
        level, text = ERROR, f"clocks differ: its heartbeat seems {one.delay:.3f} s old"
    elif one.offset:
        text = f"received; a wall clock was set, or differs, by {one.offset:.3f} s"
        level = WARN
    every = {
        "heartbeat age (s)": one.silence,
        "times lost": one.times_lost,
        "clock set by (s)": one.offset,
        **values,
    }
    return status(node, "supervisor", level, text, every, "")


def liveness_values(live: Liveness, now: float) -> dict[str, object]:
    """Reception of a device; times in s, NaN: has not happened."""
    return {
        "link": live.state.name,
        "received (s ago)": live.age(now),
        "in this link state for (s)": now - live.since,
        "times lost": live.lost_count,
        "regained (s ago)": now - live.regained_at,
    }


class DiagnosticsPublisher:
    """Of all tasks of a node: on /diagnostics, which all share, and in a namespace on its own
    `diagnostics` as well. A black box listens to that: of twenty vehicles each would else be sent
    what all others say."""

    def __init__(self, node: Node) -> None:
        names = {node.resolve_topic_name(name): name for name in ("/diagnostics", "diagnostics")}
        self._middleware = middleware_task(node.get_fully_qualified_name().lstrip("/"))
        self._publishers = [
            node.create_publisher(DiagnosticArray, name, qos.STATUS) for name in names.values()
        ]

    def publish(self, stamp: Time, statuses: list[DiagnosticStatus]) -> None:
        """Say how they are, and how the middleware is."""
        message = DiagnosticArray(status=[*statuses, self._middleware])
        message.header.stamp = stamp
        for publisher in self._publishers:
            publisher.publish(message)


def _text(value: object) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)
