"""A Dask cluster of processes on the loopback, started by the commands of the guide."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import distributed

_DASK = [sys.executable, "-m", "dask"]
_PLACE = ("--host", "127.0.0.1", "--no-dashboard")
#: For the end of a worker to reach the scheduler, s.
_PATIENCE = 60.0


@dataclass
class DaskBench:
    """address: of the scheduler; workers: those that are as this process, by their addresses;
    others: those with arguments or an environment of their own."""

    address: str
    scheduler: subprocess.Popen[str]
    workers: dict[str, subprocess.Popen[str]] = field(default_factory=dict)
    others: dict[str, subprocess.Popen[str]] = field(default_factory=dict)

    def start_worker(self, *arguments: str, **environment: str) -> str:
        """Until it is registered; its address."""
        started = self.others if arguments or environment else self.workers
        arguments = (self.address, *_PLACE, "--no-nanny", *(arguments or ("--nthreads", "1")))
        process = _start("worker", *arguments, **environment)
        address = _told(process, r"Start worker at: +(\S+)")
        _told(process, "Registered to: ")
        _drain(process)
        started[address] = process
        return address

    def has_workers(self, number: int) -> None:
        """From now on so many as this process, and no others; the scheduler knows it."""
        alive = [one for one, process in self.workers.items() if process.poll() is None]
        stay = {one: self.workers[one] for one in alive[:number]}
        for address, process in {**self.workers, **self.others}.items():
            if address not in stay:
                _end(process)
        self.workers, self.others = stay, {}
        end = time.monotonic() + _PATIENCE
        while left := asyncio.run(_workers(self.address)) - stay.keys():
            assert time.monotonic() < end, f"the scheduler still has {left}"
            time.sleep(0.01)
        while len(self.workers) < number:
            self.start_worker()


@contextlib.contextmanager
def dask_bench(**environment: str) -> Iterator[DaskBench]:
    """A scheduler without workers; at the end all are ended."""
    scheduler = _start("scheduler", *_PLACE, "--port", "0", **environment)
    bench = DaskBench(_told(scheduler, r"Scheduler at: +(\S+)"), scheduler)
    _drain(scheduler)
    try:
        yield bench
    finally:
        for process in (*bench.workers.values(), *bench.others.values(), scheduler):
            _end(process)


async def _workers(address: str) -> set[str]:
    """Those that a scheduler has."""
    async with distributed.rpc(address) as scheduler:
        return {*(await scheduler.identity())["workers"]}


def _end(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.wait()


def _start(*arguments: str, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*_DASK, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **environment},
        # Python looks for packages where it is started, before anything else.
        cwd="/",
    )


def _told(process: subprocess.Popen[str], pattern: str) -> str:
    """The first group of the first line that matches."""
    assert process.stderr is not None
    lines = []
    for line in process.stderr:
        if found := re.search(pattern, line):
            return found[found.lastindex or 0]
        lines.append(line)
    raise AssertionError(f"it ended: {''.join(lines)}")


def _drain(process: subprocess.Popen[str]) -> None:
    """What it tells from now on is nobody's, but must not fill the pipe."""

    def read() -> None:
        with process.stderr as lines:  # type: ignore[union-attr]
            for _ in lines:
                pass

    threading.Thread(target=read, daemon=True).start()
