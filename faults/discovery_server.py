"""The discovery servers of a fleet, as docs/guide/fleet.md has them: on the ground, and on each
host of vehicles, so that a vehicle's own nodes find each other without the ground."""

from __future__ import annotations

import subprocess
from pathlib import Path

from faults.network import Network

PORT = 11811
_END_TIMEOUT = 5.0  # s
_OWN = "127.0.0.1"


class DiscoveryServers:
    """The first host of the network is the ground's. own: the others have a server each."""

    def __init__(self, network: Network, folder: Path, own: bool = True) -> None:
        self._network, self._folder, self._own = network, folder, own
        self._ground_host = network.hosts[0]
        self._ground = f"{network.address(self._ground_host)}:{PORT}"
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    @property
    def of_vehicles(self) -> dict[str, str]:
        """What each node of a vehicle needs; a server's number is its place in the list."""
        own = f"{_OWN}:{PORT}" if self._own else ""
        return {"ROS_DISCOVERY_SERVER": f"{own};{self._ground}"}

    @property
    def of_ground(self) -> dict[str, str]:
        """What each node on the ground needs."""
        return {"ROS_DISCOVERY_SERVER": f";{self._ground}"}

    def close(self) -> None:
        """They are gone."""
        for host in list(self._running):
            self._kill(host)

    def start(self) -> None:
        """From now on they can be asked."""
        self.start_ground()
        if self._own:
            for host in self._network.hosts[1:]:
                self._start(host, 0, _OWN)

    def start_ground(self) -> None:
        """The one on the ground."""
        self._start(self._ground_host, 1, self._network.address(self._ground_host))

    def kill_ground(self) -> None:
        """It dies, without a word to anybody."""
        self._kill(self._ground_host)

    def _start(self, host: str, number: int, address: str) -> None:
        with (self._folder / f"discovery_server_{host}.log").open("ab") as log:
            self._running[host] = subprocess.Popen(
                [
                    *self._network.on(host),
                    *("fast-discovery-server", "-i", str(number), "-l", address, "-p", str(PORT)),
                ],
                # Nobody may type into it.
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def _kill(self, host: str) -> None:
        process = self._running.pop(host)
        process.kill()
        process.wait(_END_TIMEOUT)
