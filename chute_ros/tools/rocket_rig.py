"""What a simulated rocket flight consists of: the processes, and the cable between them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from chute_ros.tools.demo_rig import FAULTS
from chute_ros.tools.processes import Processes, ros_arguments

UMBILICAL = "umbilical"
#: Simulated seconds in one real second.
SPEED = 10.0


@dataclass(frozen=True)
class DemoRocketRig:
    """One rocket with its nodes. fault: one of FAULTS, or empty; folder: where the port is;
    profile: of its supervisor."""

    fault: str
    namespace: str
    processes: Processes
    folder: Path
    profile: str = "rocket"

    def start_ground(self) -> None:
        """The nodes: everything but the rocket."""
        start, links = self.processes.start, f"[{UMBILICAL}]"
        supervisor = ros_arguments(
            self.namespace,
            required_links=links,
            kill_links=links,
            deploy_links=links,
            profile=self.profile,
        )
        start("supervisor", "chute_ros.ros.safety_supervisor", *supervisor)
        umbilical = ros_arguments(
            self.namespace,
            connection=f"serial:{self._port}",
            publish_vehicle_state="true",
            dump_folder=self.folder,
        )
        start(UMBILICAL, "chute_ros.links.umbilical", *umbilical)

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
