"""A campaign's flights on the workers of a Dask cluster.

Nothing is sent but names of functions and seeds: workers fly the code that they have, which must
be the campaign's own.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import functools
import itertools
import logging
import platform
from collections import Counter
from collections.abc import Generator, Sequence
from importlib.metadata import version

import distributed
from distributed import Client, as_completed, get_worker
from distributed.worker import Worker

from chute_ros.campaign.campaign import FlightSummary, fly_bundle
from chute_ros.campaign.checkpoint import parts_that_fly
from chute_ros.errors import CampaignError
from chute_ros.ros.config_folder import config_folder
from chute_ros.tools.machine import machine

#: Flights that a worker flies before it tells of them: some seconds, so that a scheduler has time
#: for many workers, and one that dies costs little.
_BUNDLE = 10
#: Bundles for each worker that are given out before the oldest is told of. A machine that loses
#: its power is missed by the scheduler after 5 minutes (worker-ttl); the others fly on meanwhile.
_AHEAD = 64
#: A scheduler that answers, and a worker at it, are waited for so long, s.
_PATIENCE = 10.0
_GUIDE = "docs/guide/cluster.md"
_SAME = f"install the same on both ({_GUIDE})"
# What matters of its troubles we tell in one line.
logging.getLogger("distributed").setLevel(logging.CRITICAL)


@functools.cache
def build() -> dict[str, str]:
    """What must be the same wherever flights of one campaign are flown."""
    sums = parts_that_fly(config_folder() / "profiles")
    return {
        **{part: total[:12] for part, total in sums.items()},
        "Python": f"{platform.python_implementation()} {platform.python_version()}",
        "distributed": version("distributed"),
    }


def difference(wanted: dict[str, str], dask_worker: Worker) -> str:
    """What of this worker, which runs it, forbids flights of a build; empty: nothing."""
    threads = dask_worker.state.nthreads
    if threads != 1:
        return f"it runs {threads} threads: start it with --nthreads 1 --nworkers N"
    here = build()
    for part, ours in wanted.items():
        if here[part] != ours:
            return f"its {part} is {here[part]}, the campaign's is {ours}: {_SAME}"
    return ""


def fly_same(wanted: dict[str, str], seeds: Sequence[int]) -> list[FlightSummary]:
    """Flights of a worker. CampaignError: it came after the others were compared, and differs."""
    worker = get_worker()
    if differs := difference(wanted, worker):
        raise CampaignError(f"worker {worker.address}: {differs}")
    return fly_bundle(config_folder() / "profiles", seeds)


class Cluster:
    """The workers of the scheduler at an address, all compared with this process before anything
    is flown. CampaignError: none is there, or one differs."""

    def __init__(self, address: str) -> None:
        self._address = address
        try:
            # Alone a client waits for ever for what answers, but as no scheduler does.
            if (kind := asyncio.run(asyncio.wait_for(_kind(address), _PATIENCE))) != "Scheduler":
                raise OSError(f"a {kind} is there")
            self._client = Client(address, timeout=_PATIENCE, set_as_default=False)
        except (OSError, asyncio.TimeoutError) as error:
            raise CampaignError(
                f"no scheduler at {address} ({_told(error)}): start one with "
                f"`dask scheduler --host HOST --port PORT` and name it tcp://HOST:PORT ({_GUIDE})"
            ) from None
        try:
            self._client.wait_for_workers(1, _PATIENCE)
            self._compare()
            machines = Counter(self._client.run(machine).values())
        except asyncio.TimeoutError:
            self.close()
            raise CampaignError(
                f"the scheduler at {address} has no workers after {_PATIENCE:g} s: start some "
                f"with `dask worker {address} --nthreads 1 --nworkers N` ({_GUIDE})"
            ) from None
        except BaseException:
            self.close()
            raise
        #: At the begin; each flies one flight at a time.
        self.workers = machines.total()
        #: What flies, in words.
        self.machines = "; ".join(f"{n} on {one}" for one, n in sorted(machines.items()))

    def _compare(self) -> None:
        try:
            # It reads the names of functions as well, and so needs them.
            self._client.run_on_scheduler(build)
        except (ImportError, AttributeError) as error:
            raise CampaignError(f"scheduler {self._address}: {_told(error)}: {_SAME}") from None
        found = self._client.run(difference, build(), on_error="return")
        for worker, differs in sorted(found.items()):
            if isinstance(differs, Exception):
                differs = f"{_told(differs)}: {_SAME}"
            if differs:
                raise CampaignError(f"worker {worker}: {differs}")

    def flown(self, seeds: Sequence[int]) -> Generator[FlightSummary, None, None]:
        """Flights with these seeds, in their order. A worker that dies costs its bundle again.
        CampaignError: the scheduler is gone, a worker that came later differs, or one bundle ended
        each of its workers."""
        firsts = iter(range(0, len(seeds), _BUNDLE))
        first_of: dict[object, int] = {}
        arrived: dict[int, list[FlightSummary]] = {}
        flying = as_completed(with_results=True, raise_errors=False, loop=self._client.loop)

        def send(bundles: int) -> None:
            for first in itertools.islice(firsts, bundles):
                some = seeds[first : first + _BUNDLE]
                future = self._client.submit(fly_same, build(), some, pure=False)
                first_of[future.key] = first
                flying.add(future)

        send(_AHEAD * self.workers)
        due = 0
        for future, lines in flying:
            if future.status == "cancelled":
                raise CampaignError(f"the scheduler at {self._address} is gone")
            if future.status == "error":
                raise CampaignError(_told(lines[1]))
            # Fetched at once, and then released: a worker that dies takes no flown bundle along.
            arrived[first_of.pop(future.key)] = lines
            future.release()
            while due in arrived:
                yield from arrived.pop(due)
                due += _BUNDLE
                send(1)

    def close(self) -> None:
        """What is still flown is given up."""
        try:
            self._client.close(timeout=_PATIENCE)
        except (OSError, asyncio.CancelledError, concurrent.futures.CancelledError):
            pass  # of a scheduler that is gone


async def _kind(address: str) -> str:
    """What Dask calls what answers there."""
    async with distributed.rpc(address, timeout=_PATIENCE) as server:
        return str((await server.identity())["type"])


def _told(error: BaseException) -> str:
    """In one line."""
    text = str(error).partition("\n")[0]
    # A plain Exception is Dask's, around the name of what was raised elsewhere.
    if isinstance(error, CampaignError) or type(error) is Exception:
        return text
    return f"{type(error).__name__}: {text}"
