"""A simulated UPF parachute controller: its states, its rules, its automatic functions.

Source: Flyfire UPF UAVCAN protocol V1.0, "global working state" and "parameters". What the
document leaves open (heights, times, who is refused how) is chosen here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import machine
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.protocol.machine import ControllerEvent
from chute_ros.links.upf.simulator.automatic import (
    ApsLimits,
    AutomaticDeployment,
    AutomaticFunctions,
)
from chute_ros.links.upf.simulator.errors import error_places, told_errors
from chute_ros.links.upf.simulator.memory import CONTROLLER_PARAMETERS
from chute_ros.links.upf.simulator.node import NodeSettings, UpfNode
from chute_ros.links.upf.simulator.peers import Peers
from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan.calls import Call
from chute_ros.protocol.dronecan.endpoint import ReceivedTransfer
from chute_ros.sim.acting import one_of
from chute_ros.sim.motion import Motion
from chute_ros.transitions import after

#: A trigger that has not fired is told again by itself after this time at the earliest, s.
FIRE_AGAIN = 1.0
_STEP = 0.02  # s

_S = ParachuteState
#: The state that a request asks for.
_ASKED_FOR = {
    ControllerEvent.TAKEOFF: _S.TAKEOFF,
    ControllerEvent.ARM: _S.ARMED,
    ControllerEvent.DISARM: _S.TAKEOFF,
    ControllerEvent.LAND: _S.READY,
}


@dataclass(frozen=True)
class ControllerSettings:
    """How a simulated controller behaves where the document leaves it open."""

    node: NodeSettings = field(default=NodeSettings("upf.controller", CONTROLLER_PARAMETERS))
    self_test: float = 0.5  # s
    #: Errors that it starts with, by the names of ParachuteStatus without ERROR_.
    errors: frozenset[str] = frozenset()
    #: The kill switch is waited for this long before it launches all the same, s.
    kill_wait: float = 0.5
    #: Below it TYPE_DEPLOY is temporarily rejected, m; 0: never.
    minimum_height: float = 0.0
    aps: ApsLimits = field(default=ApsLimits())


class UpfController(UpfNode):
    """One controller. Its motion is set from outside; it says when the trigger is to fire."""

    def __init__(
        self, definitions: Definitions, settings: ControllerSettings | None = None
    ) -> None:
        self.how = settings or ControllerSettings()
        super().__init__(definitions, self.how.node)
        self.state = _S.NOT_READY
        self.motion = Motion()
        self.errors: set[str] = set()
        #: TYPE_* of every ParachuteService request that came with the right magic number.
        self.requests_heard: list[str] = []
        self._error_places = error_places(definitions, names.PARACHUTE_STATUS)
        self._aps = AutomaticDeployment(self.how.aps)
        self._automatic = AutomaticFunctions()
        #: When the self test ends, the trigger is to be told, and was told last; NaN: not.
        self._ready_at = self._launch_at = self._fired_at = math.nan
        self._launch_by_aps = False
        self._peers = Peers()
        self._call_number = self._kill_call = self._entry_call = 0
        self._step_at = -math.inf
        self.services[names.PARACHUTE_SERVICE] = self._parachute_service
        self.messages |= {
            names.VEHICLE_STATUS: self._vehicle_status,
            names.TRIGGER_STATUS: self._trigger_status,
        }
        self.broadcasts[names.PARACHUTE_STATUS] = (
            lambda: self._interval(p.PARACHUTE_STATUS_INTERVAL),
            self.status,
        )
        self.actions |= {
            "error": lambda name: self._set_errors(self.errors | {name}),
            "clear-errors": lambda _: self._set_errors(set()),
            "deploy": lambda _: self.launch("a person at the device"),
        }
        self.arguments |= {"error": one_of(self._error_places)}

    # -- the world -------------------------------------------------------------------------------

    def reboot(self) -> None:
        """NOT_READY, then the self test; a trigger that has fired stays so."""
        super().reboot()
        self.errors = set(self.how.errors)
        self._aps.reset()
        self._launch_at = self._fired_at = math.nan
        self._peers = Peers()
        self._ready_at = self.now + self.how.self_test
        self._enter(_S.NOT_READY)

    def step(self, now: float) -> None:
        """States by time, by motion and by what was asked."""
        self._step_at = now + _STEP
        if self.state is _S.NOT_READY and now >= self._ready_at:
            passed = not self.errors
            self._move(
                ControllerEvent.SELF_TEST_PASSED if passed else ControllerEvent.SELF_TEST_FAILED
            )
        self._automatic.feel(self.motion, now)
        wish = self._automatic.wish(self.state, self.motion, self.switch, now)
        if wish is not None:
            self._move(wish)
        at_rest = self._automatic.at_rest_for(now) >= machine.REST_TIME
        if self.state is _S.LAUNCHED and at_rest:
            self._move(ControllerEvent.AT_REST)
        if self.state is _S.ARMED and self.switch(p.ENABLE_APS):
            accident = self._aps.accident(self.motion, now)
            if accident:
                self.launch(f"APS: {accident}", by_aps=True)
        else:
            self._aps.reset()
        if now >= self._launch_at:
            self._fire(now)

    def next_step(self) -> float:
        """Soon."""
        return self._step_at

    def launch(self, cause: str, by_aps: bool = False) -> None:
        """Ask for the kill switch, wait a little for the answer, then fire the trigger."""
        if self.state in machine.DEPLOYED or not self.switch(p.ENABLE_PARACHUTE):
            return
        if not math.isnan(self._launch_at):
            self._launch_by_aps &= by_aps
            return
        if by_aps and self.now - self._fired_at < FIRE_AGAIN:
            return
        if not self.node_id:
            self.say(f"cannot launch by {cause}: has no node id")
            return
        self.say(f"LAUNCH by {cause} at {self.motion.height:.1f} m")
        self._launch_by_aps = by_aps
        self._kill_call = self._ask_vehicle(machine.LAUNCH_REQUEST)
        self._launch_at = self.now + (self.how.kill_wait if self._kill_call else 0.0)

    def parameter_changed(self, name: str) -> None:
        """Call off a launch that may not be any more."""
        super().parameter_changed(name)
        self.send_soon(names.PARACHUTE_STATUS)
        by_aps = self._launch_by_aps and not self.switch(p.ENABLE_APS)
        if not math.isnan(self._launch_at) and (by_aps or not self.switch(p.ENABLE_PARACHUTE)):
            self.say("launch called off")
            self._launch_at = math.nan
            self.calls.cancel(self._kill_call, self.now)

    def status(self) -> dict[str, Any]:
        """ParachuteStatus as it is now. That others are missing, or that it may not deploy, is
        told as an error, but moves no state."""
        errors = self.errors | self._peers.errors(self.now)
        if not self.switch(p.ENABLE_PARACHUTE):
            errors.add("PARACHUTE_DISABLED")
        return {
            "state": self.definitions.state_number(self.state),
            "is_vehicle_connected": self.vehicle_connected,
            "is_enable_auto_launch": self.switch(p.ENABLE_APS),
            "height_of_home": self.motion.height,
            "vz": self.motion.vertical_speed,
            "backup_power_voltage": 8.2,
            **told_errors(self._error_places, errors),
        }

    @property
    def vehicle_connected(self) -> bool:
        """VehicleStatus is heard."""
        return self._peers.vehicle_connected(self.now)

    # -- states ----------------------------------------------------------------------------------

    def _move(self, event: ControllerEvent) -> None:
        self._enter(after(machine.TRANSITIONS, self.state, event))

    def _enter(self, state: ParachuteState) -> None:
        if state is not self.state or state is _S.NOT_READY:
            self.say(state.name)
        self.state = state
        self.initializing = state is _S.NOT_READY
        self._automatic.entered(state)
        self.send_soon(names.PARACHUTE_STATUS)
        # What the state before asked for must not be asked again after what this one asks for.
        self.calls.cancel(self._entry_call, self.now)
        wanted = machine.ENTRY_REQUESTS.get(state)
        self._entry_call = 0 if wanted is None else self._ask_vehicle(wanted)

    def _possible(self, event: ControllerEvent) -> bool:
        return (self.state, event) in machine.TRANSITIONS

    def _set_errors(self, errors: set[str]) -> None:
        self.errors = errors
        self.send_soon(names.PARACHUTE_STATUS)
        event = ControllerEvent.FAULT if errors else ControllerEvent.FAULT_CLEARED
        if self._possible(event):
            self._move(event)

    # -- launching -------------------------------------------------------------------------------

    def _fire(self, now: float) -> None:
        self._launch_at, self._fired_at = math.nan, now
        self.calls.cancel(self._kill_call, now)
        values = self.definitions.request(names.TRIGGER_SERVICE, "TYPE_LAUNCH")
        for node_id in self._peers.triggers:
            self._start(Call(node_id, names.TRIGGER_SERVICE, values, 2))
        constants = self.definitions.types.message(names.TRIGGER_LAUNCH).constants
        self.broadcast(names.TRIGGER_LAUNCH, {"magic_number": constants[names.MAGIC]}, 2)

    def answered(self) -> None:
        """Say what vehicle and trigger answered; after the kill switch, launch."""
        for finished in self.calls.take_finished():
            service, values = finished.command.service, finished.command.values
            result = "no answer"
            if finished.values is not None:
                result = self.definitions.result_name(service, finished.values)
            self.say(f"{self.definitions.type_name(service, values)} answered: {result}")
            if finished.token == self._kill_call and not math.isnan(self._launch_at):
                self._fire(self.now)

    def _ask_vehicle(self, type_name: str) -> int:
        """Request something of the vehicle; number of the call, 0: no vehicle is known."""
        if not self._peers.vehicle or not self.node_id:
            return 0
        values = self.definitions.request(names.VEHICLE_SERVICE, type_name)
        priority = 2 if type_name == machine.LAUNCH_REQUEST else 16
        self.say(f"asks for {type_name}")
        return self._start(Call(self._peers.vehicle, names.VEHICLE_SERVICE, values, priority))

    def _start(self, call: Call) -> int:
        self._call_number += 1
        self.calls.start(self._call_number, call, self.now, urgent=call.priority < 8)
        return self._call_number

    # -- what comes ------------------------------------------------------------------------------

    def _vehicle_status(self, source: int, values: Mapping[str, Any]) -> None:
        if not self.node_id:
            return
        first = self._peers.vehicle_status(source, self.now)
        wanted = machine.ENTRY_REQUESTS.get(self.state)
        if first and wanted is not None:
            # It was not there when the state was entered.
            self.calls.cancel(self._entry_call, self.now)
            self._entry_call = self._ask_vehicle(wanted)

    def _trigger_status(self, source: int, values: Mapping[str, Any]) -> None:
        self._peers.triggers[source] = self.now
        name = self.definitions.state_name(names.TRIGGER_STATUS, values)
        fired = bool(values.get("is_launched")) or name == "LAUNCHED"
        if fired and self._possible(ControllerEvent.TRIGGER_FIRED):
            self._move(ControllerEvent.TRIGGER_FIRED)

    def _parachute_service(self, request: ReceivedTransfer) -> dict[str, Any]:
        service = names.PARACHUTE_SERVICE
        if not self.definitions.magic_is_good(service, request.values):
            return self.definitions.result(service, "BAD_MAGIC_NUMBER")
        name = self.definitions.type_name(service, request.values)
        self.requests_heard.append(name)
        return self.definitions.result(service, self.decide(name))

    def decide(self, name: str) -> str:
        """What becomes of a request: the name of its result."""
        switch = p.EXCLUDES.get(name)
        if switch is not None:
            if self.switch(switch):
                return "REJECTED"
            event = ControllerEvent[name.removeprefix("TYPE_")]
            if self.state is _ASKED_FOR[event]:
                # Asked once more, because the first answer was lost.
                return "SUCCESS"
            if not self._possible(event):
                return "FAILED"
            self._move(event)
            return "SUCCESS"
        if name not in ("TYPE_DEPLOY", "TYPE_DEPLOY_FORCE"):
            return "REJECTED"
        if self.state in machine.DEPLOYED:
            return "SUCCESS"
        if self.refuses:
            return "FAILED"
        if not self.switch(p.ENABLE_PARACHUTE):
            return "REJECTED"
        if name == "TYPE_DEPLOY":
            if self.state not in (_S.TAKEOFF, _S.ARMED):
                return "FAILED"
            if self.motion.height < self.how.minimum_height:
                return "TEMPORARILY_REJECTED"
        self.launch(name)
        return "SUCCESS"
