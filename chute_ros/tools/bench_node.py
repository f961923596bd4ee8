"""The node sim_bench: each action of a simulated vehicle is a service, sim/NAME."""

from __future__ import annotations

from functools import partial
from typing import Any

from chute_msgs.msg import SafetyState
from std_srvs.srv import Trigger

from chute_ros.links.registered import vehicles
from chute_ros.ros import qos
from chute_ros.ros.suite_node import SuiteNode
from chute_ros.settings import Parameter
from chute_ros.sim.bench_actions import BenchAction, actions_of
from chute_ros.sim.control import DONE, order
from chute_ros.tools.simulated_vehicle import control_path, simulators_of


def parameters() -> tuple[Parameter, ...]:
    """All parameters of the node."""
    return (
        Parameter(
            "vehicle",
            "mavlink",
            "the simulated vehicle, as parachute:= names it",
            choices=tuple(vehicles()),
        ),
        Parameter(
            "folder",
            "",
            "folder with the control sockets of the vehicle's simulators, each SIMULATOR.sock",
        ),
    )


class BenchNode(SuiteNode):
    """Passes each action on to the simulators of its vehicle."""

    def __init__(self, **options: Any) -> None:
        super().__init__("sim_bench", parameters(), **options)
        self._safety = SafetyState()
        self.create_subscription(SafetyState, "safety/state", self._see, qos.LATCHED)
        for action in actions_of(simulators_of(self.values["vehicle"])):
            self.create_service(Trigger, f"sim/{action.name}", partial(self._serve, action))

    def _see(self, message: SafetyState) -> None:
        self._safety = message

    def _serve(
        self, action: BenchAction, _: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        reasons = self._blocked() if action.leaves_ground else []
        if not reasons:
            reasons = self._order(action)
        response.success = not reasons
        response.message = "; ".join(reasons) or action.effect
        self.get_logger().info(f"{action.name}: {'; '.join(reasons) or 'done'}")
        return response

    def _blocked(self) -> list[str]:
        """Why the vehicle must not take off."""
        if not self._safety.flight_blocked:
            return []
        return [f"the supervisor blocks flight: {'; '.join(self._safety.block_reasons)}"]

    def _order(self, action: BenchAction) -> list[str]:
        """Tell each simulator. Returns why it was not done."""
        folder, reasons = self.values["folder"], []
        for simulator, what in action.orders:
            answer = order(control_path(folder, simulator), what)
            if answer != DONE:
                reasons.append(f"{simulator}: {answer}")
        return reasons
