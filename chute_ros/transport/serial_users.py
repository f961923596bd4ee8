"""Which other programs have a serial port open, by /proc: those of other users only root sees."""

from __future__ import annotations

import math
import os
import select
import threading
import time
from collections.abc import Callable
from pathlib import Path

_PROC = "/proc"
#: Between the looks at two processes, s.
_REST = 0.001
#: Between two looks (s), and while somebody else seems to read the port: a program that only tried
#: to open it is gone by the second look.
LOOK_EACH, LOOK_SOON = 5.0, 1.0
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
    for process in os.listdir(_PROC):
        if not process.isdigit():
            continue
        # The link's thread has the interpreter whenever it needs it.
        time.sleep(_REST)
        try:
            if _reads(process, number, apart):
                name = Path(_PROC, process, "comm").read_text(errors="replace").strip()
                found.append(f"{name} (pid {process})")
        except OSError:
            continue  # it ended meanwhile, or is another user's
    return sorted(found)


def hung_up(file: int) -> bool:
    """The device of this terminal is gone."""
    poll = select.poll()
    poll.register(file, 0)
    return bool(poll.poll(0))


def _reads(process: str, number: int, apart: int) -> bool:
    own = int(process) == os.getpid()
    folder = f"{_PROC}/{process}/fd"
    found = False
    for file in os.listdir(folder):
        try:
            # The name first: to ask what a descriptor is may wait for a network.
            target = os.readlink(f"{folder}/{file}")
            if not target.startswith("/dev/"):
                continue
            if target.endswith("/ptmx"):
                return False
            is_it = os.stat(f"{folder}/{file}").st_rdev == number
        except OSError:
            continue  # closed meanwhile
        if is_it and not (own and int(file) == apart):
            found = found or _for_reading(f"{_PROC}/{process}/fdinfo/{file}")
    return found


def _for_reading(information: str) -> bool:
    for line in Path(information).read_text().splitlines():
        if line.startswith("flags:"):
            return int(line.split()[1], 8) & os.O_ACCMODE != os.O_WRONLY
    return False


class PortUsers:
    """Looks for other readers of one open port, in a thread of its own: to look through all
    processes takes longer than a link may wait."""

    def __init__(
        self,
        path: str,
        file: int,
        look: Callable[[int, int], list[str]] = users_of,
        look_each: float = LOOK_EACH,
    ) -> None:
        self._path, self._file, self._look, self._look_each = path, file, look, look_each
        self._number = os.fstat(file).st_rdev
        self._signs: list[float] = []
        #: The first of the signs that follow each other, and the newest look.
        self._first_sign = self._looked = -math.inf
        self._seen: tuple[list[str], float] = ([], 0.0)
        self._before: list[str] = []
        self._stopping = threading.Event()
        threading.Thread(target=self._run, name=f"users of {path}", daemon=True).start()

    def ready_without_data(self, now: float) -> None:
        """The port was ready to be read, and somebody else had read it."""
        if not self._signs or now - self._signs[-1] >= _SIGN_LASTS:
            self._first_sign = now
        self._signs = [*self._signs[1 - _CERTAIN :], now]

    def trouble(self, now: float) -> str:
        """Other readers of the port, in words; empty: none known. now: monotonic s."""
        names, when = self._seen
        certain = len(self._signs) == _CERTAIN and now - self._signs[0] < _SIGN_LASTS
        if names and now - when < _SIGN_LASTS:
            who = ", ".join(names)
        elif certain and self._looked > self._first_sign:
            who = f"a program that cannot be seen from this user (sudo fuser -v {self._path})"
        else:
            return ""
        return (
            f"{self._path} has a second reader, which takes part of the data: {who}; end it. "
            "The port stays open here"
        )

    def stop(self) -> None:
        """Look no more; one that is under way ends by itself, and touches no descriptor."""
        self._stopping.set()

    def _run(self) -> None:
        wait = min(LOOK_SOON, self._look_each)
        while not self._stopping.wait(wait):
            found = self._look(self._number, self._file)
            now = self._looked = time.monotonic()
            signs = bool(self._signs) and now - self._signs[-1] < _SIGN_LASTS
            # Seen twice, or with a sign beside it.
            names = found if signs else [one for one in found if one in self._before]
            self._before = found
            if not found and self._seen[0]:
                self._signs = []  # its doing, and it is gone
            if names or not found:
                self._seen = (names, now)
            wait = LOOK_SOON if signs or found else self._look_each
