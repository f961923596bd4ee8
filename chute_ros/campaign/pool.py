"""A campaign's flights in processes of this machine."""

from __future__ import annotations

import gc
import signal
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import TypeVar

from chute_ros.campaign.campaign import shipped
from chute_ros.errors import CampaignError

LineT = TypeVar("LineT")

#: Flights that one process flies before it tells of them.
_BUNDLE = 10
#: Bundles for each process that are given out before the oldest is told of.
_AHEAD = 4


def flown_here(
    bundle: Callable[[Path, Sequence[int]], list[LineT]],
    folder: Path,
    seeds: Sequence[int],
    jobs: int,
) -> Generator[LineT, None, None]:
    """What bundle returns of the flights with these seeds, in their order, from so many processes.
    folder: of the profiles. CampaignError: one of the processes ended by itself."""
    if jobs == 1:
        for seed in seeds:
            yield from bundle(folder, [seed])
        return
    # Read before the processes part, so that they share it.
    shipped(folder).read_all()
    # No collection of garbage looks through it again (4 % of a flight); PyPy's works otherwise.
    if hasattr(gc, "freeze"):
        gc.freeze()
    # Ctrl-C reaches every process of a terminal: ours ends them.
    ignores = (signal.SIGINT, signal.SIG_IGN)
    pool = ProcessPoolExecutor(jobs, get_context("fork"), signal.signal, ignores)
    ordered: deque[Future[list[LineT]]] = deque()
    try:
        for first in range(0, len(seeds), _BUNDLE):
            ordered.append(pool.submit(bundle, folder, seeds[first : first + _BUNDLE]))
            if len(ordered) > _AHEAD * jobs:
                yield from ordered.popleft().result()
        for future in ordered:
            yield from future.result()
    except BrokenProcessPool:
        raise CampaignError(
            "one of its processes ended by itself (killed, as for want of memory, or by a fault "
            "of its interpreter)"
        ) from None
    finally:
        # Nobody waits for what they fly now.
        for process in active_children():
            process.kill()
        # Not left to the end of Python, which then may wake a thread that has just ended (EBADF).
        pool.shutdown(cancel_futures=True)
