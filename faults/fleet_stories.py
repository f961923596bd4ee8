"""Fleets of several sizes: what they cost, and that what happens to one happens to it alone."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

from chute_ros.errors import ChuteError
from chute_ros.supervisor.machine import Stage
from chute_ros.tools import pages
from faults.discovery_server import DiscoveryServers
from faults.fleet import (
    GROUND,
    HEIGHT,
    Fleet,
    hosts_for,
    name_of,
    newest_states,
    until,
    until_told,
)
from faults.fleet_load import Usage, busy, usage
from faults.ground_station_link import GroundStationLink, Told
from faults.network import Network
from faults.stories import fly_stories, in_seconds

#: How long a fleet that flies is measured, and how long is waited for what must not happen, s.
MEASURED, WATCHED = 10.0, 5.0
#: How many processes make a computer busy, and how long it is before anything happens, s.
SPINNERS, BUSY = 16, 10.0
#: Silence of the ground station's picture of a vehicle that counts as a gap: it comes each second.
_GAP = 1.5


@dataclass(frozen=True)
class Size:
    """One run. server: all find each other through a discovery server, and no multicast passes;
    slowed: at a fifth of the rates."""

    count: int
    server: bool = True
    slowed: bool = False
    #: Other processes take the processor from it while it flies.
    busy: bool = False

    @property
    def name(self) -> str:
        """In words."""
        vehicles = f"{self.count} vehicle{'s' if self.count > 1 else ''}"
        how = (", slowed" if self.slowed else "") + (", busy" if self.busy else "")
        return f"{vehicles}{how}, {'discovery server' if self.server else 'multicast'}"

    @property
    def fails(self) -> int:
        """The vehicle whose motor fails."""
        return min(3, self.count)

    @property
    def deployed(self) -> int:
        """The vehicle that the operator deploys; 0: none is left."""
        return min(7, self.count) if self.count > 1 else 0


SIZES = (
    Size(1),
    Size(5),
    Size(5, busy=True),
    Size(5, server=False),
    Size(10),
    Size(20, slowed=True),
)


@dataclass
class Flown:
    """What came of it; times in s."""

    size: Size
    all_seen: float = math.nan
    costs: dict[str, Usage] = field(default_factory=dict)
    #: Bytes/s that leave and reach the ground station's host.
    traffic: tuple[float, float] = (math.nan, math.nan)
    #: How many updates of the supervisors came late, how many of them said so, and gaps in the
    #: ground station's picture.
    late: int = 0
    told_late: int = 0
    gaps: int = 0
    released: float = math.nan
    commanded: float = math.nan
    wrong: str = ""


def fly(size: Size, folder: Path) -> Flown:
    """Fly it; what went wrong is in the answer."""
    flown = Flown(size)
    with (
        Network(hosts_for(size.count)) as network,
        closing(DiscoveryServers(network, folder)) as servers,
    ):
        environments: tuple[dict[str, str], dict[str, str]] = ({}, {})
        if size.server:
            servers.start()
            environments = (servers.of_vehicles, servers.of_ground)
            for host in network.hosts:
                network.cable(host, "unicast")
        fleet = Fleet(network, folder, size.count, environments, size.slowed)
        try:
            _fly(fleet, flown)
        except ChuteError as error:
            flown.wrong = str(error).splitlines()[0]
            print(error)
        finally:
            fleet.close()
    return flown


def _fly(fleet: Fleet, flown: Flown) -> None:
    station = fleet.station()
    fleet.start(station)
    fleet.take_off(station)
    time.sleep(HEIGHT / 6.0)  # they climb 6 m/s
    flown.all_seen = fleet.join()
    _measure(fleet, station, flown)
    with busy(SPINNERS if flown.size.busy else 0):
        if flown.size.busy:
            time.sleep(BUSY)
            _only(fleet, station, 0.0, set(), flown)
        _one_fails(fleet, station, flown)
        if flown.size.deployed:
            _one_is_deployed(fleet, station, flown)
        _count_late(station, flown)


def _measure(fleet: Fleet, station: GroundStationLink, flown: Flown) -> None:
    """Everybody flies, nothing happens."""
    before, carried = usage(), fleet.network.carried(GROUND)
    start = time.monotonic()
    time.sleep(MEASURED)
    after, then = usage(), fleet.network.carried(GROUND)
    seconds = time.monotonic() - start
    flown.costs = {
        kind: Usage(
            after[kind].processes,
            (after[kind].processor - before[kind].processor) / seconds,
            after[kind].memory,
        )
        for kind in after
    }
    sent, received = ((b - a) / seconds for a, b in zip(carried, then, strict=True))
    flown.traffic = (sent, received)
    flown.gaps = gaps(station.find(start, vehicle=..., state=...), start)


def gaps(told: Iterable[Told], since: float) -> int:
    """How often a vehicle that was told of was silent for too long."""
    heard: dict[str, float] = {}
    count = 0
    for one in told:
        count += one["at"] > heard.get(one["vehicle"], since) + _GAP
        heard[one["vehicle"]] = one["at"]
    return count


def _one_fails(fleet: Fleet, station: GroundStationLink, flown: Flown) -> None:
    number = flown.size.fails
    failed_at = fleet.act(number, "fail-motor")
    until("it deploys", 15.0, lambda: number in fleet.happened("CANOPY"))
    flown.released = fleet.happened("CANOPY")[number] - failed_at
    _only(fleet, station, failed_at, {number}, flown)


def _one_is_deployed(fleet: Fleet, station: GroundStationLink, flown: Flown) -> None:
    number = flown.size.deployed
    called_at = time.monotonic()
    token = station.call(name_of(number), "deploy", force=False, reason="the operator sees it")
    until("it deploys", 15.0, lambda: number in fleet.happened("CANOPY"))
    flown.commanded = fleet.happened("CANOPY")[number] - called_at
    fleet.answer(station, token)
    _only(fleet, station, called_at, {flown.size.fails, number}, flown)


def _only(
    fleet: Fleet, station: GroundStationLink, since: float, numbers: set[int], flown: Flown
) -> None:
    """These have deployed, and no other; the ground station sees the same."""
    time.sleep(WATCHED)
    for what in ("CANOPY", "FLIGHT TERMINATION"):
        if (happened := set(fleet.happened(what))) != numbers:
            flown.wrong += f"{what} at {sorted(happened)}, not at {sorted(numbers)}; "
    seen = {one["vehicle"] for one in station.find(0.0, deployed=True)}
    if seen != {name_of(number) for number in numbers}:
        flown.wrong += f"the ground station sees deployed: {sorted(seen)}; "
    newest = newest_states(station.find(since, vehicle=..., state=...))
    for number in fleet.numbers:
        expected = Stage.DEPLOYED if number in numbers else Stage.IN_FLIGHT
        if newest.get(name_of(number)) != expected:
            flown.wrong += f"{name_of(number)} is told as {newest.get(name_of(number))}; "


def _count_late(station: GroundStationLink, flown: Flown) -> None:
    """What the supervisors say of themselves."""
    asked_at = time.monotonic()
    station.ask_diagnostics()
    told = until_told(station, "its diagnostics", 10.0, asked_at, diagnostics=...)
    for name, status in told["diagnostics"].items():
        if name.endswith(": itself"):
            flown.late += int(status["values"]["updates late"])
    every = (one for one in station.find(0.0, task=...) if one["task"].endswith(": itself"))
    flown.told_late = len({one["task"] for one in every if "updates late" in one["message"]})


def table(every: Sequence[Flown]) -> str:
    """As Markdown."""
    head = (
        "fleet",
        "all seen",
        "processor: nodes",
        "simulators",
        "ground station",
        "memory of a vehicle",
        "to the ground station",
        "from it",
        "gaps",
        "updates late",
        "a motor fails: out after",
        "the operator deploys: out after",
        "",
    )
    return pages.table(head, [_cells(flown) for flown in every])


def _cells(flown: Flown) -> list[str]:
    costs, count = flown.costs, flown.size.count
    sent, received = flown.traffic

    def processor(kind: str) -> str:
        return f"{100 * costs[kind].processor:.0f} %" if kind in costs else "-"

    memory = f"{costs['nodes'].memory / count:.0f} MB" if costs else "-"
    return [
        flown.size.name,
        in_seconds(flown.all_seen),
        processor("nodes"),
        processor("simulators"),
        processor("ground station"),
        memory,
        _rate(received),
        _rate(sent),
        str(flown.gaps),
        f"{flown.late} (told by {flown.told_late})",
        in_seconds(flown.released),
        in_seconds(flown.commanded),
        flown.wrong.rstrip("; ") or "correct",
    ]


def _rate(value: float) -> str:
    return "-" if math.isnan(value) else f"{value / 1e3:.0f} kB/s"


def fly_all(names: tuple[str, ...] = ()) -> list[Flown]:
    """Every size, or those whose names contain one of names."""
    return fly_stories(SIZES, names, lambda size, folder, _: fly(size, folder))
