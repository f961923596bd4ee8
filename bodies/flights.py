"""All flights of a run, in processes of this machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from bodies.recorder import UnflyableError
from chute_ros.campaign.pool import processes
from chute_ros.sim.tape import Tape

#: Kind and seed.
Flight = tuple[str, int]


def flown(flights: Sequence[Flight], jobs: int) -> Iterator[Tape | str]:
    """Each flight's tape, or why there is none, in their order. BrokenProcessPool: a process
    ended by itself."""
    if jobs == 1:
        yield from map(_fly, flights)
        return
    with processes(jobs, "spawn") as pool:
        yield from pool.map(_fly, flights, chunksize=4)


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
