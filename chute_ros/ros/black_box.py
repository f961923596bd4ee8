"""The flight recorder: all inputs and all decisions of the supervisor, in files that last.

The decision loop only appends to a queue, which takes a microsecond or two; everything else is the
work of one thread. Where the disk does not keep up the queue fills, and what finds no place in it
is left out and counted: a decision never waits for a disk.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from threading import Event, Thread
from typing import Any

from chute_ros.ros.box_folder import BoxFolder
from chute_ros.ros.box_writer import NOT_WRITABLE, BoxWriter, Kept, KeptTurn
from chute_ros.ros.mcap_file import Topic
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.state import State

#: Entries that wait for the disk at most. Messages leave the last quarter to the core's turns.
MOST_WAITING = 6000
MOST_MESSAGES = MOST_WAITING * 3 // 4
#: How often the thread looks for new entries, s.
_LOOK = 0.05
#: After so many entries the thread rests for so long (s): another that waits for Python's lock,
#: the decision loop above all, gets it at once, not only after Python's 5 ms.
_BATCH, _REST = 4, 0.0003
#: What is written is flushed to the disk this often, s; in between at most so long is written.
FLUSH_INTERVAL, _WRITE_FOR = 0.5, 0.25
#: What is not on the disk after this (s) is reported.
SLOW_AFTER = 3.0
#: After a failure a new file is tried this often, s.
RETRY_INTERVAL = 5.0
#: How long the end of the node waits for what is still to be written, s.
_CLOSE_WITHIN = 3.0


class BlackBox:
    """folder: where its files go; topics: what is recorded, by the names that message() is given;
    limit: bytes after which a new file begins; wall: the clock of the recording, Unix ns."""

    def __init__(
        self,
        folder: BoxFolder,
        topics: Mapping[str, Topic],
        limit: int,
        wall: Callable[[], int] = time.time_ns,
    ) -> None:
        self._wall = wall
        self._waiting: deque[Kept | KeptTurn] = deque()
        self._turns = self._left_out = self._lost = self._unwritable = self._written = 0
        self._after: State | None = None
        self._error = self._last_error = ""
        #: Until when everything that came was written, and is on the disk; monotonic s.
        self._taken_until = self._kept_until = time.monotonic()
        self._retry_at = self._taken_until
        #: Since when a step writes, which takes less than a second on a disk that takes something,
        #: however busy the processor is; monotonic s, infinity: none does.
        self._step_since = math.inf
        self._writer = BoxWriter(folder, topics, limit)
        self._ending = Event()
        self._thread = Thread(target=self._run, name="black_box", daemon=True)
        self._thread.start()

    # -- in the decision loop ---------------------------------------------------------------------

    def message(self, topic: str, message: Any) -> None:
        """Keep a message (or its CDR bytes) of one of the topics. It must not change any more."""
        if len(self._waiting) >= MOST_MESSAGES:
            self._left_out += 1
        else:
            self._waiting.append(Kept(self._wall(), topic, message))

    def turn(
        self,
        now: float,
        inputs: tuple[i.Input, ...],
        outputs: tuple[i.Output, ...],
        before: State,
        after: State,
        config: SupervisorConfig,
    ) -> None:
        """Keep a turn of the core: when (monotonic s), what came, what came of it, what was
        remembered before and after it and the settings."""
        # What changed between two turns is no turn: the missing number tells of it.
        self._turns += 1 if before is self._after else 2
        self._after = after
        if len(self._waiting) >= MOST_WAITING:
            self._left_out += 1
        else:
            self._waiting.append(
                KeptTurn(self._wall(), self._turns, now, inputs, outputs, before, config)
            )

    def counts(self) -> dict[str, object]:
        """For /diagnostics."""
        return {
            "file": self._writer.path,
            "bytes in the file": self._writer.size,
            "entries written": self._written,
            "entries waiting": len(self._waiting),
            "entries left out, written too slowly": self._left_out,
            "entries lost with a file that failed": self._lost,
            "entries that are no messages": self._unwritable,
            "all on the disk (s ago)": time.monotonic() - self._kept_until,
            "newest failure": self._last_error,
        }

    @property
    def dropped(self) -> int:
        """Entries that no file has."""
        return self._left_out + self._lost + self._unwritable

    @property
    def trouble(self) -> str:
        """Trouble now, in words. Empty: everything reaches the disk in time."""
        behind = time.monotonic() - self._kept_until
        if not self._thread.is_alive():
            return "the black box has ended"
        if self._error:
            return f"the black box cannot write: {self._error}"
        if behind <= SLOW_AFTER:
            return ""
        if (blocked := time.monotonic() - self._step_since) > SLOW_AFTER:
            return f"the black box: the disk takes nothing for {blocked:.0f} s"
        waiting = f"{len(self._waiting)} entries wait, not all on the disk for {behind:.0f} s"
        return f"the black box is written slowly: {waiting}"

    def close(self) -> None:
        """Write what waits and end the file; gives up where the disk takes too long."""
        self._ending.set()
        self._thread.join(_CLOSE_WITHIN)

    # -- in the thread ----------------------------------------------------------------------------

    def _run(self) -> None:
        flush_at = time.monotonic()
        while not self._ending.wait(_LOOK):
            if self._error and time.monotonic() < self._retry_at:
                continue
            if self._guarded(self._take) and time.monotonic() >= flush_at:
                flush_at = time.monotonic() + FLUSH_INTERVAL
                self._guarded(self._flush)
        while self._waiting and self._guarded(self._take):
            pass  # each time as much as is written between two flushes
        self._guarded(self._writer.finish)

    def _take(self) -> None:
        """Write what waits now; what comes meanwhile is for the next look."""
        began = time.monotonic()
        for number in range(1, len(self._waiting) + 1):
            self._write(self._waiting[0])
            # Only now: a disk that fails does not take this one along.
            self._waiting.popleft()
            if number % _BATCH == 0:
                time.sleep(_REST)
                if time.monotonic() > began + _WRITE_FOR:
                    return
        self._taken_until = began

    def _write(self, entry: Kept | KeptTurn) -> None:
        try:
            self._writer.write(entry)
        except NOT_WRITABLE as error:
            self._unwritable += 1
            self._last_error = f"an entry was left out: {error!r}"
        else:
            self._written += 1

    def _flush(self) -> None:
        self._writer.flush()
        self._kept_until = self._taken_until
        if self._writer.size:
            self._error = ""  # not only because there was nothing to write

    def _guarded(self, step: Callable[[], None]) -> bool:
        """Do it; whether it went well. A disk's failure ends the file, not the recording."""
        self._step_since = time.monotonic()
        try:
            step()
        except OSError as error:
            self._error = self._last_error = f"{self._writer.path}: {error.strerror or error}"
            self._lost += self._writer.abandon()
            self._retry_at = time.monotonic() + RETRY_INTERVAL
            return False
        finally:
            self._step_since = math.inf
        return True
