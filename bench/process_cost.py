"""What a process costs, as the kernel tells it."""

from __future__ import annotations

import os
from pathlib import Path


def cpu_time(pid: int | str) -> float:
    """What a process has taken so far, s."""
    # The second field is a name in brackets, with anything in it.
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def resident_memory(pid: int | str) -> float:
    """What a process has in memory, MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
