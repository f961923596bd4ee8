"""What a process costs, as the kernel tells it."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from pathlib import Path

from chute_ros.tools.processes import Processes

#: For how long processes are watched while nothing happens, s.
WATCHED_FOR = 20.0


def idle_costs(children: Processes, groups: Mapping[str, Iterable[str]]) -> dict[str, float]:
    """What the children of each group take together while nothing happens, in % of a core."""
    those = {group: list(names) for group, names in groups.items()}

    def taken() -> dict[str, float]:
        return {group: cpu_time_of(children, names) for group, names in those.items()}

    before, began = taken(), time.monotonic()
    time.sleep(WATCHED_FOR)
    passed, after = time.monotonic() - began, taken()
    return {group: 100.0 * (after[group] - before[group]) / passed for group in those}


def cpu_time_of(children: Processes, names: Iterable[str]) -> float:
    """What these children have taken so far, s."""
    return sum(cpu_time(children.pid(one)) for one in names)


def cpu_time(pid: int | str) -> float:
    """What a process has taken so far, s."""
    # The second field is a name in brackets, with anything in it.
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident_memory(pid: int | str) -> float:
    """What a process has in memory, MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
