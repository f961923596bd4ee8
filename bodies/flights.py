"""All flights of a run, in processes of this machine."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import active_children, get_context

from bodies.recorder import UnflyableError
from chute_ros.sim.tape import Tape

#: Kind and seed.
Flight = tuple[str, int]


def flown(flights: Sequence[Flight], jobs: int) -> Iterator[Tape | str]:
    """Each flight's tape, or why there is none, in their order. BrokenProcessPool: a process
    ended by itself."""
    if jobs == 1:
        yield from map(_fly, flights)
        return
    # Ctrl-C reaches every process of a terminal: ours ends them.
    ignores = (signal.SIGINT, signal.SIG_IGN)
    pool = ProcessPoolExecutor(jobs, get_context("spawn"), signal.signal, ignores)
    try:
        yield from pool.map(_fly, flights, chunksize=4)
    finally:
        # Nobody waits for what they fly now.
        for process in active_children():
            process.kill()
        pool.shutdown(cancel_futures=True)


def _fly(flight: Flight) -> Tape | str:
    kind, seed = flight
    try:
        return _flyer(kind)(seed)
    except UnflyableError as error:
        return str(error)


def _flyer(kind: str) -> Callable[[int], Tape]:
    # Each only where it is flown: one process may fly multirotors alone.
    if kind == "multirotor":
        from bodies.multirotor_flight import fly

        return fly
    from bodies.aeroplane_flight import fly as fly_aeroplane

    return fly_aeroplane
