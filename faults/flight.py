"""One vehicle in the air, watched from its own host, on a network that can be spoilt."""

from __future__ import annotations

import re
import time
from pathlib import Path

from chute_ros.supervisor.machine import Stage
from chute_ros.tools.demo_director import Director
from chute_ros.tools.demo_rig import DemoRig
from chute_ros.tools.pilot import Pilot
from chute_ros.tools.processes import Processes
from faults.network import Network

_ACTED = re.compile(r"decision (\d+) of epoch (\d+), (KILL|DEPLOY) \(")


class Flight:
    """One flight with the hosts of a network; this process is on the vehicle's host."""

    def __init__(
        self,
        network: Network,
        folder: Path,
        namespace: str,
        processes: Processes | None = None,
    ) -> None:
        self.network = network
        self.folder = folder
        self.namespace = namespace
        self.processes = processes or Processes(folder)
        self.director = Director(namespace, self.processes)
        self.rig = DemoRig.on_free_ports("mavlink", "", namespace, self.processes)
        self.pilot = Pilot(self.rig.pilot, system_id=1)

    def close(self) -> None:
        """Everything ends; the network is whole again."""
        self.heal()
        self.pilot.close()
        self.director.close()
        self.processes.end()

    def climb(self, height: float) -> None:
        """With its parachute armed: motors on, up to height, m."""
        director = self.director
        self.pilot.arm()
        director.until("the motors are armed", 10.0, lambda: director.vehicle.armed == 2)
        self.pilot.take_off(height)
        director.until("it flies", 20.0, director.stage(Stage.IN_FLIGHT))
        director.until("it is up", 60.0, lambda: director.vehicle.height > height - 1.0)

    def heal(self) -> None:
        """Every cable is whole."""
        for host in self.network.hosts:
            self.network.cable(host, "heal")

    def spin(self, seconds: float) -> None:
        """Let time pass."""
        end = time.monotonic() + seconds
        self.director.until("time passes", seconds + 5.0, lambda: time.monotonic() >= end)

    def acted(self) -> list[tuple[int, int, str]]:
        """The kills and deploys that the device node acted on, in their order."""
        return acted_on(self.processes.log("mavlink").read_text(errors="replace"))


def acted_on(log: str) -> list[tuple[int, int, str]]:
    """The kills and deploys of a device node's log: epoch, number, which of both."""
    found = (_ACTED.search(line) for line in log.splitlines() if "[WARN]" in line)
    return [(int(one[2]), int(one[1]), one[3]) for one in found if one]
