"""Deploying: through the controller, or the triggers where it is silent or there is none.

A deploy that the controller does not answer goes to the triggers directly, as the last resort: the
trigger is usually driven by the controller, but open to the vehicle. A controller that refuses is
not gone round while it lives; one that accepts and then falls silent, or starts anew, is.

Source: Flyfire UPF UAVCAN protocol V1.0, "global working state" (TYPE_DEPLOY*) and "system
architecture" (TriggerService, TriggerLaunch).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import goals
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.device_table import DeviceTable
from chute_ros.links.upf.protocol.devices import Controller, Trigger
from chute_ros.links.upf.protocol.vehicle_service import VehicleService
from chute_ros.links.upf.protocol.vehicle_status import VehicleStatusSender
from chute_ros.model import LinkState, Outcome
from chute_ros.protocol.dronecan.calls import Call, ServiceCalls
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.events import RequestReport, Severity
from chute_ros.protocol.goal import EffectFinished, Report
from chute_ros.protocol.requests import Requests


@dataclass
class _Watched:
    """A deploy under way. fire_at: when the triggers are fired (again), monotonic s."""

    #: What the controller must answer; None: there is no controller.
    call: Call | None
    fire_at: float
    wait: float
    begun: bool
    answered: bool = False
    accepted: bool = False


class Deploying:
    """Begins deploys among the requests, and fires the triggers when it is time to."""

    def __init__(
        self,
        config: UpfConfig,
        devices: DeviceTable,
        requests: Requests[ServiceCalls],
        endpoint: Endpoint,
        vehicle: VehicleStatusSender,
        service: VehicleService,
    ) -> None:
        self._config, self._devices = config, devices
        self._definitions = devices.definitions
        self._requests, self._endpoint = requests, endpoint
        self._vehicle, self._service = vehicle, service
        self._deploys: set[int] = set()
        #: By the tokens of those deploys that may go, or go, to the triggers.
        self._watched: dict[int, _Watched] = {}
        self._reports: list[RequestReport] = []

    def deploy(self, token: int, force: bool, node_id: int, now: float) -> None:
        """Deploy through this controller; 0: the chosen one, or the trigger if there is none."""
        self._deploys.add(token)
        controller = self._devices.controller(node_id)
        trigger = None if node_id else self._devices.trigger()
        directly = self._config.without_controller or self._config.last_resort
        if controller is not None and not (trigger and self._config.without_controller):
            self._by_controller(token, controller, force, node_id, now)
        elif trigger is not None and directly:
            self._by_trigger(token, trigger, now)
        else:
            self._requests.refuse(token, self._devices.no_controller(node_id))

    def fire_triggers(self, token: int, now: float) -> None:
        """Past the controller, which has not released in time or is not there."""
        self._deploys.add(token)
        trigger = self._devices.trigger()
        self._requests.make_way_for_release(now)
        if trigger is not None:
            self._by_trigger(token, trigger, now)
            return
        # TriggerLaunch needs to know of none, as one may listen that does not speak.
        was = "TriggerLaunch was broadcast" if self._broadcast() else "nothing was sent"
        self._requests.refuse(token, f"no trigger was received yet; {was}")

    def answered(self, call: Call, accepted: bool) -> None:
        """A controller answered this call to deploy, perhaps long after it was given up."""
        for one in self._watched.values():
            if one.call == call:
                one.answered, one.accepted, one.fire_at = True, accepted, math.inf

    def restarted(self, node_id: int, now: float) -> None:
        """A node started anew: a controller knows no more what it had accepted."""
        for one in self._watched.values():
            if one.answered and one.call and one.call.server == node_id:
                one.answered = False
                one.fire_at = now if one.accepted else now + one.wait

    def update(self, now: float) -> bool:
        """Look at the clock; whether something was put among the calls."""
        fire = False
        for token, one in self._watched.items():
            if one.answered and one.call and self._is_silent(one.call.server):
                # Whatever it answered, it will not do.
                one.answered, one.fire_at = False, now
            if now >= one.fire_at:
                one.fire_at = now + self._config.effect.retry_interval
                fire = True
                if not one.begun:
                    one.begun = True
                    text = "the controller does not answer: firing the triggers directly"
                    self._devices.notice(Severity.ERROR, text)
                    self._reports.append(RequestReport(Report(token, Outcome.SENT, text)))
        if fire:
            for trigger in self._devices.triggers.values():
                call = goals.trigger_call(trigger, self._definitions)
                self._requests.commands.send_once(call, now)
            self._broadcast()
        return fire

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        return min((one.fire_at for one in self._watched.values()), default=math.inf)

    def over(self, finished: EffectFinished, now: float) -> EffectFinished:
        """The end of any request; of a deploy over motors that are known to turn, which tear the
        parachute's lines, with a warning."""
        self._watched.pop(finished.token, None)
        deploys = finished.token in self._deploys
        self._deploys.discard(finished.token)
        armed_at = self._vehicle.armed_at(now)
        # A vehicle that is not known to be armed has no time, which is above none.
        turn = armed_at > self._service.kill_confirmed_at
        if not deploys or not finished.sent or not turn:
            return finished
        warning = (
            f"WARNING: the vehicle reported armed {now - armed_at:.1f} s ago, and no kill "
            "was confirmed: the motors may turn, STOP THEM"
        )
        self._devices.notice(Severity.ERROR, f"deploy: {warning}")
        return replace(finished, message=f"{warning}; {finished.message}")

    def take_reports(self) -> list[RequestReport]:
        """Steps that were reached; each is handed out once."""
        reports, self._reports = self._reports, []
        return reports

    # -- inside ----------------------------------------------------------------------------------

    def _is_silent(self, node_id: int) -> bool:
        """This controller is not heard any more, or another device has its node id."""
        controller = self._devices.controllers.get(node_id)
        return controller is None or controller.liveness.state is not LinkState.OK

    def _by_controller(
        self, token: int, controller: Controller, force: bool, named: int, now: float
    ) -> None:
        self._requests.make_way_for_release(now)
        goal = goals.deploy(controller, self._triggers_of_it, self._definitions, force, now)
        self._requests.begin(token, goal, now)
        # Nobody says which trigger is whose: one of several controllers that was named is not
        # gone round, as that would fire the others' triggers as well.
        alone = not named or self._devices.only_controller() is not None
        if self._config.last_resort and alone and not controller.never_deploys:
            wait = self._config.last_resort_after if controller.alive else 0.0
            self._watched[token] = _Watched(goal.commands[-1], now + wait, wait, begun=False)

    def _triggers_of_it(self) -> list[Trigger]:
        """The triggers whose word counts for a controller: those of the only one."""
        alone = self._devices.only_controller() is not None
        return self._devices.alive_triggers() if alone else []

    def _by_trigger(self, token: int, trigger: Trigger, now: float) -> None:
        goal = goals.fire_trigger(trigger, self._devices.alive_triggers, self._definitions, now)
        out = goal.shown is not None and goal.shown()
        self._requests.begin(token, goal, now)
        if not out:
            self._broadcast()
            # Every trigger, again and again, until one says that it has fired.
            wait = self._config.effect.retry_interval
            self._watched[token] = _Watched(None, now + wait, wait, begun=True)

    def _broadcast(self) -> bool:
        """TriggerLaunch: for every trigger, or for ours alone where that can be said; whether it
        was."""
        kind = self._definitions.types.message(names.TRIGGER_LAUNCH)
        values = {"magic_number": kind.constants[names.MAGIC]}
        ours = self._config.trigger_node_id
        if ours and "node_id" not in kind.fields:
            return False  # TriggerService alone reaches only ours
        if ours:
            values["node_id"] = ours
        self._endpoint.broadcast(names.TRIGGER_LAUNCH, values, goals.FIRE_PRIORITY)
        return True
