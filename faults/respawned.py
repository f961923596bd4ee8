"""Processes that are started again when they end, as a launch file does with respawn=True."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.process_cost import resident_memory
from chute_ros.ros.middleware import LEADS_ELSEWHERE
from chute_ros.tools.processes import Processes

#: As launch/vehicle.launch.py has it, s.
RESPAWN_DELAY = 0.5


@dataclass(frozen=True)
class Ended:
    """One ended by itself. code: as subprocess has it; at: monotonic s; peak: its memory, MB."""

    name: str
    code: int
    at: float
    peak: float


class RespawnedProcesses(Processes):
    """keeps_to_host: the names of those that only this host shall hear."""

    log_mode = "ab"

    def __init__(self, folder: Path, keeps_to_host: Sequence[str] = ()) -> None:
        super().__init__(folder)
        self._keeps_to_host = frozenset(keeps_to_host)
        self.ended: list[Ended] = []
        self._made: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {}
        self._peaks: dict[str, float] = {}
        self._due: dict[str, float] = {}

    def start(self, name: str, module: str, *arguments: str, on: Sequence[str] = ()) -> None:
        """As Processes; where it keeps to its host, with the settings for that."""
        self._made[name] = (module, arguments, tuple(on))
        if name in self._keeps_to_host:
            unset = [part for one in LEADS_ELSEWHERE for part in ("-u", one)]
            on = (*on, "env", *unset, "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST")
        super().start(name, module, *arguments, on=on)

    def memory(self, name: str) -> float:
        """What it has now, MB; NaN: it has ended."""
        try:
            return resident_memory(self.pid(name)) or float("nan")
        except OSError:
            return float("nan")

    def check(self) -> None:
        """Start those again that have ended; what they had is remembered."""
        now = time.monotonic()
        for name, process in list(self._running.items()):
            if process.poll() is None:
                memory = self.memory(name)
                self._peaks[name] = max(self._peaks.get(name, 0.0), memory)
            elif name not in self._due:
                self._due[name] = now + RESPAWN_DELAY
                self.ended.append(Ended(name, process.returncode, now, self._peaks.pop(name, 0)))
            elif now >= self._due[name]:
                del self._due[name]
                module, arguments, on = self._made[name]
                self.start(name, module, *arguments, on=on)

    def first_end(self, name: str) -> Ended | None:
        """How it ended first; None: it has not."""
        return next((one for one in self.ended if one.name == name), None)
