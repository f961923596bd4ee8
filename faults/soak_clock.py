"""A wall clock that can be set for some processes alone: no other may notice a step."""

from __future__ import annotations

import mmap
import struct
import subprocess
from pathlib import Path

_SOURCE = Path(__file__).with_name("soak_clock.cpp")
_OFFSET = struct.Struct("d")


class WallClock:
    """The clock of the processes that are started with environment. name: its own in folder."""

    def __init__(self, folder: Path, name: str) -> None:
        library, file = folder / "soak_clock.so", folder / f"{name}.clock"
        if not library.exists():
            command = ["g++", "-O2", "-shared", "-fPIC", "-o", str(library), str(_SOURCE), "-ldl"]
            subprocess.run(command, check=True)
        file.write_bytes(_OFFSET.pack(0.0))
        with file.open("r+b") as opened:
            self._page = mmap.mmap(opened.fileno(), _OFFSET.size)
        self.environment = {"LD_PRELOAD": str(library), "SOAK_CLOCK": str(file)}

    def set_by(self, seconds: float) -> None:
        """From now on it is so far from the true one."""
        self._page[:] = _OFFSET.pack(seconds)

    def close(self) -> None:
        """Nobody sets it any more."""
        self._page.close()
