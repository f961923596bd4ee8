"""What a simulated flight consists of: the processes for each parachute, and their wires."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from chute_ros.links.upf.protocol.parameters import AUTOMATIC
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.tools.processes import Processes, ros_arguments

MAVLINK, UPF = "mavlink_parachute", "upf_can"
#: Links that have the parachute, by the name of the rig.
KINDS: dict[str, tuple[str, ...]] = {
    "mavlink": (MAVLINK,),
    "upf": (UPF,),
    "both": (MAVLINK, UPF),
}
#: What --fault adds to the command line of the simulated parachute.
FAULTS = {"parachute-silent": ("--at", "0:silent"), "parachute-mute": ("--at", "0:mute")}
_LOCAL = "127.0.0.1"


@dataclass(frozen=True)
class DemoRig:
    """One vehicle with its nodes. kind: one of KINDS; fault: one of FAULTS, or empty."""

    kind: str
    fault: str
    namespace: str
    processes: Processes
    node_port: int
    vehicle_port: int
    bus_port: int

    @classmethod
    def on_free_ports(cls, kind: str, fault: str, namespace: str, processes: Processes) -> DemoRig:
        """With wires that nobody else uses."""
        return cls(kind, fault, namespace, processes, *free_udp_ports(3))

    @property
    def links(self) -> tuple[str, ...]:
        """The links that have a parachute."""
        return KINDS[self.kind]

    @property
    def pilot(self) -> str:
        """Where the pilot reaches the autopilot."""
        return f"udpout:{_LOCAL}:{self.vehicle_port}"

    @property
    def automatic(self) -> bool:
        """The parachute's own algorithm fires, not the operator."""
        return self.kind == "upf"

    def start_supervisor(self, name: str, *more: str, on: Sequence[str] = ()) -> None:
        """One supervisor. more: of its command line; on: the host, as for Processes.start."""
        links = ", ".join(dict.fromkeys((MAVLINK, *self.links)))
        node = ros_arguments(
            self.namespace,
            required_links=f"[{links}]",
            deploy_links=f"[{', '.join(self.links)}]",
            # Where the parachute decides by itself, nothing else shall.
            profile="by_hand" if self.automatic else "multirotor",
        )
        self.processes.start(name, "chute_ros.ros.safety_supervisor", *node, *more, on=on)

    def start_vehicle(self) -> None:
        """The vehicle with the nodes of its links, but for the parachute."""
        start = self.processes.start
        node = ros_arguments(
            self.namespace,
            connection=f"udpin:{_LOCAL}:{self.node_port}",
            expect_parachute=str(MAVLINK in self.links).lower(),
        )
        start("mavlink", "chute_ros.links.mavlink", *node)
        if UPF in self.links:
            node = ros_arguments(self.namespace, connection=self._bus, allocator="false")
            start("upf_can", "chute_ros.links.upf", *node)
        listens = f"udpin:{_LOCAL}:{self.vehicle_port}"
        wires = ("--connection", self._network, "--connection", listens)
        start("autopilot", "chute_ros.sim.sim_autopilot", *wires)

    def start_parachute(self) -> None:
        """Plug it in."""
        fault = FAULTS.get(self.fault, ())
        if MAVLINK in self.links:
            module = "chute_ros.links.mavlink.simulator.sim_mavlink_parachute"
            wires = ("--connection", self._network, "--connection", self.pilot)
            self.processes.start("parachute", module, *wires, *fault)
        if UPF in self.links:
            # The operator arms it on the ground: nothing that would do so by itself is on.
            off = [*AUTOMATIC, *(() if self.automatic else ("Enable APS",))]
            parameters = [part for name in off for part in ("--parameter", f"{name}=false")]
            wires = ("--connection", self._bus, "--vehicle", self.pilot)
            module = "chute_ros.links.upf.simulator.sim_upf"
            self.processes.start("upf", module, *wires, *parameters, *fault)

    @property
    def _network(self) -> str:
        return f"udpout:{_LOCAL}:{self.node_port}"

    @property
    def _bus(self) -> str:
        return f"mcast:0:{self.bus_port}"
