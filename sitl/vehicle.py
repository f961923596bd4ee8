"""A vehicle on loopback: an autopilot's simulator, the real nodes, a parachute, a station."""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from chute_msgs.srv import Arm, Deploy, Kill
from std_srvs.srv import Trigger

from chute_ros.errors import ChuteError
from chute_ros.links.registered import module_of
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.signing import (
    EPOCH_2015,
    UNITS_PER_SECOND,
    Signer,
    SigningClock,
)
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.processes import ros_arguments
from faults.patience import Patient
from faults.soak_processes import Keeper
from faults.soak_watch import Watch, ready
from sitl.autopilots import ARDUCOPTER, PX4, Autopilot, version_text
from sitl.pilot import Pilot
from sitl.simulators import Simulator, ports_for
from sitl.station import GROUND_STATION, Station
from sitl.truth import GROUND, Truth

NAMESPACE = "/sitl"
NODE, CAN_NODE, SUPERVISOR = "mavlink_parachute", "upf_can", "safety_supervisor"
_TRUTH_RATE = 25.0  # Hz
_BENCH = (254, 190)
#: On a machine that is busy, s.
_ROUTES_WITHIN = 20.0
ROUTER, FORWARDS = "router", "autopilot forwards"


class StoryError(ChuteError):
    """A story could not be flown to its end: what should have been did not come about."""


@dataclass(frozen=True)
class Setup:
    """How a vehicle is put together."""

    wiring: str = ROUTER
    #: Bytes a second of the companion computer's line; 0: as fast as may be.
    line_rate: int = 0
    hexa: bool = False
    #: Parameters of the autopilot.
    settings: Mapping[str, float] = field(default_factory=dict)
    #: Parameters of the node and of the supervisor, as text.
    node: Mapping[str, str] = field(default_factory=dict)
    supervisor: Mapping[str, str] = field(default_factory=dict)
    #: Options of the parachute's simulator.
    parachute: tuple[str, ...] = ()
    signed: bool = False
    #: The parachute is on the autopilot's DroneCAN bus; the autopilot gives out node ids.
    dronecan: bool = False


