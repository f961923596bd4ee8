"""One DroneCAN bus with a UPF parachute, seen from the vehicle: frames and time in, frames out.

The owner feeds what the transport receives into receive, calls update when next_deadline is due,
sends what take_output gives, and publishes what take_events gives. It knows no bus and no ROS.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Hashable

from chute_ros.errors import MessageError
from chute_ros.model import Armed, LandedState, Outcome, ParachuteState, VehicleState
from chute_ros.protocol.dronecan.bus_node import NODE_STATUS, BusNode, BusNodeConfig
from chute_ros.protocol.dronecan.calls import ServiceCalls
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.protocol.dronecan.endpoint import Heard
from chute_ros.protocol.dronecan.transfer import Kind
from chute_ros.protocol.effect import Report
from chute_ros.protocol.events import RequestFinished, RequestReport, Severity
from chute_ros.protocol.requests import Requests
from chute_ros.protocol.upf import definitions as names
from chute_ros.protocol.upf import errands, goals
from chute_ros.protocol.upf import parameters as p
from chute_ros.protocol.upf.config import CONTROLLER_NODE_ID, TRIGGER_NODE_ID, UpfConfig
from chute_ros.protocol.upf.definitions import Definitions
from chute_ros.protocol.upf.devices import Controller
from chute_ros.protocol.upf.errands import Errand, ErrandDone
from chute_ros.protocol.upf.events import ErrandFinished, UpfEvent
from chute_ros.protocol.upf.last_resort import LastResort
from chute_ros.protocol.upf.roster import UpfDevices
from chute_ros.protocol.upf.vehicle_service import VehicleService
from chute_ros.protocol.upf.vehicle_status import vehicle_status

_FLYING = (ParachuteState.TAKEOFF, ParachuteState.ARMED)


class UpfLink:
    """Follows our parachute and carries requests through to it, and its own to the supervisor."""

    def __init__(self, config: UpfConfig, types: DataTypes) -> None:
        self.config = config
        self.definitions = Definitions(types)
        self.bus = BusNode(types, _bus_config(config))
        self.devices = UpfDevices(config, self.definitions)
        self.vehicle_service = VehicleService(config, self.definitions)
        calls = ServiceCalls(config.calls, goals.read_answer(self.definitions))
        self.requests: Requests[ServiceCalls] = Requests(calls, config.effect)
        self._last_resort = LastResort(config.effect.retry_interval)
        #: Our own requests count down from -1; what follows once such a one has succeeded.
        self._next_internal = -1
        self._then: dict[int, tuple[int, Callable[[float], None]]] = {}
        self._vehicle, self._vehicle_received = VehicleState(), -math.inf
        self._vehicle_status_at = -math.inf
        self._owner_until = -math.inf
        self._unsendable = False
        self._errands: list[ErrandFinished] = []
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
        self.devices.update(now)
        self.vehicle_service.update(now)
        self.requests.update(now)
        if self._vehicle_status_at <= now < self._owner_until:
            self._vehicle_status_at = now + self.config.vehicle_status_interval
            self._tell_vehicle(now)
        self._fire_triggers_if_due(now)
        self._drive(now)

    def next_deadline(self) -> float:
        """When update has something to do."""
        parts = (self.bus, self.devices, self.vehicle_service, self.requests, self._last_resort)
        deadlines = [part.next_deadline() for part in parts]
        if self._vehicle_status_at < self._owner_until:
            deadlines.append(self._vehicle_status_at)
        return min(deadlines)

    def take_output(self) -> list[bytes]:
        """Frames to send, oldest first; each is handed out once."""
        return self.bus.take_output()

    def take_events(self) -> list[UpfEvent]:
        """What happened, oldest first; each is handed out once."""
        events: list[UpfEvent] = [*self._events, *self.bus.take_events()]
        events += self.devices.take_events()
        events += self.vehicle_service.take_asks()
        events += self._errands
        self._events, self._errands = [], []
        return events

    # -- what the vehicle says -----------------------------------------------------------------

    def owner_alive(self, until: float) -> None:
        """We may seem alive until this time: a hung owner must look dead from outside."""
        self._owner_until = until
        self.bus.owner_alive(until)

    def vehicle(self, state: VehicleState, now: float) -> None:
        """A vehicle/state came."""
        self._vehicle, self._vehicle_received = state, now
        if state.armed is Armed.ARMED:
            self.vehicle_service.motors_may_turn(now - state.armed_age)

    def kill_confirmed(self, now: float) -> None:
        """Another link's kill was confirmed: the motors are off."""
        self.vehicle_service.kill_confirmed(now)
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
        vehicle, passed = self._vehicle, now - self._vehicle_received
        limit = self.config.vehicle_state_age
        landed = vehicle.landed_state not in (LandedState.UNKNOWN, LandedState.ON_GROUND)
        if landed and vehicle.landed_state_age + passed <= limit:
            return True
        if vehicle.armed is Armed.ARMED and vehicle.armed_age + passed <= limit:
            return True
        return any(one.alive and one.state in _FLYING for one in self.devices.controllers.values())

    # -- what the node asks for: every request ends in one RequestFinished with its token ------

    def arm(self, token: int, arm: bool, triggers: int, now: float) -> None:
        """Arm (take-off first, where needed) or disarm. triggers: a UPF has none to choose."""
        controller = self._target(token, 0)
        if controller is None:
            return
        if not arm:
            self.service(token, "TYPE_DISARM", 0, now)
        elif controller.state is ParachuteState.READY and not self._excluded(
            controller, "TYPE_ARM"
        ):
            internal, self._next_internal = self._next_internal, self._next_internal - 1

            def then(later: float) -> None:
                self.service(token, "TYPE_ARM", controller.node_id, later)

            self._then[internal] = (token, then)
            self.service(internal, "TYPE_TAKEOFF", controller.node_id, now)
        else:
            self.service(token, "TYPE_ARM", controller.node_id, now)

    def service(self, token: int, type_name: str, node_id: int, now: float) -> None:
        """A request of ParachuteService, by its TYPE_ name."""
        if type_name.startswith("TYPE_DEPLOY"):
            self.deploy(token, type_name.endswith("FORCE"), now, node_id)
            return
        controller = self._target(token, node_id)
        if controller is None:
            return
        goal = goals.request(controller, self.definitions, type_name, now)
        why = (
            ""
            if goal.shown is not None and goal.shown()
            else self._excluded(controller, type_name)
        )
        if goal.hinders_release and self.requests.under_way(goals.DEPLOY):
            why = "a deploy is under way; nothing may make a parachute less ready"
        if why:
            self.requests.refuse(token, f"{why}; nothing was sent")
        else:
            self.requests.begin(token, goal, now)
        self._drive(now)

    def deploy(self, token: int, force: bool, now: float, node_id: int = 0) -> None:
        """Deploy through the controller; if it does not answer, or there is none, the trigger."""
        controller = self.devices.controller(node_id)
        trigger = self.devices.trigger()
        if controller is not None:
            self.requests.make_way_for_release(now)
            goal = goals.deploy(
                controller, self.devices.alive_triggers, self.definitions, force, now
            )
            self.requests.begin(token, goal, now)
            if self.config.last_resort:
                wait = self.config.last_resort_after if controller.alive else 0.0
                self._last_resort.watch(token, now + wait)
        elif trigger is not None and not node_id:
            self.requests.begin(token, goals.fire_trigger(trigger, self.definitions, now), now)
            self._launch_broadcast()
        else:
            self._target(token, node_id)
        self._drive(now)
        self._fire_triggers_if_due(now)

    def errand(self, token: int, node_id: int, make: Callable[[int], Errand], now: float) -> None:
        """Ask something of a device: ends in one ErrandFinished. node_id 0: the chosen one."""
        device = self.devices.controller() or self.devices.trigger()
        target = node_id or (device.node_id if device is not None else 0)
        if not 1 <= target <= 127:
            why = "no UPF device was heard on this link; name a node id"
            self._errands.append(ErrandFinished(token, ErrandDone(False, why, 0)))
            return
        self.bus.begin(token, make(target), now)
        self._drive(now)

    def set_parameter(
        self, token: int, node_id: int, name: str, text: str, force: bool, now: float
    ) -> None:
        """Set one and read it back; what takes protection away is refused in the air."""
        off = text.strip().lower() in ("false", "off", "no", "0")
        if name in p.PROTECTION and off:
            if self.in_air(now) and not force:
                why = (
                    f"{name} would be off while the vehicle is in the air, and with it the "
                    "protection; force does it all the same; nothing was sent"
                )
                self._errands.append(ErrandFinished(token, ErrandDone(False, why, node_id)))
                return
            self.devices.notice(Severity.WARNING, f"{name} is being switched off")
        self.errand(token, node_id, lambda one: errands.set_parameter(one, name, text), now)

    def disturb(
        self, token: int, node_id: int, force: bool, make: Callable[[int], Errand], now: float
    ) -> None:
        """An errand that takes the device away for a while: refused in the air unless forced."""
        if self.in_air(now) and not force:
            why = "refused while the vehicle is in the air; force does it all the same"
            self._errands.append(ErrandFinished(token, ErrandDone(False, why, node_id)))
        else:
            self.errand(token, node_id, make, now)

    # -- what the node may look at -------------------------------------------------------------

    @property
    def counts(self) -> Counter[str]:
        """Why something was dropped -> how often."""
        return self.bus.counts + self.requests.commands.counts + self.vehicle_service.counts

    # -- inside ----------------------------------------------------------------------------------

    def _heard(self, heard: Heard, now: float) -> None:
        if heard.kind is Kind.RESPONSE:
            self.requests.commands.response(
                heard.source, heard.name, heard.transfer_id, heard.values, now
            )
        elif heard.kind is Kind.REQUEST:
            if heard.name == names.VEHICLE_SERVICE:
                self.vehicle_service.request(heard, now)
            else:
                self.bus.endpoint.counts["requests that we do not serve"] += 1
        elif heard.name == names.PARACHUTE_STATUS:
            self.devices.parachute_status(heard.source, heard.values, now)
            controller = self.devices.controllers.get(heard.source)
            if controller is not None:
                self.vehicle_service.state(controller.device, controller.state, now)
        elif heard.name == names.TRIGGER_STATUS:
            self.devices.trigger_status(heard.source, heard.values, now)
        elif heard.name == NODE_STATUS:
            for node_id in self.bus.nodes.take_restarted():
                self.devices.restarted(node_id)
                self.devices.notice(Severity.ERROR, f"node {node_id} restarted")
            self.devices.node_status(heard.source, heard.values, now)

    def _target(self, token: int, node_id: int) -> Controller | None:
        """The controller meant; None, and the request refused, if there is none."""
        controller = self.devices.controller(node_id)
        if controller is None:
            known = ", ".join(map(str, self.devices.controllers)) or "none"
            what = f"no controller {node_id}" if node_id else "no controller"
            triggers = ", ".join(map(str, self.devices.triggers))
            beside = f"; triggers heard: {triggers}" if triggers else ""
            why = f"{what} was heard on this link (heard: {known}{beside})"
            self.requests.refuse(token, why)
        return controller

    def _excluded(self, controller: Controller, type_name: str) -> str:
        return goals.excluded(controller, type_name)

    def _fire_triggers_if_due(self, now: float) -> None:
        begun, fire = self._last_resort.update(now)
        for token in begun:
            text = "the controller does not answer: firing the triggers directly"
            self.devices.notice(Severity.ERROR, text)
            self._events.append(RequestReport(Report(token, Outcome.SENT, text)))
        if fire:
            for trigger in self.devices.triggers.values():
                self.requests.commands.send_once(
                    goals.trigger_call(trigger, self.definitions), now
                )
            self._launch_broadcast()
            self._drive(now)

    def _launch_broadcast(self) -> None:
        constants = self.definitions.types.message(names.TRIGGER_LAUNCH).constants
        values = {"magic_number": constants[names.MAGIC]}
        self.bus.endpoint.broadcast(names.TRIGGER_LAUNCH, values, goals.FIRE_PRIORITY)

    def _tell_vehicle(self, now: float) -> None:
        connected = any(one.alive for one in self.devices.controllers.values())
        age = self.config.vehicle_state_age
        values = vehicle_status(
            self.definitions, self._vehicle, self._vehicle_received, age, connected, now
        )
        try:
            self.bus.endpoint.broadcast(names.VEHICLE_STATUS, values)
        except MessageError as error:
            # The vendor's field has no way to say "not known": then nothing is said at all.
            if not self._unsendable:
                self._unsendable = True
                self.devices.notice(Severity.WARNING, f"VehicleStatus is not sent: {error}")

    def _drive(self, now: float) -> None:
        for send in self.requests.drive(now):
            call = send.command
            self.bus.endpoint.request(
                call.server, call.service, send.transfer_id, call.values, call.priority
            )
        for response in self.vehicle_service.take_responses():
            values = self.definitions.result(names.VEHICLE_SERVICE, response.result)
            self.bus.endpoint.respond(response.request, values, goals.FIRE_PRIORITY)
        for controller in self.devices.to_read:
            token = ("parameters", controller.node_id)
            self.bus.begin(token, errands.list_parameters(controller.node_id), now)
        self.devices.to_read.clear()
        self._end_errands()
        for event in self.requests.take_events():
            self._pass_on(event, now)

    def _end_errands(self) -> None:
        for token, done in self.bus.take_ended():
            assert isinstance(done, ErrandDone)
            controller = self.devices.controllers.get(done.node_id)
            if controller is not None:
                controller.parameters |= {one.name: one.value for one in done.parameters}
            if isinstance(token, int):
                self._errands.append(ErrandFinished(token, done))

    def _pass_on(self, event: object, now: float) -> None:
        """Events of requests: those of ours stay inside and start what follows."""
        if isinstance(event, RequestReport):
            if event.report.outcome is not Outcome.SENT:
                self._last_resort.over(event.report.token)
            if event.report.token in self._then:
                return
            self._events.append(event)
        elif isinstance(event, RequestFinished):
            finished = event.finished
            self._last_resort.over(finished.token)
            if finished.token not in self._then:
                self._events.append(event)
                return
            token, then = self._then.pop(finished.token)
            if finished.success:
                then(now)
            else:
                self.requests.refuse(token, finished.message)
                self._drive(now)


def _bus_config(config: UpfConfig) -> BusNodeConfig:
    never = (
        CONTROLLER_NODE_ID,
        TRIGGER_NODE_ID,
        config.controller_node_id,
        config.trigger_node_id,
    )
    return BusNodeConfig(
        node_id=config.node_id,
        name=config.node_name,
        unique_id=config.unique_id,
        calls=config.calls,
        allocator=config.allocator,
        table=config.allocation_table,
        never=never,
        time_master=config.time_master,
        utc_offset=config.utc_offset,
    )
