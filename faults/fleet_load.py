"""What the processes that this one has started cost: processor time and memory, by kind."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from bench.process_cost import cpu_time

#: What a command line contains -> what it is counted as.
_KINDS = {
    "chute_ros.ros.": "nodes",
    "chute_ros.links.": "nodes",
    "faults.fleet_simulators": "simulators",
    "faults.ground_station": "ground station",
    "faults.switch": "switch",
    "fast-discovery-server": "discovery server",
}


@dataclass(frozen=True)
class Usage:
    """Of the processes of one kind together."""

    processes: int = 0
    processor: float = 0.0  # s, since they were started
    memory: float = 0.0  # MB; what several share is counted once

    def plus(self, processor: float, memory: float) -> Usage:
        """One more process."""
        return Usage(self.processes + 1, self.processor + processor, self.memory + memory)


def usage() -> dict[str, Usage]:
    """Of all children, by kind."""
    every = dict.fromkeys(_KINDS.values(), Usage())
    for pid in _children():
        process = Path("/proc") / pid
        command = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        for part, kind in _KINDS.items():
            if part in command:
                every[kind] = every[kind].plus(cpu_time(pid), _memory(process))
    return every


@contextlib.contextmanager
def busy(count: int) -> Iterator[None]:
    """So many processes that only compute."""
    every = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for one in every:
            one.kill()
            one.wait()


def _children() -> list[str]:
    tasks = Path("/proc/self/task").iterdir()
    return [pid for task in tasks for pid in (task / "children").read_text().split()]


def _memory(process: Path) -> float:
    for line in (process / "smaps_rollup").read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1]) / 1024
    return 0.0
