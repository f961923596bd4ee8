"""Which other programs have a serial port open, by /proc: those of other users only root sees."""

from __future__ import annotations

import math
import os
import select
import stat
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

_PROC = Path("/proc")
#: Between two looks (s): a program that only tried to open the port is gone by the second one.
LOOK_EACH = 1.0
#: A port that was ready without a byte so often had another reader, though it cannot be seen.
_CERTAIN = 3
#: Another reader is told of for so long after its last sign, s.
_SIGN_LASTS = 10.0


def users_of(number: int, apart: int = -1) -> list[str]:
    """Programs that have the terminal with this device number open for reading, as
    "name (pid 1234)". apart: our own descriptor of it, -1: we have none.

    The process at the other end of a pseudo terminal is the device, and no user of it.
    """
    found = []
    for folder in _PROC.iterdir():
        if not folder.name.isdigit():
            continue
        try:
            if _reads(folder, number, apart):
                name = (folder / "comm").read_text(errors="replace").strip()
                found.append(f"{name} (pid {folder.name})")
        except OSError:
            continue  # it ended meanwhile, or is another user's
    return sorted(found)


def hung_up(file: int) -> bool:
    """The device of this terminal is gone."""
    poll = select.poll()
    poll.register(file, 0)
    return bool(poll.poll(0))


def _reads(process: Path, number: int, apart: int) -> bool:
    own = int(process.name) == os.getpid()
    found = False
    for file in _terminals(process):
        if os.path.basename(os.readlink(file)) == "ptmx":
            return False
        if os.stat(file).st_rdev != number or (own and int(file.name) == apart):
            continue
        found = found or _for_reading(process / "fdinfo" / file.name)
    return found


def _terminals(process: Path) -> Iterator[Path]:
    for file in (process / "fd").iterdir():
        # The name first: to ask what a descriptor is may wait for a network.
        try:
            if os.readlink(file).startswith("/dev/") and stat.S_ISCHR(os.stat(file).st_mode):
                yield file
        except OSError:
            continue  # closed meanwhile


def _for_reading(information: Path) -> bool:
    for line in information.read_text().splitlines():
        if line.startswith("flags:"):
            return int(line.split()[1], 8) & os.O_ACCMODE != os.O_WRONLY
    return False


class PortUsers:
    """Looks for other readers of one open port, in a thread of its own: to look through all
    processes takes longer than a link may wait."""

    def __init__(
        self, path: str, file: int, look: Callable[[int, int], list[str]] = users_of
    ) -> None:
        self._path, self._file, self._look = path, file, look
        self._number = os.fstat(file).st_rdev
        self._signs: list[float] = []
        #: The first of the signs that follow each other, and the newest look.
        self._first_sign = self._looked = -math.inf
        self._seen: tuple[list[str], float] = ([], 0.0)
        self._before: list[str] = []
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"users of {path}", daemon=True)
        self._thread.start()

    def ready_without_data(self, now: float) -> None:
        """The port was ready to be read, and somebody else had read it."""
        if not self._signs or now - self._signs[-1] >= _SIGN_LASTS:
            self._first_sign = now
        self._signs = [*self._signs[1 - _CERTAIN :], now]

    def trouble(self, now: float) -> str:
        """Who else reads the port, in words; empty: nobody is known to. now: monotonic s."""
        names, when = self._seen
        if names and now - when < _SIGN_LASTS:
            who = ", ".join(names)
        elif self._certain(now) and self._looked > self._first_sign:
            who = f"a program that cannot be seen from this user (sudo fuser -v {self._path})"
        else:
            return ""
        return (
            f"{self._path} has a second reader, which takes a part of what comes: {who}; end it. "
            "The port stays open here"
        )

    def stop(self) -> None:
        """End the thread."""
        self._stopping.set()
        self._thread.join()

    def _certain(self, now: float) -> bool:
        return len(self._signs) == _CERTAIN and now - self._signs[0] < _SIGN_LASTS

    def _run(self) -> None:
        while not self._stopping.is_set():
            found = self._look(self._number, self._file)
            now = self._looked = time.monotonic()
            signs = bool(self._signs) and now - self._signs[-1] < _SIGN_LASTS
            # Seen twice, or with a sign beside it.
            names = found if signs else [one for one in found if one in self._before]
            self._before = found
            if names or not found:
                self._seen = (names, now)
            self._stopping.wait(LOOK_EACH)
