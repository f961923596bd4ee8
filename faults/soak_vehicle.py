"""The vehicle of the soak: its nodes live on from flight to flight, its devices do not."""

from __future__ import annotations

import contextlib
import re
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chute_msgs.srv import Arm, Deploy
from std_srvs.srv import Trigger

from chute_ros.links.registered import module_of
from chute_ros.links.upf.protocol.parameters import AUTOMATIC
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.pilot import Pilot
from chute_ros.tools.processes import ros_arguments
from faults.network import Network
from faults.patience import Patient
from faults.soak_clock import WallClock
from faults.soak_plan import NODES, SUPERVISORS
from faults.soak_processes import Keeper
from faults.soak_watch import Watch, ready
from faults.soak_wires import Ports, Wires

NAMESPACE = "/soak"
HEIGHT = 100.0  # m; the profile's geofence begins at 120 m
#: Below it a motor failure leaves no time to be seen through a fault and answered.
HIGH_ENOUGH = 80.0  # m
#: ROS home, so that it can be filled to the last byte.
_DISK_MEGABYTES = 64
_DEPLOYED = re.compile(r"RELEASED by|FIRED by")
_NEW_EACH_FLIGHT = ("autopilot", "parachute", "upf")


class SoakError(Exception):
    """What must happen before anything can be tried did not."""


@dataclass(frozen=True)
class Told:
    """A line that a simulated device wrote, when it was read."""

    when: float
    name: str
    line: str