class Vehicle(Patient):
    """One, for one run of a story. folder: for all that it writes."""

    failure = StoryError

    def __init__(self, autopilot: Autopilot, setup: Setup, folder: Path) -> None:
        self.autopilot, self.setup, self.folder = autopilot, setup, folder
        self.ports = ports_for(autopilot)
        self.record = folder / "record"
        self.truth = Truth()
        self._truth_at = 0.0
        #: Changes of safety/state, with the time.
        self.stages: list[tuple[float, str]] = []
        with contextlib.ExitStack() as made:
            links = (NODE, CAN_NODE) if setup.dronecan else (NODE,)
            self.watch = Watch(NAMESPACE, links, (SUPERVISOR,))
            made.callback(self.watch.close)
            self.kill = self.watch.node.create_client(Kill, "safety/kill")
            self.keeper = Keeper(folder, {"ROS_HOME": str(folder / "ros_home")})
            made.callback(self.keeper.kill_all)
            self.simulator = Simulator(
                autopilot, folder, self.ports, setup.settings, setup.line_rate, setup.hexa
            )
            self._start_router()
            self.simulator.start()
            made.callback(self.simulator.end)
            self._key = folder / "key"
            self._start_processes()
            self.station = Station(self.ports.station, GROUND_STATION, self._signer(1))
            made.callback(self.station.close)
            self.bench = Station(self.ports.bench_end, _BENCH, self._signer(2))
            made.callback(self.bench.close)
            self.pilot = Pilot(autopilot.kind, self.station, self.bench)
            self._made = made.pop_all()

    def close(self) -> None:
        """Everything is gone."""
        self._made.close()

    # -- time passes ----------------------------------------------------------------------------

    def turn(self) -> None:
        """One look at everything."""
        self.watch.spin(0.02)
        self.station.turn()
        self.bench.turn()
        self.pilot.turn()
        self.simulator.check()
        self.keeper.note_troubles(self.keeper.look())
        self._see_truth()
        text = self.watch.safety.state_text
        if not self.stages or self.stages[-1][1] != text:
            self.stages.append((time.monotonic(), text))

    def complaints(self) -> list[str]:
        """As nodes and supervisor tell them, and what the ground station read last."""
        told = [text for _, text in self.station.said[-4:]]
        return [*self.watch.complaints(), *self.watch.safety.block_reasons, *told]

    def again(self, what: str, seconds: float, order: Callable[[], Any],
              done: Callable[[], bool], pause: float = 1.0) -> None:  # fmt: skip
        """Give an order again and again until it is done."""
        due = -math.inf

        def ordered() -> bool:
            nonlocal due
            if done():
                return True
            if time.monotonic() >= due:
                due = time.monotonic() + pause
                order()
            return False

        self.must(what, seconds, ordered)

    def set(self, name: str, value: float) -> float:
        """A parameter of the autopilot, and it says that it has it; when it was sent."""
        sent: list[float] = []
        self.bench.parameters.pop(name, None)
        self.again(
            f"parameter {name}",
            10.0,
            lambda: sent.append(self.pilot.set(name, value)),
            lambda: name in self.bench.parameters,
        )
        return sent[-1]

    def get(self, name: str) -> float:
        """A parameter of the autopilot; NaN: it has none of this name."""
        self.bench.parameters.pop(name, None)
        end = time.monotonic() + 2.0
        while name not in self.bench.parameters and time.monotonic() < end:
            self.bench.request(name)
            self.until(0.5, lambda: name in self.bench.parameters)
        return self.bench.parameters.get(name, math.nan)

    def renew(self) -> bool:
        """Make it ready for another story on the ground; False: it needs a new life."""
        if self.autopilot.kind != ARDUCOPTER or self.height() > GROUND:
            return False  # PX4 lies as it fell, and stays terminated; ArduPlane climbs no more
        try:
            self.pilot.let_go()
            self.pilot.stop_flying()
            self.set("SIM_ENGINE_FAIL", 0)
            self.set("SIM_ENGINE_MUL", 1)
            self.again("disarmed", 5.0, lambda: self.pilot.disarm(True),
                       lambda: not self.station.armed())  # fmt: skip
            self.keeper.kill("parachute")
            self.start_parachute()
            self.rest(3.0)  # it is heard, and the estimators forget the impact
            self.again("reset", 10.0, self._ask_reset, lambda: self.stage(Stage.READY), 2.0)
        except ChuteError:
            return False
        return True

    def _ask_reset(self) -> None:
        self.ask(self.watch.reset, Trigger.Request())

    # -- what it is -----------------------------------------------------------------------------

    def version(self) -> str:
        """As the running autopilot says it."""
        number = dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION
        self.again(
            "the autopilot says its version",
            30.0,
            lambda: self.bench.command(dialect.MAV_CMD_REQUEST_MESSAGE, number),
            lambda: "AUTOPILOT_VERSION" in self.bench.newest,
        )
        return version_text(self.bench.newest["AUTOPILOT_VERSION"])

    def truth_ports(self) -> list[int]:
        """Of the router, those of the bench: the vehicle's devices hear nothing of them."""
        return [self.simulator.bench_port(), self.ports.bench_end]

    def stage(self, *stages: Stage) -> bool:
        """The supervisor says that it is in one of these."""
        return bool(self.watch.safety.state in stages)

    def height(self) -> float:
        """True one, m."""
        return self.truth.now.height

    # -- asking -----------------------------------------------------------------------------------

    def ask(self, client: Any, request: Any, seconds: float = 5.0) -> Any:
        """Call a service; its answer, or None within so long."""
        self.must(f"{client.srv_name} is offered", 20.0, lambda: ready(client))
        future = client.call_async(request)
        self.until(seconds, future.done)
        return future.result() if future.done() else None

    def arm_parachute(self) -> None:
        """safety/arm, as long as it is refused; StoryError if it stays so."""
        why = "no answer"
        for _ in range(10):
            answer = self.ask(self.watch.arm, Arm.Request(arm=True))
            if answer is not None and answer.success:
                return
            why = "no answer" if answer is None else answer.message
            self.rest(1.0)
        raise StoryError(f"safety/arm: {why}")

    def _signer(self, link: int) -> Signer | None:
        """Of one who speaks; None: nobody signs."""
        if not self.setup.signed:
            return None
        return Signer(_KEY, SigningClock(time.time() - time.monotonic()), link)

    def give_key(self) -> None:
        """The autopilot signs, and hears only what is signed."""
        key = list(_KEY)
        stamp = int((time.time() - EPOCH_2015) * UNITS_PER_SECOND)
        self.bench.send(dialect.MAVLink_setup_signing_message(1, 1, key, stamp))
        self.rest(0.5)

    def ask_kill(self, **fields: Any) -> tuple[float, Any]:
        """safety/kill: when it was called, and the future of its answer."""
        self.must("safety/kill is offered", 20.0, lambda: ready(self.kill))
        request = Kill.Request(reason="a person at the ground station", **fields)
        return time.monotonic(), self.kill.call_async(request)

    def ask_deploy(self) -> tuple[float, Any]:
        """safety/deploy, in the same way."""
        self.must("safety/deploy is offered", 20.0, lambda: ready(self.watch.deploy))
        request = Deploy.Request(force=False, reason="a person at the ground station")
        return time.monotonic(), self.watch.deploy.call_async(request)

    # -- processes --------------------------------------------------------------------------------

    def _start_router(self) -> None:
        ports, setup = self.ports, self.setup
        slow = setup.line_rate and self.autopilot.ardupilot
        stream = "t" if slow else ""
        line = f"{stream}{ports.line}"
        networks: list[tuple[object, ...]] = [(line, ports.node, ports.station)]
        if setup.wiring == FORWARDS:
            networks.append((ports.chute_line, ports.parachute))
        else:
            networks[0] += (ports.parachute,)
        networks.append((f"{stream}{self.simulator.bench_port()}", ports.bench_end))
        texts = [",".join(map(str, one)) for one in networks]
        self.keeper.start("router", "sitl.router", str(self.record), *texts)
        routes, end = self.keeper.children["router"].log, time.monotonic() + _ROUTES_WITHIN
        while "routing" not in routes.read_text():
            if time.monotonic() > end:
                raise StoryError(f"the router did not begin within {_ROUTES_WITHIN:g} s")
            self.watch.spin(0.05)

    def _start_processes(self) -> None:
        setup = self.setup
        values = {"connection": f"udpout:127.0.0.1:{self.ports.node}", **setup.node}
        if setup.signed:
            self._key.write_text(_KEY.hex())
            os.chmod(self._key, 0o600)
            values["signing_key_file"] = str(self._key)
        self.start_parachute()
        supervisor = dict(setup.supervisor)
        if setup.dronecan:
            values["expect_parachute"] = "false"
            supervisor |= _ON_THE_BUS
            self._start_node(CAN_NODE, {"connection": _BUS})
        self._start_node(NODE, values)
        self._start_node(SUPERVISOR, supervisor)

    def _start_node(self, name: str, values: Mapping[str, str]) -> None:
        self.keeper.start(name, module_of(name), *ros_arguments(NAMESPACE, **values))

    def start_parachute(self) -> None:
        """A parachute that is not released."""
        if self.setup.dronecan:
            ids = ("--controller-node-id", "0", "--trigger-node-id", "0")
            self.keeper.start(
                "parachute", "chute_ros.links.upf.simulator.sim_upf", "--connection", _BUS, *ids
            )
            return
        options = ["--connection", f"udpout:127.0.0.1:{self.ports.parachute}"]
        if self.setup.signed:
            options += ["--signing-key-file", str(self._key)]
        module = "chute_ros.links.mavlink.simulator.sim_mavlink_parachute"
        self.keeper.start("parachute", module, *options, *self.setup.parachute)

    def _see_truth(self) -> None:
        name = "HIL_STATE_QUATERNION" if self.autopilot.kind == PX4 else "SIM_STATE"
        at = self.bench.heard_at.get(name, 0.0)
        if at > self._truth_at:
            self._truth_at = at
            self.truth.take(at, name, self.bench.newest[name])
        elif (name == "SIM_STATE" and self.bench.newest
                and time.monotonic() - max(at, self._asked_at) > 1.0):  # fmt: skip
            self._asked_at = time.monotonic()
            self.bench.ask_for(dialect.MAVLINK_MSG_ID_SIM_STATE, _TRUTH_RATE)

    _asked_at = 0.0


_KEY = bytes(range(32))
_BUS = "mcast:0"
_ON_THE_BUS = {
    "required_links": f"[{NODE}, {CAN_NODE}]",
    "deploy_links": f"[{CAN_NODE}]",
    "deploy_ladder": f"['{CAN_NODE}', '{CAN_NODE}:trigger']",
}
