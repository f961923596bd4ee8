"""Flights in processes of this machine."""

from __future__ import annotations

import gc
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context
from typing import TYPE_CHECKING, TypeVar

from chute_ros.errors import CampaignError

if TYPE_CHECKING:
    from chute_ros.campaign.shipped import Shipped

LineT = TypeVar("LineT")

#: Flights that one process flies before it tells of them.
_BUNDLE = 10
#: Bundles for each process that are given out before the oldest is told of.
_AHEAD = 4


@contextmanager
def processes(jobs: int, start: str) -> Iterator[ProcessPoolExecutor]:
    """So many, started so ("fork" or "spawn"). What they do at the end is given up."""
    # Ctrl-C reaches every process of a terminal: ours ends them.
    ignores = (signal.SIGINT, signal.SIG_IGN)
    pool = ProcessPoolExecutor(jobs, get_context(start), signal.signal, ignores)
    try:
        yield pool
    finally:
        # Nobody waits for what they fly now.
        for process in active_children():
            process.kill()
        # Not left to the end of Python, which then may wake a thread that has just ended (EBADF).
        pool.shutdown(cancel_futures=True)


def flown_here(
    bundle: Callable[[Sequence[int]], list[LineT]],
    shared: Shipped,
    seeds: Sequence[int],
    jobs: int,
) -> Generator[LineT, None, None]:
    """What bundle returns of the flights with these seeds, in their order, from so many processes.
    shared: what all of them fly with. CampaignError: one of the processes ended by itself."""
    if jobs == 1:
        for seed in seeds:
            yield from bundle([seed])
        return
    # Read before the processes part, so that they share it.
    shared.read_all()
    # No collection of garbage looks through it again (4 % of a flight); PyPy's works otherwise.
    if hasattr(gc, "freeze"):
        gc.freeze()
    ordered: deque[Future[list[LineT]]] = deque()
    try:
        with processes(jobs, "fork") as pool:
            for first in range(0, len(seeds), _BUNDLE):
                ordered.append(pool.submit(bundle, seeds[first : first + _BUNDLE]))
                if len(ordered) > _AHEAD * jobs:
                    yield from ordered.popleft().result()
            for future in ordered:
                yield from future.result()
    except BrokenProcessPool:
        raise CampaignError(
            "one of its processes ended by itself (killed, as for want of memory, or by a fault "
            "of its interpreter)"
        ) from None
