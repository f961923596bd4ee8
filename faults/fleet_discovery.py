"""Vehicles and ground stations that find each other only through discovery servers."""

from __future__ import annotations

import signal
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from chute_ros.errors import ChuteError
from chute_ros.tools import pages
from faults.discovery_server import DiscoveryServers
from faults.fleet import Fleet, host_of, hosts_for, name_of, until_told
from faults.ground_station_link import GroundStationLink
from faults.network import Network

VEHICLES = 2
#: How long a ground station that must not find anything looks, s.
LOOKED = 6.0
#: After this nobody waits any more for one who died without a word: Fast DDS does for 20 s.
FORGOTTEN = 25.0


@dataclass
class Step:
    """A line of the table. seconds: what was measured, if anything was."""

    name: str
    seconds: float | None
    found: str
    wrong: bool = False


class Search:
    """One run; what it found, step by step."""

    def __init__(self, network: Network, servers: DiscoveryServers, folder: Path) -> None:
        self._network, self._servers = network, servers
        self._fleet = Fleet(
            network, folder, VEHICLES, (servers.of_vehicles, servers.of_ground), False
        )
        self._station = self._fleet.station()
        self.steps: list[Step] = []

    def close(self) -> None:
        """Everything ends."""
        self._fleet.close()

    def run(self) -> None:
        """Who finds whom, also while the server on the ground is dead, and afterwards."""
        self._fleet.start(self._station)
        name = "a ground station with `ROS_DISCOVERY_SERVER` starts"
        self.steps.append(Step(name, self._fleet.join(), "all vehicles"))
        self._stranger("a ground station without it starts (multicast does not pass)", {})
        self._list_topics("a tool", {})
        self._list_topics("a tool with `ROS_SUPER_CLIENT=TRUE`", _SUPER)
        self._servers.kill_ground()
        killed_at = time.monotonic()
        self._goes_on(killed_at)
        late = self._stranger("a ground station starts meanwhile", self._servers.of_ground)
        time.sleep(max(0.0, killed_at + FORGOTTEN - time.monotonic()))
        self._servers.start_ground()
        self._returns(late)

    def fall_alone(self, deploys: bool) -> None:
        """In flight, cut off from the ground, a supervisor dies, is started again, and a motor
        fails: does the vehicle deploy?"""
        if not deploys:
            self._fleet.start(self._station)
        self._fleet.take_off(self._station)
        host = host_of(1)
        self._network.cable(host, "cut")
        cut_at = time.monotonic()
        self._fleet.processes.send_signal("supervisor1", signal.SIGKILL)
        self._fleet.start_supervisor(1)
        # Its start, and the time that a link needs to count again.
        time.sleep(LOOKED)
        failed_at = self._fleet.act(1, "fail-motor")
        time.sleep(LOOKED)
        released = self._fleet.happened("CANOPY").get(1)
        servers = "a server of its own" if deploys else "none but the ground's"
        name = f"cut, its supervisor is started again, a motor fails; with {servers}"
        after = None if released is None else released - failed_at
        found = "**the parachute stays in**" if released is None else "the parachute is out"
        self.steps.append(Step(name, after, found, wrong=deploys and released is None))
        time.sleep(max(0.0, cut_at + FORGOTTEN - time.monotonic()))
        self._network.cable(host, "unicast")
        healed_at = time.monotonic()
        what = {"vehicle": name_of(1), "state": ...}
        seen = until_told(self._station, "it is seen", 60.0, healed_at, **what)["at"]
        name = "that cable is healed: the ground station sees it"
        self.steps.append(Step(name, seen - healed_at, "the vehicle"))

    def _stranger(self, name: str, environment: Mapping[str, str]) -> GroundStationLink:
        stranger = self._fleet.station(environment)
        until_told(stranger, "it looks around", 20.0, begun=True)
        time.sleep(LOOKED)
        found = {one["vehicle"] for one in stranger.find(vehicle=...)}
        text = f"nothing in {LOOKED:g} s" if not found else ", ".join(sorted(found))
        self.steps.append(Step(name, None, text, wrong=bool(found)))
        return stranger

    def _list_topics(self, name: str, more: Mapping[str, str]) -> None:
        tool = self._fleet.station({**self._servers.of_ground, **more})
        self._fleet.until_all(tool, "all are seen", 30.0, None)
        tool.ask_topics()
        told = until_told(tool, "the tool's topics", 10.0, topics=...)
        # A ground station has no business with it, so that nobody but a super client is told.
        heartbeats = [name_of(n) + "/safety/heartbeat" for n in self._fleet.numbers]
        found = sum(one in told["topics"] for one in heartbeats)
        text = f"{found} of {VEHICLES} `safety/heartbeat` in its list of topics"
        wrong = found != (VEHICLES if more else 0)
        self.steps.append(Step(f"{name} lists topics", None, text, wrong))
        self._fleet.close_station(tool)

    def _goes_on(self, killed_at: float) -> None:
        token = self._station.call(name_of(1), "deploy", force=False, reason="not in flight")
        answer = self._fleet.answer(self._station, token)
        time.sleep(LOOKED)
        since = time.monotonic() - 2.0
        heard = {one["vehicle"] for one in self._station.find(since, vehicle=..., state=...)}
        self.steps.append(
            Step(
                "the ground's server is killed: who has found each other",
                answer["at"] - killed_at,
                f"goes on: {len(heard)} of {VEHICLES} are seen, `safety/deploy` answers",
                wrong=len(heard) != VEHICLES,
            )
        )

    def _returns(self, late: GroundStationLink) -> None:
        started_at = time.monotonic()
        seen = self._fleet.until_all(late, "all are seen", 60.0, None)
        name = f"the server returns after {FORGOTTEN:g} s: that ground station sees"
        self.steps.append(Step(name, seen - started_at, "all vehicles"))
        self._fleet.close_station(late)


_SUPER = {"ROS_SUPER_CLIENT": "TRUE"}


def table(steps: list[Step]) -> str:
    """As Markdown."""
    rows = []
    for step in steps:
        after = "-" if step.seconds is None else f"{step.seconds:.2f} s"
        verdict = "**wrong**" if step.wrong else "as fleet.md says"
        rows.append((step.name, after, step.found, verdict))
    return pages.table(("what happens", "after", "what is found", ""), rows)


def search_all() -> list[Step]:
    """Every step."""

    def with_own(search: Search) -> None:
        search.run()
        search.fall_alone(deploys=True)

    return _search(True, with_own) + _search(False, lambda search: search.fall_alone(False))


def _search(own: bool, act: Callable[[Search], None]) -> list[Step]:
    with (
        tempfile.TemporaryDirectory(prefix="chute_ros_discovery_") as name,
        Network(hosts_for(VEHICLES)) as network,
        closing(DiscoveryServers(network, Path(name), own)) as servers,
    ):
        for host in network.hosts:
            network.cable(host, "unicast")
        servers.start()
        search = Search(network, servers, Path(name))
        try:
            act(search)
        except ChuteError as error:
            print(error)
            search.steps.append(Step("the next step", None, str(error).splitlines()[0], True))
        finally:
            search.close()
    return search.steps