class Vehicle(Patient):
    """One vehicle that lives for the whole run. folder: for all that it writes."""

    failure = SoakError

    def __init__(self, network: Network, folder: Path, ports: Ports, supervisors: int) -> None:
        self.network, self.ports = network, ports
        self.supervisors = SUPERVISORS[:supervisors]
        #: What the devices themselves wrote.
        self.told: list[Told] = []
        self._flown = False
        self._looked_at = time.monotonic()
        #: The longest time between two looks, s, since it was set to 0.
        self.held_up = 0.0
        with contextlib.ExitStack() as made:
            self.home = folder / "ros_home"
            _mount(self.home)
            made.callback(_unmount, self.home)
            self.clocks = {}
            for name in (*NODES, *self.supervisors):
                self.clocks[name] = WallClock(folder, name)
                made.callback(self.clocks[name].close)
            self.wires = Wires(network, ports, folder)
            made.callback(self.wires.close)
            self.watch = Watch(NAMESPACE, NODES, self.supervisors)
            made.callback(self.watch.close)
            self.pilot = Pilot(f"udpout:127.0.0.1:{ports.pilot}", system_id=1)
            made.callback(self.pilot.close)
            self.keeper = Keeper(folder, {"ROS_HOME": str(self.home)})
            made.callback(self.keeper.kill_all)
            self._start_nodes()
            self._start_devices((*_NEW_EACH_FLIGHT, "rocket"))
            self._made = made.pop_all()

    def close(self) -> None:
        """Everything is gone, however far end came."""
        self._made.close()

    def end(self) -> None:
        """The nodes end as a user ends them; what they do wrong in it is found."""
        # One that is still starting up has no handler for signals yet.
        self.until(10.0, lambda: self.keeper.running() and self.watch.diagnostics_after(0.0))
        self.keeper.end((*NODES, *self.supervisors))

    # -- time passes ----------------------------------------------------------------------------

    def turn(self) -> None:
        """One look at everything."""
        before = self._looked_at
        self.watch.spin()
        lines = self.keeper.look()
        self.keeper.note_troubles(lines)
        now = self._looked_at = time.monotonic()
        self.held_up = max(self.held_up, now - before)
        self.told += [Told(now, name, line) for name, line in lines if name not in NODES]

    def complaints(self) -> list[str]:
        """As its supervisors and nodes tell them."""
        return self.watch.complaints()

    # -- flying ---------------------------------------------------------------------------------

    def whole(self) -> bool:
        """Nothing is to be complained of."""
        return self.keeper.running() and not self.watch.complaints()

    def flies(self) -> bool:
        """The supervisor says so."""
        return bool(self.watch.safety.state == Stage.IN_FLIGHT)

    def is_high(self) -> bool:
        """High enough for a motor failure to be answered."""
        return self.flies() and self.watch.vehicle.height > HIGH_ENOUGH

    def new_flight(self) -> None:
        """New devices, a reset, and up it goes."""
        if self._flown:
            for name in _NEW_EACH_FLIGHT:
                self.keeper.kill(name)
            self._start_devices(_NEW_EACH_FLIGHT)
            self.must("the old flight is forgotten", 30.0, self._after_reset)
        self._flown = True
        self.must("it is ready", 90.0, lambda: self._stage(Stage.READY) and self.whole())
        self._granted("arming", self.watch.arm, Arm.Request(arm=True))
        self.pilot.arm()
        self.must("the motors are armed", 10.0, lambda: bool(self.watch.vehicle.armed == 2))
        self.pilot.take_off(HEIGHT)
        self.must("it flies", 20.0, self.flies)
        self.must("it is whole in the air", 20.0, self.whole)

    def ask_deploy(self) -> Callable[[], bool]:
        """A person asks for a deploy, and asks again where the answer does not come; the
        question whether it was granted."""
        asked = _Asked(self.watch.deploy, Deploy.Request(force=False, reason="soak"))
        return asked.look

    def _granted(self, what: str, client: Any, request: Any) -> None:
        asked = _Asked(client, request)
        if not self.until(20.0, asked.look):
            raise SoakError(f"{what} was not granted: {asked.why}")

    def _after_reset(self) -> bool:
        if self.watch.safety.state not in (
            Stage.DEPLOYED,
            Stage.FAULT,
            Stage.LANDED,
            Stage.KILLING,
            Stage.DEPLOYING,
            Stage.IN_FLIGHT,
        ):
            return True
        if all(not one.deployed for one in self.watch.parachutes.values()):
            asked = _Asked(self.watch.reset, Trigger.Request())
            self.until(2.0, asked.look)
        return False

    def _stage(self, stage: Stage) -> bool:
        return bool(self.watch.safety.state == stage)

    # -- processes ------------------------------------------------------------------------------

    def _start_nodes(self) -> None:
        connections = {
            "mavlink_parachute": f"udpin:0.0.0.0:{self.ports.node}",
            "upf_can": self.ports.node_bus,
            "umbilical": f"serial:{self.wires.port}",
        }
        for name in NODES:
            arguments = ros_arguments(NAMESPACE, connection=connections[name])
            environment = self.clocks[name].environment
            self.keeper.start(name, module_of(name), *arguments, more=environment)
        for rank, name in enumerate(self.supervisors):
            arguments = ros_arguments(
                NAMESPACE,
                required_links=f"[{', '.join(NODES)}]",
                kill_links="[mavlink_parachute]",
                deploy_links="[mavlink_parachute, upf_can]",
                hot_standby=str(len(self.supervisors) > 1).lower(),
                rank=rank,
                black_box_file_limit=4,
                black_box_most_files=4,
            )
            arguments += ["-r", f"__node:={name}"]
            module, environment = module_of("safety_supervisor"), self.clocks[name].environment
            self.keeper.start(name, module, *arguments, more=environment)

    def _start_devices(self, names: tuple[str, ...]) -> None:
        ports = self.ports
        feel = f"udpout:127.0.0.1:{ports.pilot}"
        what: dict[str, tuple[str, ...]] = {
            "autopilot": (
                "chute_ros.sim.sim_autopilot",
                *("--connection", f"udpout:127.0.0.1:{ports.autopilot}"),
                *("--connection", f"udpin:127.0.0.1:{ports.pilot}"),
            ),
            "parachute": (
                "chute_ros.links.mavlink.simulator.sim_mavlink_parachute",
                *("--connection", f"udpout:127.0.0.1:{ports.parachute}"),
                *("--connection", feel),
            ),
            "upf": (
                "chute_ros.links.upf.simulator.sim_upf",
                *("--connection", ports.device_bus, "--vehicle", feel),
                *[
                    part
                    for name in ("Enable APS", *AUTOMATIC)
                    for part in ("--parameter", f"{name}=false")
                ],
            ),
            "rocket": (
                "chute_ros.links.umbilical.simulator.sim_flight_computer",
                *("--link", str(self.wires.device)),
            ),
        }
        for name in names:
            module, *arguments = what[name]
            self.keeper.start(name, module, *arguments)

    # -- what the devices did -------------------------------------------------------------------

    def deployed(self, since: float) -> list[Told]:
        """Parachutes that came out, by their own record."""
        return [one for one in self.told if one.when >= since and _DEPLOYED.search(one.line)]

    def killed(self, since: float) -> list[Told]:
        """Kills that the autopilot took, by its own record."""
        return [one for one in self.told if one.when >= since and "FLIGHT TERMINATION" in one.line]


class _Asked:
    """A service call that is made again, as long as no answer grants it."""

    def __init__(self, client: Any, request: Any) -> None:
        self._client, self._request = client, request
        self._future: Any = None
        self._give_up_at = 0.0
        self.why = "the service is not offered"

    def look(self) -> bool:
        """It was granted."""
        now = time.monotonic()
        if self._future is not None and self._future.done():
            answer, self._future = self._future.result(), None
            if answer.success:
                return True
            self.why = answer.message
            self._give_up_at = now + 0.3
        elif now >= self._give_up_at and ready(self._client):
            self._future = self._client.call_async(self._request)
            self._give_up_at = now + 1.5
        return False


def _mount(home: Path) -> None:
    home.mkdir()
    size = f"size={_DISK_MEGABYTES}m"
    subprocess.run(["mount", "-t", "tmpfs", "-o", size, "soak", str(home)], check=True)


def _unmount(home: Path) -> None:
    # Lazily: who died a moment ago may still hold a file.
    subprocess.run(["umount", "--lazy", str(home)], check=True)
