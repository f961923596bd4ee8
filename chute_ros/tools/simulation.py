"""Runs one simulated vehicle with its nodes until Ctrl-C, for a person who plays with it.

Everything stays on this host. What can be done to the vehicle are the services sim/NAME in its
namespace; --do calls one of them from another terminal.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import re
import secrets
import shlex
import shutil
import signal
import socket
import sys
import tempfile
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import NoReturn

import rclpy
from std_srvs.srv import Trigger

from chute_ros.errors import ChuteError
from chute_ros.interrupts import CtrlC, in_one_piece
from chute_ros.links.api import SUPERVISOR, Sockets
from chute_ros.links.registered import module_of, vehicles
from chute_ros.plain_text import plain
from chute_ros.ros.middleware import RANGE, set_up_middleware
from chute_ros.ros.private_files import open_new
from chute_ros.sim.bench_actions import ACTIONS, actions_of
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.chute.surroundings import installed_middlewares, surroundings
from chute_ros.tools.demo_director import Director
from chute_ros.tools.isolation import free_udp_ports, stay_on_this_host
from chute_ros.tools.launch_checks import FlightArguments, check_vehicle
from chute_ros.tools.processes import Processes, ros_arguments
from chute_ros.tools.simulated_vehicle import (
    SimulatedVehicle,
    new_home,
    simulator_module,
    simulators_of,
)

#: What a rocket is, as simulation.launch.py names it.
ROCKET = "umbilical"
#: How long the supervisor may take until it is READY, s.
_READY_WITHIN = 60.0
#: How long a service may take to be offered, and to answer, s.
_DONE_WITHIN = 10.0
_PASSWORD = "password"
#: In what the nodes keep.
_BLACK_BOX = Path("chute_ros/black_box")
#: What the panel writes once it does.
_LISTENS = "panel at http"


class RunsAlreadyError(ChuteError):
    """A vehicle runs in this namespace."""


class NotDoneError(ChuteError):
    """An action was not done; the text says why."""


def main() -> None:
    """Run it; exit code 2 on a user's mistake, 1 if something ends by itself."""
    chosen = _options().parse_args()
    if chosen.vehicle == "rocket" and chosen.parachute:
        _refuse(
            f"--parachute {chosen.parachute} is of a drone, and a rocket has its own: leave it out"
        )
    stay_on_this_host()
    if mistake := surroundings(os.environ, installed_middlewares()).mistake():
        _refuse(mistake)
    if chosen.do:
        try:
            print(_done(chosen.namespace, chosen.do))
        except ChuteError as error:
            sys.exit(f"sim: {chosen.do}: {error}")
        return
    with tempfile.TemporaryDirectory(prefix="chute_ros_sim_") as scratch:
        processes = Processes(Path(scratch), new_home())
        # As a Ctrl-C does, of which the entry knows that it came.
        at_ctrl_c = signal.getsignal(signal.SIGINT)
        signal.signal(signal.SIGTERM, at_ctrl_c if isinstance(at_ctrl_c, CtrlC) else CtrlC())
        try:
            with (
                _alone(chosen.namespace),
                contextlib.closing(Director(chosen.namespace, processes)) as director,
            ):
                _start(processes, chosen, Path(scratch))
                _play(director, processes, chosen, Path(scratch))
        except ChuteError as error:
            sys.exit(f"sim: {error}")
        finally:
            # A second signal must leave none of them behind.
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, signal.SIG_IGN)
            processes.end()
            _tell_kept(processes.ros_home)


def _done(namespace: str, name: str) -> str:
    """What the action of this name of a vehicle that runs has done, in words. NotDoneError: it is
    not done."""
    set_up_middleware()
    rclpy.init(args=[])
    node = rclpy.create_node(f"sim_{secrets.token_hex(4)}", namespace=namespace)
    try:
        client = node.create_client(Trigger, f"sim/{name}")
        if not client.wait_for_service(_DONE_WITHIN):
            raise NotDoneError(
                f"{namespace}/sim/{name} is not offered within {_DONE_WITHIN:g} s: start a "
                "vehicle that has it (make sim) in the same ROS domain"
            )
        answer = client.call_async(Trigger.Request())
        with in_one_piece():
            rclpy.spin_until_future_complete(node, answer, timeout_sec=_DONE_WITHIN)
        if not answer.done():
            raise NotDoneError(f"no answer within {_DONE_WITHIN:g} s")
        if not answer.result().success:
            raise NotDoneError(answer.result().message)
        return str(answer.result().message)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _options() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser("sim", description=__doc__)
    options.add_argument(
        "--vehicle",
        choices=("drone", "rocket"),
        default="drone",
        help="a drone with an autopilot, or a rocket on its umbilical (default: drone)",
    )
    options.add_argument(
        "--parachute",
        choices=[name for name in vehicles() if name != ROCKET],
        help="parachute of the drone (default: mavlink)",
    )
    options.add_argument(
        "--namespace", type=_namespace, default="/sim", help="of the vehicle (default: /sim)"
    )
    options.add_argument("--no-panel", action="store_true", help="without the panel")
    options.add_argument("--port", type=_port, default=8080, help="of the panel (default: 8080)")
    options.add_argument(
        "--do",
        metavar="ACTION",
        choices=[one.name for one in ACTIONS],
        help="do this to a vehicle that runs already, and print what was done",
    )
    return options


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= 65535):
        raise argparse.ArgumentTypeError(f"port {text!r}: need a whole number from 1 to 65535")
    return int(text)


