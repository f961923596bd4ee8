"""What a simulated rocket flight consists of: the processes, and the cable between them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from chute_ros.tools.demo_rig import FAULTS
from chute_ros.tools.processes import Processes

UMBILICAL = "umbilical"
#: Simulated seconds in one real second.
SPEED = 10.0


@dataclass(frozen=True)
class RocketRig:
    """One rocket with its nodes. fault: one of FAULTS, or empty; folder: where the port is."""

    fault: str
    namespace: str
    processes: Processes
    folder: Path

    def start_ground(self) -> None:
        """The nodes: everything but the rocket."""
        node = ("--ros-args", "-r", f"__ns:={self.namespace}")
        links = f"[{UMBILICAL}]"
        supervisor = [
            part
            for name in ("required_links", "kill_links", "deploy_links")
            for part in ("-p", f"{name}:={links}")
        ]
        supervisor += ["-p", "profile:=rocket"]
        start = self.processes.start
        start("supervisor", "chute_ros.ros.safety_supervisor", *node, *supervisor)
        start(
            UMBILICAL,
            "chute_ros.links.umbilical",
            *node,
            *("-p", f"connection:=serial:{self._port}"),
            *("-p", "publish_vehicle_state:=true"),
            *("-p", f"dump_folder:={self.folder}"),
        )

    def plug_cable_in(self) -> None:
        """The rocket, whose drogue will not come out by itself."""
        self.processes.start(
            "rocket",
            "chute_ros.links.umbilical.simulator.sim_flight_computer",
            *("--link", str(self._port), "--speed", f"{SPEED:g}"),
            *("--drogue-fails", "--interlock", "--debug"),
            *FAULTS.get(self.fault, ()),
        )

    @property
    def _port(self) -> Path:
        return self.folder / "ttyROCKET"
