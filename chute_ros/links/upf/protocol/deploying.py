"""Deploying: through the controller, or the triggers where it is silent or there is none.

Source: Flyfire UPF UAVCAN protocol V1.0, "global working state" (TYPE_DEPLOY*) and "system
architecture" (TriggerService, TriggerLaunch).
"""

from __future__ import annotations

from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import goals
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.devices import Controller, Trigger
from chute_ros.links.upf.protocol.last_resort import LastResort
from chute_ros.links.upf.protocol.roster import UpfDevices
from chute_ros.model import LinkState, Outcome
from chute_ros.protocol.dronecan.calls import ServiceCalls
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.effect import Report
from chute_ros.protocol.events import RequestReport, Severity
from chute_ros.protocol.requests import Requests


class Deploying:
    """Begins deploys among the requests, and fires the triggers when it is time to."""

    def __init__(
        self,
        config: UpfConfig,
        devices: UpfDevices,
        requests: Requests[ServiceCalls],
        endpoint: Endpoint,
        last_resort: LastResort,
    ) -> None:
        self._config = config
        self._definitions = devices.definitions
        self._devices = devices
        self._requests = requests
        self._endpoint = endpoint
        self._last_resort = last_resort
        self._reports: list[RequestReport] = []

    def deploy(self, token: int, force: bool, node_id: int, now: float) -> None:
        """Deploy through this controller; 0: the chosen one, or the trigger if there is none."""
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
        trigger = self._devices.trigger()
        self._requests.make_way_for_release(now)
        if trigger is not None:
            self._by_trigger(token, trigger, now)
            return
        # TriggerLaunch needs to know of none, as one may listen that does not speak.
        was = "TriggerLaunch was broadcast" if self._broadcast() else "nothing was sent"
        self._requests.refuse(token, f"no trigger was received yet; {was}")

    def update(self, now: float) -> bool:
        """Look at the clock; whether something was put among the calls."""
        for node_id in self._last_resort.answered_by():
            if self._devices.controllers[node_id].liveness.state is not LinkState.OK:
                self._last_resort.silent(node_id, now)
        begun, fire = self._last_resort.update(now)
        for token in begun:
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
        return self._last_resort.next_deadline()

    def restarted(self, node_id: int, now: float) -> None:
        """A node started anew."""
        self._last_resort.restarted(node_id, now)

    def over(self, token: int) -> None:
        """The request with this token ended."""
        self._last_resort.over(token)

    def take_reports(self) -> list[RequestReport]:
        """Steps that were reached; each is handed out once."""
        reports, self._reports = self._reports, []
        return reports

    # -- inside ----------------------------------------------------------------------------------

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
            self._last_resort.watch(token, goal.commands[-1], now, wait)

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
            interval = self._config.effect.retry_interval
            self._last_resort.watch(token, None, now, interval)

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
