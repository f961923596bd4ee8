"""One DroneCAN bus with a UPF parachute, seen from the vehicle: frames and time in, frames out.

The owner feeds what the transport receives into receive, calls update when next_deadline is due,
sends what take_output gives, and publishes what take_events gives. It knows no bus and no ROS.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Hashable

from chute_ros.errors import ParameterError
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import goals
from chute_ros.links.upf.protocol.bus_request_tracker import BusRequestTracker
from chute_ros.links.upf.protocol.bus_requests import BusRequest
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.protocol.deploying import Deploying
from chute_ros.links.upf.protocol.device_table import DeviceTable
from chute_ros.links.upf.protocol.devices import Controller
from chute_ros.links.upf.protocol.events import UpfEvent
from chute_ros.links.upf.protocol.vehicle_service import VehicleService
from chute_ros.links.upf.protocol.vehicle_status import VehicleStatusSender
from chute_ros.model import Armed, ParachuteState, TriggerFlags, VehicleState
from chute_ros.protocol.dronecan.bus_node import NODE_STATUS, BusNode
from chute_ros.protocol.dronecan.calls import Call, ServiceCalls
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.protocol.dronecan.endpoint import ReceivedTransfer
from chute_ros.protocol.dronecan.transfer import TransferKind
from chute_ros.protocol.events import RequestFinished, RequestReport, Severity
from chute_ros.protocol.goal import EffectFinished
from chute_ros.protocol.requests import Requests


class UpfLink:
    """Follows our parachute and carries requests through to it, and its own to the supervisor."""

    def __init__(self, config: UpfConfig, types: DataTypes) -> None:
        self.config = config
        self.definitions = Definitions(types)
        self.bus = BusNode(types, config.bus())
        self.devices = DeviceTable(config, self.definitions)
        self.vehicle_service = VehicleService(config, self.definitions)
        read = goals.read_answer(self.definitions, self._deploy_answered)
        calls = ServiceCalls(config.calls, read)
        self.requests: Requests[ServiceCalls] = Requests(calls, config.effect)
        endpoint = self.bus.endpoint
        self._vehicle = VehicleStatusSender(config, self.devices, endpoint)
        self._deploying = Deploying(
            config, self.devices, self.requests, endpoint, self._vehicle, self.vehicle_service
        )
        self._desk = BusRequestTracker(
            self.bus, self.devices, self._vehicle.in_air, config.status_timeout
        )
        #: Our own requests to take off count down from -1; once one has succeeded, the request
        #: with this token arms this controller.
        self._next_takeoff = -1
        self._arm_after: dict[int, tuple[int, int]] = {}
        self._events: list[UpfEvent] = []
        for absent in self.definitions.absent:
            self.devices.notice(
                Severity.WARNING, f"the data types have no {absent}: it reads as not known"
            )

    # -- wire side ---------------------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        """The sixteen bytes of one frame came (see protocol/dronecan/can_frame.py)."""
        heard = self.bus.receive(data, now)
        if heard is not None:
            self._heard(heard, now)
            self.requests.effects_may_show(now)
        self._drive(now)

    def stream_ended(self, stream: Hashable) -> None:
        """The bus was closed; a transfer that was cut short times out by itself."""

    def update(self, now: float) -> None:
        """Look at the clock: limits, retries, what we send by ourselves."""
        self.bus.update(now)
        for node_id in self.bus.nodes.take_replaced():
            self.devices.replaced(node_id, now)
        self.devices.doubled = frozenset(self.bus.nodes.conflicts(now))
        self.devices.update(now)
        self.vehicle_service.update(now)
        self.requests.update(now)
        self._vehicle.update(now)
        self._pursue_deploys(now)

    def next_deadline(self) -> float:
        """When update has something to do."""
        return min(
            part.next_deadline()
            for part in (
                self.bus,
                self.devices,
                self.vehicle_service,
                self.requests,
                self._deploying,
                self._vehicle,
                self._desk,
            )
        )

    def take_output(self) -> list[bytes]:
        """Frames to send, oldest first; each is handed out once."""
        return self.bus.take_output()

    def take_events(self) -> list[UpfEvent]:
        """New events, oldest first; each is handed out once."""
        events: list[UpfEvent] = [*self._events, *self.bus.take_events()]
        events += self.devices.take_events()
        events += self.vehicle_service.take_asks()
        events += self._desk.take_finished()
        self._events = []
        return events

    # -- what the vehicle says -----------------------------------------------------------------

    def owner_alive(self, until: float) -> None:
        """We may seem alive until this time: a hung owner must look dead from outside."""
        self._vehicle.owner_alive(until)
        self.bus.owner_alive(until)

    def vehicle(self, state: VehicleState, now: float) -> None:
        """A vehicle/state came."""
        self._vehicle.take(state, now)
        if state.armed is Armed.ARMED:
            self.vehicle_service.motors_may_turn(now - state.armed_age)

    def kill_confirmed(self, now: float) -> None:
        """Another link's kill was confirmed: the motors are off."""
        self.vehicle_service.kill_confirmed(now)
        self._drive(now)

    def kill_waited_for(self, now: float) -> None:
        """A deploy was decided: its kill has had its time."""
        self.vehicle_service.kill_waited_for(now)
        self._drive(now)

    def supervisor_said(self, blocked: bool, standing: Collection[str], now: float) -> None:
        """Flight is blocked or not, and the devices of this link whose block is known."""
        self.vehicle_service.supervisor_said(blocked, standing, now)
        self._drive(now)

    def table_kept(self, number: int, now: float) -> None:
        """The allocation table of this KeepTable is safe on the disk."""
        self.bus.table_kept(number)

    def in_air(self, now: float) -> bool:
        """By the vehicle or by the controller: what takes protection away is refused then."""
        return self._vehicle.in_air(now)

    # -- what the node asks for: every request ends in one RequestFinished with its token ------

    def arm(self, token: int, arm: bool, triggers: int, now: float) -> None:
        """Arm (take-off first, where needed) or disarm. triggers: a UPF has none to choose."""
        if triggers not in (0, TriggerFlags.FC):
            why = f"triggers {triggers}: a UPF parachute has none to choose, need 0"
            self.requests.refuse(token, f"{why}; nothing was sent")
            self._drive(now)
            return
        controller = self._target(token, 0, now)
        if controller is None:
            return
        on_ground = controller.state is ParachuteState.READY
        if not arm:
            self.service(token, "TYPE_DISARM", 0, now)
        elif on_ground and not goals.excluded(controller, "TYPE_ARM"):
            takeoff, self._next_takeoff = self._next_takeoff, self._next_takeoff - 1
            self._arm_after[takeoff] = (token, controller.node_id)
            self.service(takeoff, "TYPE_TAKEOFF", controller.node_id, now)
        else:
            self.service(token, "TYPE_ARM", controller.node_id, now)

    def service(self, token: int, type_name: str, node_id: int, now: float) -> None:
        """A request of ParachuteService, by its TYPE_ name."""
        if type_name not in goals.REQUESTS:
            known = ", ".join(goals.REQUESTS)
            raise ParameterError(f"the request is {type_name!r}: need one of {known}")
        if type_name.startswith(goals.DEPLOY_PREFIX):
            self.deploy(token, type_name.endswith("FORCE"), now, node_id)
            return
        controller = self._target(token, node_id, now)
        if controller is None:
            return
        superseded = self._supersede(controller, type_name, now)
        goal = goals.request(controller, self.definitions, type_name, now, superseded)
        shown = goal.shown is not None and goal.shown()
        why = "" if shown else goals.excluded(controller, type_name)
        if goal.hinders_release and self.requests.under_way(goals.DEPLOY):
            why = "a deploy is under way; nothing may make a parachute less ready"
        if why:
            self.requests.refuse(token, f"{why}; nothing was sent")
        else:
            self.requests.begin(token, goal, now)
        self._drive(now)

    def _supersede(self, controller: Controller, type_name: str, now: float) -> bool:
        """End what is under way and wants the opposite; whether there was any."""
        opposite = goals.OPPOSITE[type_name]

        def ends(goal: goals.UpfGoal) -> bool:
            return goal.name in opposite and goal.commands[0].server == controller.node_id

        found = self.requests.abandon_where(ends, f"{type_name} was ordered", now)
        if found:
            self._drive(now)
        return found

    def deploy(self, token: int, force: bool, now: float, node_id: int = 0) -> None:
        """Deploy through the controller; if it does not answer, or there is none, the trigger."""
        self._deploying.deploy(token, force, node_id, now)
        self._pursue_deploys(now)

    def fire_triggers(self, token: int, now: float) -> None:
        """Fire the triggers directly, whatever the controller does: the end of a ladder."""
        self._deploying.fire_triggers(token, now)
        self._pursue_deploys(now)

    def bus_request(
        self, token: int, node_id: int, make: Callable[[int], BusRequest], now: float
    ) -> None:
        """Ask something of a device: ends in one BusRequestFinished. node_id 0: the chosen one."""
        self._desk.bus_request(token, node_id, make, now)
        self._drive(now)

    def set_parameter(
        self, token: int, node_id: int, name: str, text: str, force: bool, now: float
    ) -> None:
        """Set one and read it back; in the air it needs force."""
        self._desk.set_parameter(token, node_id, name, text, force, now)
        self._drive(now)

    def disturb(
        self, token: int, node_id: int, force: bool, make: Callable[[int], BusRequest], now: float
    ) -> None:
        """The same for what takes the device away for a while: in the air it needs force."""
        self._desk.disturb(token, node_id, force, make, now)
        self._drive(now)

    def has_parachute(self) -> bool:
        """A device that can deploy was received."""
        return bool(self.devices.controllers or self.devices.triggers)

    # -- what the node may look at -------------------------------------------------------------

    @property
    def counts(self) -> Counter[str]:
        """Why something was dropped -> how often."""
        counts = self.bus.counts + self.requests.commands.counts + self.vehicle_service.counts
        return counts + self.devices.counts

    # -- inside ----------------------------------------------------------------------------------

    def _heard(self, heard: ReceivedTransfer, now: float) -> None:
        if heard.kind is TransferKind.RESPONSE:
            self.requests.commands.response(
                heard.source, heard.name, heard.transfer_id, heard.values, now
            )
        elif heard.kind is TransferKind.REQUEST:
            if heard.name == names.VEHICLE_SERVICE:
                self.vehicle_service.request(heard, now)
            else:
                self.bus.endpoint.counts["requests that this node does not serve"] += 1
        elif heard.name == names.PARACHUTE_STATUS:
            self.devices.parachute_status(heard.source, heard.values, now)
            controller = self.devices.controllers.get(heard.source)
            if controller is not None:
                self.vehicle_service.state(controller.device, controller.state, now)
        elif heard.name == names.TRIGGER_STATUS:
            ordered = self.requests.under_way(goals.DEPLOY)
            self.devices.trigger_status(heard.source, heard.values, now, ordered)
        elif heard.name == NODE_STATUS:
            for node_id in self.bus.nodes.take_restarted():
                self.devices.restarted(node_id)
                self._deploying.restarted(node_id, now)
            self.devices.node_status(heard.source, heard.values, now)

    def _target(self, token: int, node_id: int, now: float) -> Controller | None:
        """The controller meant; None, and the request refused, if there is none."""
        controller = self.devices.controller(node_id)
        if controller is None:
            self.requests.refuse(token, self.devices.no_controller(node_id))
            self._drive(now)
        return controller

    def _deploy_answered(self, call: Call, accepted: bool) -> None:
        self._deploying.answered(call, accepted)

    def _pursue_deploys(self, now: float) -> None:
        # What ends now must not be pursued any more.
        self._drive(now)
        if self._deploying.update(now):
            self._drive(now)

    def _drive(self, now: float) -> None:
        for send in self.requests.drive(now):
            call = send.command
            self.bus.endpoint.request(
                call.server, call.service, send.transfer_id, call.values, call.priority
            )
        for response in self.vehicle_service.take_responses():
            values = self.definitions.result(names.VEHICLE_SERVICE, response.result)
            self.bus.endpoint.respond(response.request, values, goals.FIRE_PRIORITY)
        self._desk.update(now)
        self._events += self._deploying.take_reports()
        for event in self.requests.take_events():
            if isinstance(event, RequestFinished):
                self._over(self._deploying.over(event.finished, now), now)
            elif not (isinstance(event, RequestReport) and event.report.token in self._arm_after):
                self._events.append(event)

    def _over(self, finished: EffectFinished, now: float) -> None:
        """The end of a request: of our own take-off it is followed by what it is for."""
        token, node_id = self._arm_after.pop(finished.token, (0, 0))
        if not node_id:
            self._events.append(RequestFinished(finished))
        elif finished.success:
            self.service(token, "TYPE_ARM", node_id, now)
        else:
            self.requests.refuse(token, finished.message)
            self._drive(now)
