"""A flight under a ground station: the vehicle is one host, the ground station another."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from chute_ros.model import Action, Outcome
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.demo_director import StepFailedError
from faults.flight import Flight
from faults.ground_station_link import GroundStationLink
from faults.network import Network

VEHICLE, GROUND = "vehicle", "ground"
HOSTS = (VEHICLE, GROUND)
HEIGHT = 25.0  # m
#: A call that waits for the network longer than this is not wanted any more, s.
LIFESPAN = 1.0
#: For the first sight of a vehicle whose processes have just been started, s.
_START_TIMEOUT = 60.0
#: What a ground station is started with, by what it is called here.
USUAL, CAREFUL, PLAIN = "usual", "careful", "plain"
_STARTED_WITH: dict[str, tuple[str, ...]] = {
    USUAL: (),
    CAREFUL: ("--lifespan", str(LIFESPAN)),
    PLAIN: ("--plain",),
}
#: The settings of Fast DDS that our nodes load, which a plain ground station has not.
_SETTINGS = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")


class GroundStationFlight(Flight):
    """One flight with ground stations."""

    def __init__(self, network: Network, folder: Path, namespace: str) -> None:
        super().__init__(network, folder, namespace)
        self._stations: dict[str, GroundStationLink] = {}
        self._failed = False

    def close(self) -> None:
        """Everything ends; the network is whole again."""
        for station in self._stations.values():
            station.close()
        super().close()

    def take_off(self) -> None:
        """Armed by the ground station, up."""
        self.rig.start_vehicle()
        self.rig.start_parachute()
        self.rig.start_supervisor("supervisor")
        station = self.station(USUAL)
        self.director.until("flight is released", _START_TIMEOUT, self.director.stage(Stage.READY))
        self.director.arm(10.0)
        self.climb(HEIGHT)
        self.seen(station, time.monotonic(), state=int(Stage.IN_FLIGHT))

    def flies(self) -> bool:
        """The flight can go on with another story."""
        return not self._failed and self.director.safety.state == Stage.IN_FLIGHT

    def station(self, name: str) -> GroundStationLink:
        """One of the ground stations, which sees the vehicle; started when first asked for."""
        if name not in self._stations:
            station = self.start_station(name)
            self.seen(station, 0.0, _START_TIMEOUT, state=...)
            # Its services are found apart from its topics.
            self.spin(1.0)
        return self._stations[name]

    def start_station(self, name: str) -> GroundStationLink:
        """The same, without awaiting anything."""
        plain = dict.fromkeys(_SETTINGS) if name == PLAIN else {}
        self._stations[name] = GroundStationLink(
            self.folder / f"ground_{name}.log",
            [self.namespace],
            *_STARTED_WITH[name],
            on=self.network.on(GROUND),
            environment=plain,
        )
        return self._stations[name]

    def seen(
        self, station: GroundStationLink, since: float, seconds: float = 30.0, **told: Any
    ) -> float:
        """Await that the station tells this of something after since; when it did."""
        what = f"the ground station sees {told}"
        self.director.until(what, seconds, lambda: station.first(since, **told) is not None)
        first = station.first(since, **told)
        assert first is not None
        return float(first["at"])

    def deploy(self, station: GroundStationLink, reason: str) -> tuple[int, float]:
        """The operator calls safety/deploy; which call, and when."""
        return self._call(station, "deploy", reason)

    def kill(self, station: GroundStationLink, reason: str) -> tuple[int, float]:
        """The operator calls safety/kill; which call, and when."""
        return self._call(station, "kill", reason)

    def harmless(self, station: GroundStationLink) -> float:
        """Call for the mode that the supervisor has; how long the answer took."""
        token, called_at = self._call(station, "set_mode", "to hear an answer", mode=0)
        return self.seen(station, called_at, answered=token) - called_at

    def _call(
        self, station: GroundStationLink, service: str, reason: str, **more: Any
    ) -> tuple[int, float]:
        token = station.call(self.namespace, service, force=False, reason=reason, **more)
        called_at = self.seen(station, 0.0, called=token)
        if not (told := station.first(called=token)) or not told["offered"]:
            raise StepFailedError(f"safety/{service} is not offered to the ground station")
        return token, called_at

    def fail_motor(self) -> float:
        """A motor fails; when."""
        failed_at = time.monotonic()
        self.pilot.fail_motor()
        self._failed = True
        return failed_at

    def on_the_wire(self, action: Action) -> float:
        """When the device node had sent this to its device."""
        return self.director.when(action, Outcome.SENT)
