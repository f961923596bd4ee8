"""A vehicle inside its enclaves, attacked from outside and from the wrong enclave.

Run by hand where the middleware supports SROS 2; docs/guide/security.md has the command and what
it printed. Arguments: keystores that attackers bring, each with an enclave /console that allows
what they do. Exit code 0: nobody but the true console fired anything, and that did.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import rclpy
from chute_msgs.msg import ParachuteStatus, SafetyDecision, SafetyState
from chute_msgs.srv import Deploy
from rclpy.node import Node
from rclpy.parameter import Parameter

from chute_ros.links.registered import module_of
from chute_ros.model import Action
from chute_ros.ros import qos
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.tools.processes import Processes

SECURITY = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}
#: Who attacks: enclave -> what it is. Empty: a participant without a key.
ATTACKERS = {
    "": "without a key",
    "/recorder": "with the recorder's key",
    "/console": "with the console's key",
    "/mavlink_parachute": "with a device node's key",
}
PATIENCE = 40.0
#: What offers no services of its own.
QUIET: dict[str, Any] = {
    "start_parameter_services": False,
    "parameter_overrides": [Parameter("start_type_description_service", value=False)],
}


def attack(enclave: str, calls: bool) -> dict[str, object]:
    """Try to decide a deploy, and to call for one past the supervisor."""
    rclpy.init(args=["--ros-args", "--enclave", enclave] if enclave else [])
    node = Node("attacker", **QUIET)
    found: dict[str, object] = {"decisions heard by": 0, "deploy answered": False}
    try:
        publisher = node.create_publisher(SafetyDecision, "safety/decision", qos.DECISION)
        for number in range(50):
            message = SafetyDecision(
                action=int(Action.DEPLOY),
                epoch=int(time.time()) + 1000,
                id=number + 1,
                targets=["mavlink_parachute"],
                rule="forged",
            )
            message.header.stamp = node.get_clock().now().to_msg()
            publisher.publish(message)
            rclpy.spin_once(node, timeout_sec=0.1)
            found["decisions heard by"] = max(
                int(str(found["decisions heard by"])), publisher.get_subscription_count()
            )
    except Exception as error:  # noqa: BLE001 - how the middleware refuses is its own affair
        found["decisions heard by"] = f"refused: {str(error).splitlines()[0][:60]}"
    if calls:
        try:
            client = node.create_client(Deploy, "mavlink_parachute/deploy")
            if client.wait_for_service(3.0):
                request = Deploy.Request(force=True, reason="forged")
                answer = client.call_async(request)
                rclpy.spin_until_future_complete(node, answer, timeout_sec=5.0)
                found["deploy answered"] = answer.done()
        except Exception as error:  # noqa: BLE001
            found["deploy answered"] = f"refused: {str(error).splitlines()[0][:60]}"
    return found


class Console(Node):
    """The operator, who sees and may ask."""

    def __init__(self) -> None:
        # As `ros2 service call`, whose node offers services of its own parameters.
        super().__init__("_ros2cli_requester_console")
        self.stage, self.deployed = -1, False
        self.create_subscription(SafetyState, "safety/state", self._state, qos.LATCHED)
        self.create_subscription(ParachuteStatus, "parachute/status", self._status, qos.STATUS)

    def _state(self, message: SafetyState) -> None:
        self.stage = message.state

    def _status(self, message: ParachuteStatus) -> None:
        self.deployed = message.deployed

    def until(self, condition, what: str) -> None:
        end = time.monotonic() + PATIENCE
        while not condition():
            rclpy.spin_once(self, timeout_sec=0.1)
            if time.monotonic() > end:
                raise TimeoutError(f"not within {PATIENCE:g} s: {what}")

    def call(self, kind, name: str, **fields):
        client = self.create_client(kind, name)
        self.until(client.service_is_ready, f"{name} is offered")
        answer = client.call_async(kind.Request(**fields))
        self.until(answer.done, f"{name} answers")
        return answer.result()


def start_vehicle(processes: Processes) -> None:
    """Simulators, and the nodes inside their enclaves."""
    port, air = free_udp_ports(2)
    network = ("--connection", f"udpout:127.0.0.1:{port}", "--connection")
    processes.start("autopilot", "chute_ros.sim.sim_autopilot", *network, f"udpin:127.0.0.1:{air}")
    processes.start(
        "module",
        "chute_ros.links.mavlink.simulator.sim_mavlink_parachute",
        *network,
        f"udpout:127.0.0.1:{air}",
        "--ground-cleared",
        "yes",
    )
    for name, settings in (
        ("mavlink_parachute", (f"connection:=udpin:127.0.0.1:{port}",)),
        ("safety_supervisor", ("profile:=by_hand",)),
    ):
        options = [part for one in settings for part in ("-p", one)]
        processes.start(name, module_of(name), "--ros-args", "--enclave", f"/{name}", *options)


def attacked_by(enclave: str, keystore: str = "") -> dict[str, object]:
    """What an attacker in a process of its own found. keystore: its own one."""
    environment = {key: value for key, value in os.environ.items() if key not in SECURITY}
    environment |= SECURITY if enclave else {}
    environment |= {"ROS_SECURITY_KEYSTORE": keystore} if keystore else {}
    # The true console may call.
    calls = enclave != "/console" or keystore
    done = subprocess.run(
        [sys.executable, __file__, "--as", enclave, *(["calls"] if calls else [])],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
        env=environment,
    )
    for line in done.stdout.splitlines():
        if line.startswith("{"):
            return json.loads(line)
    lines = (done.stderr.strip() or "no word").splitlines()
    return {"decisions heard by": f"ended with code {done.returncode}: {lines[-1][:60]}"}


def session() -> int:
    """Attack by each, then the console's own deploy."""
    os.environ.update(SECURITY)
    rclpy.init(args=["--ros-args", "--enclave", "/console"])
    fired = False
    with tempfile.TemporaryDirectory() as folder:
        processes, console = Processes(Path(folder)), Console()
        try:
            start_vehicle(processes)
            console.until(lambda: console.stage == SafetyState.READY, "the vehicle is ready")
            print("the vehicle is READY inside its enclaves")
            attackers = [(who, enclave, "") for enclave, who in ATTACKERS.items()]
            attackers += [(f"with {one}", "/console", one) for one in sys.argv[1:]]
            for who, enclave, keystore in attackers:
                found = attacked_by(enclave, keystore)
                end = time.monotonic() + 1.0
                while time.monotonic() < end:
                    rclpy.spin_once(console, timeout_sec=0.1)
                fired = fired or console.deployed
                print(f"{who}: {found}; deployed: {console.deployed}")
            deploy = console.call(Deploy, "safety/deploy", force=True, reason="a test")
            print(f"the console deploys: {deploy.success} {deploy.message}")
            console.until(lambda: console.deployed, "the parachute is out")
            processes.check()
        except (TimeoutError, KeyError):
            for name in processes.names():
                print(processes.tail(name, 30))
            raise
        finally:
            processes.end()
    return 1 if fired or not deploy.success else 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["--as"]:
        print(json.dumps(attack(sys.argv[2], "calls" in sys.argv)))
        sys.stdout.flush()
        os._exit(0)
    sys.exit(session())
