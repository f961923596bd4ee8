"""The memories of a simulated flight computer: the flash with its records, the FRAM's snapshots.

A dump and a wipe take the umbilical for themselves; no telemetry comes meanwhile.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable

from chute_ros.links.umbilical.simulator.output import CHUNK, OutboundQueue
from chute_ros.links.umbilical.simulator.settings import FlightComputerSettings

FLASH_SIZE = 14_336  # kB of 1024 bytes
#: A line of progress each so many sectors.
_PROGRESS = 256


class _Dump:
    """What is dumped goes out as fast as it may, and waits for room in the queue."""

    def __init__(self, content: bytes, end: bytes, rate: float, now: float) -> None:
        self._content = content
        self.end = end
        self._interval = 1.0 / rate
        self._next_at = now
        self._sent = 0
        #: It sends no more than the first half.
        self.stalls = False

    def step(self, now: float, queue: OutboundQueue) -> bool:
        """Send what is due; whether all is sent."""
        data = self._content + self.end
        while self._sent < len(data) and not self._is_stuck() and self._next_at <= now:
            if not queue.room:
                self._next_at = now
                break
            chunk = data[self._sent : self._sent + CHUNK]
            queue.put_chunk(chunk, now)
            self._sent += len(chunk)
            self._next_at += self._interval
        return self._sent >= len(data)

    def next_deadline(self, queue: OutboundQueue) -> float:
        """When it goes on."""
        if self._is_stuck():
            return math.inf
        return self._next_at if queue.room else max(self._next_at, queue.next_deadline())

    def _is_stuck(self) -> bool:
        return self.stalls and 2 * self._sent >= len(self._content)


class _Wipe:
    """Lines that come at set times. outcome: "", "fails" or "hangs"."""

    def __init__(self, sectors: int, duration: float, outcome: str, now: float) -> None:
        self.succeeds = not outcome
        last = sectors // 2 if outcome else sectors
        self._lines = [(now, "Wiping QSPI Flash... Please wait.")]
        for n in [*range(_PROGRESS, last, _PROGRESS), last]:
            line = f"Wipe progress: {n}/{sectors} sectors"
            self._lines.append((now + duration * n / sectors, line))
        if outcome == "hangs":
            self._lines.append((now + 2.0 * duration, "ERASE TIMEOUT!"))
        else:
            line = "ERASE FAILED!" if outcome else "Flash wiped successfully."
            self._lines.append((self._lines[-1][0], line))

    def step(self, now: float, queue: OutboundQueue) -> bool:
        """Send what is due; whether it has ended."""
        while self._lines and self._lines[0][0] <= now:
            queue.put_line(self._lines.pop(0)[1], now)
        return not self._lines

    def next_deadline(self, queue: OutboundQueue) -> float:
        """When the next line comes."""
        return self._lines[0][0]


class Memory:
    """Flash and FRAM. Outcomes of the next dump or wipe are set by the actions of the device."""

    def __init__(
        self, settings: FlightComputerSettings, header: str, queue: OutboundQueue
    ) -> None:
        #: Of the next dump: "", "loses-end" or "stalls".
        self.dump_outcome = ""
        #: Of the next wipe: "", "fails" or "hangs".
        self.wipe_outcome = ""
        #: Called once the flash is wiped.
        self.on_wiped: Callable[[], None] = lambda: None
        self._settings, self._header, self._queue = settings, header, queue
        self._used = settings.flash_used * 1024
        self._stored = settings.dump_size
        self._rows: list[str] = []
        self._job: _Dump | _Wipe | None = None
        self._snapshot = ""
        self._snapshots = 0

    # -- flash ----------------------------------------------------------------------------------

    @property
    def is_busy(self) -> bool:
        """A dump or a wipe has the umbilical."""
        return self._job is not None

    @property
    def is_dumping(self) -> bool:
        """No other line may come in between."""
        return isinstance(self._job, _Dump)

    def record(self, row: str) -> None:
        """Store a row of the flight, while there is room."""
        size = len(row) + 1
        if self._used + size <= FLASH_SIZE * 1024:
            self._used += size
            self._rows.append(row)

    def info(self) -> str:
        """How much of the flash is used."""
        used = math.ceil(self._used / 1024)
        return f"Flash: {used}/{FLASH_SIZE} KB used ({100.0 * used / FLASH_SIZE:.1f}%)"

    def begin_dump(self, now: float) -> None:
        """Send all that is stored."""
        if self.is_busy:
            return
        kind = "BINARY" if self._settings.binary_dump else "CSV"
        begin, end = (f"--- {word} FLASH {kind} DUMP ---" for word in ("BEGIN", "END"))
        content = f"{begin}\n".encode() + self.content()
        self._job = _Dump(content, f"{end}\n".encode(), self._settings.dump_rate, now)
        self.disturb_dump("")

    def content(self) -> bytes:
        """What a dump of the flash holds: what is of an earlier time up to the size that was set,
        and the flight's."""
        rows = "".join(f"{row}\n" for row in self._rows).encode()
        if self._settings.binary_dump:
            return random.Random(self._settings.seed).randbytes(self._stored) + rows
        earlier = ",".join("0" for _ in self._header.split(",")) + "\n"
        return f"{self._header}\n{earlier * (self._stored // len(earlier))}".encode() + rows

    def disturb_dump(self, outcome: str) -> None:
        """Have the dump that runs, or else the next, end so; empty: as was said before."""
        self.dump_outcome = outcome or self.dump_outcome
        if isinstance(self._job, _Dump):
            self._job.stalls = self.dump_outcome == "stalls"
            if self.dump_outcome == "loses-end":
                self._job.end = b""  # its marker does not come
            self.dump_outcome = ""

    def begin_wipe(self, now: float) -> None:
        """Erase the flash."""
        if self.is_busy:
            return
        sectors, duration = self._settings.wipe_sectors, self._settings.wipe_time
        self._job = _Wipe(sectors, duration, self.wipe_outcome, now)
        self.wipe_outcome = ""

    def update(self, now: float) -> None:
        """Go on with what runs."""
        job = self._job
        if job is None or not job.step(now, self._queue):
            return
        self._job = None
        if isinstance(job, _Wipe) and job.succeeds:
            self._rows.clear()
            self._used = self._stored = 0
            self.on_wiped()

    def next_deadline(self) -> float:
        """When update has something to do."""
        return math.inf if self._job is None else self._job.next_deadline(self._queue)

    def stop(self) -> None:
        """A reboot ends what runs."""
        self._job = None

    # -- FRAM -----------------------------------------------------------------------------------

    def snapshot(self, text: str) -> None:
        """Keep the newest state; it outlives a reboot."""
        self._snapshots += 1
        self._snapshot = f"SNAP seq={self._snapshots} {text}"

    def reset_snapshots(self) -> None:
        """Forget them all."""
        self._snapshots, self._snapshot = 0, ""

    def show_snapshot(self) -> str:
        """The newest one."""
        return self._snapshot or "Snapshot: ring empty"
