"""Many vehicles under one ground station: real nodes on hosts of five vehicles each."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from chute_ros.links.registered import module_of
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.demo_director import StepFailedError
from chute_ros.tools.processes import Processes
from faults.ground_station_link import GroundStationLink, Told
from faults.network import Network

GROUND = "ground"
VEHICLES_ON_A_HOST = 5
HEIGHT = 40.0  # m
_FIRST_PORT = 14600
_POLL = 0.02  # s
#: For what takes as long as the processor is busy with so many starts, s.
_START_TIMEOUT = 150.0
#: A fifth of the rates of mavlink_parachute, and limits of safety_supervisor that fit to them:
#: what 20 vehicles may cost where one computer has to carry them all.
_USUAL: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
_SLOWED: tuple[tuple[str, ...], tuple[str, ...]] = (
    ("heartbeat_rate:=2.0", "autopilot_message_rate:=2.0"),
    ("heartbeat_stale_after:=3.0", "heartbeat_lost_after:=6.0", "startup_grace:=60.0"),
)


def hosts_for(count: int) -> tuple[str, ...]:
    """The ground station's host, and as many as so many vehicles need."""
    need = -(-count // VEHICLES_ON_A_HOST)
    return (GROUND, *(f"air{number}" for number in range(1, need + 1)))


def name_of(number: int) -> str:
    """The namespace of a vehicle."""
    return f"/drone{number}"


def host_of(number: int) -> str:
    """Where a vehicle is."""
    return f"air{(number - 1) // VEHICLES_ON_A_HOST + 1}"


def first_times(said: str, what: str) -> dict[int, float]:
    """Of the lines of faults.fleet_simulators: vehicle -> when it first did what."""
    found: dict[int, float] = {}
    for line in said.splitlines():
        when, _, rest = line.partition(" ")
        number, _, text = rest.partition(" ")
        if text.startswith(what):
            found.setdefault(int(number), float(when))
    return found


def until(what: str, seconds: float, condition: Callable[[], bool]) -> None:
    """Wait until condition holds; StepFailedError if it does not within seconds."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() >= end:
            raise StepFailedError(f"{what}: not within {seconds:g} s")
        time.sleep(_POLL)


def until_told(
    station: GroundStationLink, what: str, seconds: float, since: float = 0.0, **wanted: object
) -> Told:
    """The first that the station tells with these fields since then, awaited as by until."""
    until(what, seconds, lambda: station.first(since, **wanted) is not None)
    first = station.first(since, **wanted)
    assert first is not None
    return first


class Fleet:
    """Vehicles 1 to count. environments: of the nodes of vehicles and of the ground, beside that
    of this process; slowed: with the rates of _SLOWED."""

    def __init__(
        self,
        network: Network,
        folder: Path,
        count: int,
        environments: tuple[Mapping[str, str], Mapping[str, str]],
        slowed: bool,
    ) -> None:
        self.network = network
        self.folder = folder
        self.numbers = tuple(range(1, count + 1))
        self.names = tuple(name_of(number) for number in self.numbers)
        self.processes = Processes(folder)
        self._environment, self._ground_environment = environments
        self._link, self._supervisor = _SLOWED if slowed else _USUAL
        self._simulators: dict[str, subprocess.Popen[bytes]] = {}
        self._stations: list[GroundStationLink] = []

    def close(self) -> None:
        """Everything ends."""
        for station in self._stations:
            station.close()
        for simulator in self._simulators.values():
            assert simulator.stdin is not None
            simulator.stdin.close()
            simulator.wait()
        self.processes.end()

    def start(self, station: GroundStationLink) -> None:
        """All vehicles, with the nodes of vehicle.launch.py; host after host, as the station sees
        them: what takes most of the processor is the start."""
        for host in self.network.hosts:
            if numbers := [n for n in self.numbers if host_of(n) == host]:
                self._start_simulators(host, numbers)
                for number in numbers:
                    self._start_link(number)
                    self.start_supervisor(number)
                names = tuple(name_of(number) for number in numbers)
                what = f"the vehicles on {host} are seen"
                self.until_all(station, what, _START_TIMEOUT, None, names)

    def _start_simulators(self, host: str, numbers: list[int]) -> None:
        ports = [f"{number}={_FIRST_PORT + number}" for number in numbers]
        with self.processes.log(host).open("wb") as log:
            self._simulators[host] = subprocess.Popen(
                [*self.network.on(host), sys.executable, "-m", "faults.fleet_simulators", *ports],
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def _start_node(self, name: str, module: str, number: int, *parameters: str) -> None:
        arguments = [part for one in parameters for part in ("-p", one)]
        # Of the environment only what is asked for: Processes passes on that of this process.
        variables = [f"{name}={value}" for name, value in self._environment.items()]
        self.processes.start(
            f"{name}{number}",
            module_of(module),
            *("--ros-args", "-r", f"__ns:={name_of(number)}", *arguments),
            on=(*self.network.on(host_of(number)), "env", *variables),
        )

    def _start_link(self, number: int) -> None:
        wire = f"connection:=udpin:127.0.0.1:{_FIRST_PORT + number}"
        parameters = (wire, f"system_id:={number}", *self._link)
        self._start_node("mavlink", "mavlink_parachute", number, *parameters)

    def start_supervisor(self, number: int) -> None:
        """Of one vehicle, for the first time or again."""
        links = ("required_links:=[mavlink_parachute]", "deploy_links:=[mavlink_parachute]")
        parameters = (*links, *self._supervisor)
        self._start_node("supervisor", "safety_supervisor", number, *parameters)

    def act(self, number: int, action: str) -> float:
        """Have the autopilot of a vehicle do something; when it was told."""
        simulator = self._simulators[host_of(number)]
        assert simulator.stdin is not None
        simulator.stdin.write(f"{number} {action}\n".encode())
        simulator.stdin.flush()
        return time.monotonic()

    def happened(self, what: str) -> dict[int, float]:
        """What the simulated devices did: vehicle -> when it first did what."""
        logs = [self.processes.log(host).read_text() for host in self._simulators]
        return first_times("".join(logs), what)

    def station(self, environment: Mapping[str, str] | None = None) -> GroundStationLink:
        """A ground station for all of them; environment: not that of the ground but this."""
        link = GroundStationLink(
            self.folder / f"ground{len(self._stations)}.log",
            self.names,
            on=self.network.on(GROUND),
            environment=self._ground_environment if environment is None else environment,
        )
        self._stations.append(link)
        return link

    def close_station(self, station: GroundStationLink) -> None:
        """One of them is not needed any more."""
        self._stations.remove(station)
        station.close()

    def until_all(
        self,
        station: GroundStationLink,
        what: str,
        seconds: float,
        stage: Stage | None,
        names: Sequence[str] = (),
    ) -> float:
        """Until the station has seen these vehicles, or all (in this stage, if one is given); when
        it saw the last of them."""
        wanted_names = set(names or self.names)
        since = 0.0
        seen: dict[str, float] = {}

        def all_seen() -> bool:
            nonlocal since
            wanted = {"state": ... if stage is None else int(stage)}
            for one in station.find(since, vehicle=..., **wanted):
                seen.setdefault(one["vehicle"], one["at"])
            since = station.told[-1]["at"] if station.told else 0.0
            self.processes.check()
            return wanted_names <= set(seen)

        try:
            until(what, seconds, all_seen)
        except StepFailedError as error:
            missing = sorted(wanted_names - set(seen))
            raise StepFailedError(f"{error}; missing: {', '.join(missing)}") from None
        return max(seen[name] for name in wanted_names)

    def take_off(self, station: GroundStationLink) -> None:
        """Each armed by the operator, motors on, up. What is not in the air is asked again: on a
        busy computer a late heartbeat blocks flight now and then, and that undoes arming."""
        self.until_all(station, "flight of all is released", _START_TIMEOUT, Stage.READY)
        end = time.monotonic() + _START_TIMEOUT
        missing = self.numbers
        while missing:
            if time.monotonic() > end:
                names = ", ".join(map(name_of, missing))
                raise StepFailedError(f"not in the air within {_START_TIMEOUT:g} s: {names}")
            for number in missing:
                call = station.call(name_of(number), "arm", arm=True, triggers=0)
                if self.answer(station, call)["success"]:
                    self.act(number, "arm")
                    self.act(number, f"takeoff={HEIGHT}")
            asked_at = time.monotonic()
            until_told(station, "states come", 10.0, asked_at + 2.0, vehicle=..., state=...)
            seen = newest_states(station.find(vehicle=..., state=...))
            missing = tuple(n for n in missing if seen.get(name_of(n)) != Stage.IN_FLIGHT)

    def answer(self, station: GroundStationLink, token: int) -> Told:
        """The answer to a call, awaited."""
        return until_told(station, "a call is answered", 15.0, answered=token)

    def join(self) -> float:
        """Another ground station starts: how long until it has seen all, s."""
        joined = self.station()
        seen = self.until_all(joined, "all are seen", 60.0, None)
        begun = until_told(joined, "it looks around", 1.0, begun=True)
        self.close_station(joined)
        return float(seen - begun["at"])


def newest_states(told: Iterable[Told]) -> dict[str, int]:
    """Of what a ground station has told in its order: vehicle -> state."""
    return {one["vehicle"]: one["state"] for one in told}