def _namespace(text: str) -> str:
    if not re.fullmatch(r"(/[A-Za-z_][A-Za-z0-9_]*)+", text):
        raise argparse.ArgumentTypeError(
            f"namespace {plain(text)[:80]!r}: need / and a name of letters, digits and _, for "
            "example /sim"
        )
    return text


def _environment() -> str:
    """What a shell needs to reach the vehicle, as a command."""
    around = {RANGE: "LOCALHOST"}
    if domain := os.environ.get("ROS_DOMAIN_ID"):
        around["ROS_DOMAIN_ID"] = domain
    command = "export " + " ".join(f"{name}={value}" for name, value in around.items())
    script = Path(os.environ.get("VIRTUAL_ENV", "")) / "env.sh"
    return f". {shlex.quote(str(script))}; {command}" if script.is_file() else command


@contextlib.contextmanager
def _alone(namespace: str) -> Iterator[None]:
    """RunsAlreadyError: another of these runs in this ROS domain and namespace, which this one
    would disturb. A name without a file, which ends with the process however that ends."""
    place = f"{os.environ.get('ROS_DOMAIN_ID', '')} {namespace}"
    name = sha256(place.encode()).hexdigest()[:32]
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as held:
        try:
            held.bind(f"\0chute_ros_sim_{name}")
        except OSError:
            raise RunsAlreadyError(
                f"a vehicle runs in {namespace} already: end it, or give this one another "
                "--namespace"
            ) from None
        yield


def _refuse(text: str) -> NoReturn:
    print(f"sim: {text}", file=sys.stderr)
    sys.exit(2)


def _tell_kept(home: Path) -> None:
    """Where the black box is; without one nothing of the run is kept."""
    box = home / _BLACK_BOX
    if any(box.glob("*")):
        print(f"\n  black box   {box}\n  see it with {_command('report')} {box}", flush=True)
    else:
        shutil.rmtree(home, ignore_errors=True)


def _command(name: str) -> str:
    """How a shell runs this tool."""
    return name if shutil.which(name) else f"python3 -m chute_ros.tools.{name}"


def _vehicle(chosen: argparse.Namespace) -> str:
    return ROCKET if chosen.vehicle == "rocket" else str(chosen.parachute or "mavlink")


def _start(processes: Processes, chosen: argparse.Namespace, folder: Path) -> None:
    """Start the nodes, the simulators, sim_bench and the panel."""
    network, air, bus = free_udp_ports(3)
    local = "127.0.0.1"
    sockets = Sockets(
        f"{local}:{network}", f"{local}:{air}", f"mcast:0:{bus}", f"{folder}/terminal"
    )
    vehicle = SimulatedVehicle(_vehicle(chosen), sockets, folder)
    for node, given in check_vehicle(vehicle.kind, vehicle.connections()).items():
        # JSON is YAML as well.
        told = {name: json.dumps(value) for name, value in given.items()}
        processes.start(node, module_of(node), *ros_arguments(chosen.namespace, **told))
    flight = FlightArguments().options(simulators_of(vehicle.name))
    for _, (simulator, *arguments) in vehicle.simulators():
        module = simulator_module(simulator)
        processes.start(simulator, module, *arguments, *flight.get(simulator, ()))
    bench = ros_arguments(chosen.namespace, vehicle=vehicle.name, folder=folder)
    processes.start("sim_bench", "chute_ros.tools.sim_bench", *bench)
    if not chosen.no_panel:
        panel = ros_arguments(
            "/",
            bench="true",
            port=chosen.port,
            allow_commands="true",
            password_file=_password_file(folder),
        )
        processes.start("panel", "chute_ros.tools.panel", *panel)


def _password_file(folder: Path) -> Path:
    """With a password of this run."""
    file = folder / _PASSWORD
    with os.fdopen(open_new(file), "w") as opened:
        opened.write(f"{secrets.token_urlsafe(9)}\n")
    return file


def _play(
    director: Director, processes: Processes, chosen: argparse.Namespace, folder: Path
) -> None:
    """Say how to play once the supervisor is READY, then tell what happens until the end."""
    director.say("sim", "starts the nodes and the simulators, on this host only")
    director.until("the supervisor is READY", _READY_WITHIN, director.stage(Stage.READY))
    director.say("supervisor", "READY: every required link is healthy")
    kind, namespace = _vehicle(chosen), chosen.namespace
    print(f"\n  nodes       {', '.join([*vehicles()[kind].links, SUPERVISOR, 'sim_bench'])}")
    print(f"  simulators  {', '.join(simulators_of(kind))}")
    print(f"  black box   {processes.ros_home / _BLACK_BOX} (stays)")
    if not chosen.no_panel:
        told = processes.log("panel")
        director.until("the panel listens", _READY_WITHIN, lambda: _LISTENS in told.read_text())
        print(f"  panel       http://127.0.0.1:{chosen.port}/vehicle{namespace}")
        print(f"  password    {(folder / _PASSWORD).read_text().strip()} (to give orders)")
    print(f"\n  what can be done, each a service {namespace}/sim/NAME:")
    actions = actions_of(simulators_of(kind))
    for one in actions:
        print(f"    {one.name:<24}{one.title}")
    print(f"\n  in another terminal:\n    {_environment()}")
    print(f"    {_command('chute')} --namespace {namespace} watch")
    for one in actions:
        if one.leaves_ground:
            print(f"    python3 -m chute_ros.tools.sim --namespace {namespace} --do {one.name}")
    print("\n  Ctrl-C ends it all.\n", flush=True)
    director.until("it goes on", math.inf, lambda: False)
