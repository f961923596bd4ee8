"""A ground station: a node that sees what an operator sees, and calls what an operator calls.

python -m faults.ground_station [--lifespan SECONDS] [--plain] NAMESPACE ...

One JSON object a line. In: {"call": TOKEN, "vehicle": .., "service": .., "fields": {..}},
{"give_up": TOKEN} (its client goes, as with Ctrl-C of `ros2 service call`), {"diagnostics": true},
{"topics": true}.
Out: what came, each with "at", the monotonic time, which all processes of a computer share.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import threading
import time
from functools import partial
from typing import Any

import rclpy
from chute_msgs.msg import ParachuteStatus, SafetyState
from chute_msgs.srv import Arm, Deploy, Kill, SetMode
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.client import Client
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future

from chute_ros.ros import qos
from chute_ros.ros.middleware import set_up_middleware

_SERVICES = {"arm": Arm, "deploy": Deploy, "kill": Kill, "set_mode": SetMode}
#: A parachute's status that comes after so long is told even if it says the same, s.
_GAP = 1.5


class GroundStation(Node):
    """lifespan: how long a call may wait for the network, s; 0: as ROS 2 has it, for ever."""

    def __init__(self, vehicles: list[str], lifespan: float) -> None:
        super().__init__("ground_station", start_parameter_services=False)
        #: As ROS 2 has it for services, but for the lifespan.
        self._profile = QoSProfile(depth=10)
        if lifespan:
            self._profile.lifespan = Duration(seconds=lifespan)
        self._clients_of: dict[tuple[str, str], Client] = {}
        self._asked: dict[int, tuple[str, str]] = {}
        self._parachutes: dict[str, tuple[bool, float]] = {}
        self._diagnostics: dict[str, DiagnosticStatus] = {}
        for vehicle in vehicles:
            self.create_subscription(
                SafetyState, f"{vehicle}/safety/state", partial(self._state, vehicle), qos.LATCHED
            )
            self.create_subscription(
                ParachuteStatus,
                f"{vehicle}/parachute/status",
                partial(self._parachute, vehicle),
                qos.STATUS,
            )
            for name in _SERVICES:
                self._open(vehicle, name)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._diagnose, qos.STATUS)

    def order(self, line: str) -> None:
        """A line of standard input."""
        order = json.loads(line)
        if "call" in order:
            self._call(order["call"], order["vehicle"], order["service"], order["fields"])
        elif "give_up" in order:
            vehicle, service = self._asked.pop(order["give_up"])
            self.destroy_client(self._clients_of[vehicle, service])
            self._open(vehicle, service)
        elif "topics" in order:
            _tell(topics=[name for name, _ in self.get_topic_names_and_types()])
        else:
            _tell(diagnostics={name: _said(one) for name, one in self._diagnostics.items()})

    def _open(self, vehicle: str, service: str) -> None:
        self._clients_of[vehicle, service] = self.create_client(
            _SERVICES[service], f"{vehicle}/safety/{service}", qos_profile=self._profile
        )

    def _call(self, token: int, vehicle: str, service: str, fields: dict[str, Any]) -> None:
        client = self._clients_of[vehicle, service]
        self._asked[token] = (vehicle, service)
        _tell(called=token, offered=client.service_is_ready())
        request = _SERVICES[service].Request(**fields)
        client.call_async(request).add_done_callback(partial(self._answered, token))

    def _answered(self, token: int, future: Future) -> None:
        if (answer := future.result()) is not None:
            _tell(answered=token, success=answer.success, message=answer.message)

    def _state(self, vehicle: str, message: SafetyState) -> None:
        links = dict(zip(message.links, map(int, message.link_states), strict=True))
        _tell(
            vehicle=vehicle,
            state=message.state,
            text=message.state_text,
            links=links,
            alarms=list(message.alarms),
        )

    def _parachute(self, vehicle: str, message: ParachuteStatus) -> None:
        now = time.monotonic()
        deployed, heard = self._parachutes.get(vehicle, (False, -math.inf))
        if message.deployed is not deployed or now > heard + _GAP:
            _tell(vehicle=vehicle, deployed=message.deployed, device=message.device)
        self._parachutes[vehicle] = (message.deployed, now)

    def _diagnose(self, message: DiagnosticArray) -> None:
        for status in message.status:
            before = self._diagnostics.get(status.name)
            self._diagnostics[status.name] = status
            if before is None or before.level != status.level:
                _tell(task=status.name, **_said(status))


def _said(status: DiagnosticStatus) -> dict[str, Any]:
    values = {value.key: value.value for value in status.values}
    return {"level": ord(status.level), "message": status.message, "values": values}


def _tell(**what: Any) -> None:
    print(json.dumps({"at": time.monotonic(), **what}), flush=True)


def _listen(executor: SingleThreadedExecutor, station: GroundStation) -> None:
    for line in sys.stdin:
        executor.create_task(station.order, line)
    # Whoever started it is gone, or wants it to go: it takes its leave of the others.
    rclpy.try_shutdown()


def main() -> None:
    """Until standard input ends."""
    options = argparse.ArgumentParser("faults.ground_station")
    options.add_argument("--lifespan", type=float, default=0.0)
    options.add_argument("--plain", action="store_true")
    options.add_argument("vehicles", nargs="+")
    chosen = options.parse_args()
    if not chosen.plain:
        set_up_middleware()
    # From here on it looks for the others.
    _tell(begun=True)
    rclpy.init(args=[])
    executor = SingleThreadedExecutor()
    station = GroundStation(chosen.vehicles, chosen.lifespan)
    executor.add_node(station)
    threading.Thread(target=_listen, args=(executor, station), daemon=True).start()
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # the usual ways to end a node
    finally:
        station.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
