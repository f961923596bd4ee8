"""The diagnostics of one vehicle: the newest of each task, worst first."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from chute_ros.tools.chute.words import age_text

#: diagnostic_msgs/DiagnosticStatus.level, worst first. STALE: nothing is known of it.
_LEVELS = {2: "ERROR", 3: "STALE", 1: "WARN", 0: "OK"}
_WORST_FIRST = tuple(_LEVELS.values())
#: Levels with which the vehicle is not well.
NOT_WELL_LEVELS = ("ERROR", "STALE")
MOST_TASKS = 500


@dataclass(frozen=True)
class Task:
    """One task of one node. age: since it was received, s; NaN: its node sent none."""

    name: str
    level: str
    message: str
    values: Mapping[str, str]
    age: float

    @property
    def node(self) -> str:
        """Its node, without a namespace."""
        return self.name.partition(": ")[0].rpartition("/")[2]

    @property
    def received(self) -> bool:
        """Its node sent it."""
        return not math.isnan(self.age)

    @property
    def task(self) -> str:
        """Its name in its node."""
        return self.name.partition(": ")[2]


def silent_task(node: str, seconds: float) -> Task:
    """That of a node that should send some and sent none within seconds: it hangs, has died or
    never was started."""
    message = f"nothing received within {seconds:g} s"
    return Task(f"{node}: diagnostics", "STALE", message, {}, math.nan)


@dataclass
class DiagnosticTasks:
    """What was received. namespace: of the vehicle; in / the tasks of vehicles in a namespace are
    left out."""

    namespace: str
    _newest: dict[str, tuple[Any, float]] = field(default_factory=dict)

    def hear(self, message: Any, now: float) -> None:
        """A DiagnosticArray. now: monotonic s."""
        for one in message.status:
            known = one.name in self._newest or len(self._newest) < MOST_TASKS
            if known and self._is_ours(one.name):
                self._newest[one.name] = (one, now)

    def tasks(self, now: float) -> list[Task]:
        """Worst first, then by name."""
        found = [
            Task(
                one.name,
                _LEVELS.get(int.from_bytes(one.level, "little"), "ERROR"),
                one.message,
                {pair.key: pair.value for pair in one.values},
                now - received,
            )
            for one, received in self._newest.values()
        ]
        return sorted(found, key=lambda one: (_WORST_FIRST.index(one.level), one.name))

    def _is_ours(self, name: str) -> bool:
        return self.namespace != "/" or "/" not in name.partition(": ")[0].lstrip("/")


def task_lines(tasks: Iterable[Task], every_value: bool) -> list[str]:
    """Each on a line, and its values below it if every_value."""
    lines = []
    for one in tasks:
        lines.append(f"{one.level:<6} {one.name}: {one.message} ({age_text(one.age)})")
        if every_value:
            lines += [f"           {key}: {value}" for key, value in one.values.items()]
    return lines
