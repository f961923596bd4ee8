"""A simulated UPF parachute controller: its states, its rules, its automatic functions.

Source: Flyfire UPF UAVCAN protocol V1.0, "global working state" and "parameters". What the
document leaves open (heights, times, who is refused how) is chosen here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from chute_ros.model import ParachuteState
from chute_ros.protocol.dronecan.calls import Call
from chute_ros.protocol.dronecan.endpoint import Heard
from chute_ros.protocol.upf import definitions as names
from chute_ros.protocol.upf import machine
from chute_ros.protocol.upf import parameters as p
from chute_ros.protocol.upf.config import CONTROLLER_NODE_ID
from chute_ros.protocol.upf.definitions import Definitions
from chute_ros.protocol.upf.machine import Stimulus
from chute_ros.sim.upf_aps import ApsLimits, AutomaticDeployment, Motion
from chute_ros.sim.upf_node import NodeSettings, UpfNode

#: The document gives no defaults but the static node id and the resistor; the others are chosen.
CONTROLLER_PARAMETERS: dict[str, p.Value] = {
    p.STATIC_NODE_ID: CONTROLLER_NODE_ID,
    p.AUTO_SAVE: True,
    p.CANBUS_RESISTER: False,
    p.ENABLE_PARACHUTE: True,
    p.ENABLE_APS: True,
    p.AUTO_TAKEOFF: True,
    p.AUTO_ARM: True,
    p.AUTO_DISARM: True,
    p.AUTO_LAND: True,
    p.LIGHT: True,
    p.NODE_STATUS_INTERVAL: 1000,
    p.PARACHUTE_STATUS_INTERVAL: 100,
}
#: The vehicle is connected while its VehicleStatus is younger, s.
VEHICLE_TIMEOUT = 1.0
#: The trigger is connected while its TriggerStatus is younger, s.
TRIGGER_TIMEOUT = 1.0
_STEP = 0.02  # s

_S = ParachuteState


@dataclass(frozen=True)
class ControllerSettings:
    """How a simulated controller behaves where the document leaves it open."""

    node: NodeSettings = field(default=NodeSettings("upf.controller", CONTROLLER_PARAMETERS))
    self_test: float = 0.5  # s
    takeoff_height: float = 1.0  # m
    arm_height: float = 10.0  # m
    disarm_height: float = 8.0  # m
    land_time: float = 2.0  # s at rest on the ground
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
        self._aps = AutomaticDeployment(self.how.aps)
        self._ready_at = math.nan
        self._rest_since = math.nan
        self._launch_at = math.nan
        self._trigger_fired = False
        self._vehicle_node, self._vehicle_heard = 0, -math.inf
        self._trigger_node, self._trigger_heard = 0, -math.inf
        self._call_number = 0
        self._kill_call = 0
        self._entry_call = 0
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
        self.arguments |= {"error": lambda name: names_of_errors(self.definitions)[name]}

    # -- the world -------------------------------------------------------------------------------

    def reboot(self) -> None:
        """NOT_READY, then the self test; a trigger that has fired stays so."""
        super().reboot()
        self.errors = set()
        self._aps.reset()
        self._launch_at = self._rest_since = math.nan
        self._trigger_fired = False
        self._ready_at = self.now + self.how.self_test
        self._enter(_S.NOT_READY)

    def step(self, now: float) -> None:
        """States by time, by motion and by what was asked."""
        self._step_at = now + _STEP
        if self.state is _S.NOT_READY and now >= self._ready_at:
            passed = not self.errors
            self._move(Stimulus.SELF_TEST_PASSED if passed else Stimulus.SELF_TEST_FAILED)
        self._rest(now)
        self._automatic(now)
        if self.state is _S.ARMED and self.switch(p.ENABLE_APS):
            accident = self._aps.accident(self.motion, now)
            if accident:
                self.launch(f"APS: {accident}")
        else:
            self._aps.reset()
        if now >= self._launch_at:
            self._fire(now)

    def next_step(self) -> float:
        """Soon."""
        return self._step_at

    def launch(self, cause: str) -> None:
        """Ask for the kill switch, wait a little for the answer, then fire the trigger."""
        out = self.state in machine.DEPLOYED or not math.isnan(self._launch_at)
        if out or not self.switch(p.ENABLE_PARACHUTE):
            return
        self.say(f"LAUNCH by {cause} at {self.motion.height:.1f} m")
        self._kill_call = self._ask_vehicle(machine.LAUNCH_REQUEST)
        self._launch_at = self.now + (self.how.kill_wait if self._kill_call else 0.0)

    def status(self) -> dict[str, Any]:
        """ParachuteStatus as it is now."""
        known = names_of_errors(self.definitions)
        bits = {known[name] for name in self.errors if name in known}
        # Data types that have a field for each error instead of flags.
        single = {f"error_{name.lower()}": True for name in self.errors}
        return single | {
            "state": self.definitions.state_number(self.state),
            "is_vehicle_connected": self.vehicle_connected,
            "is_enable_auto_launch": self.switch(p.ENABLE_APS),
            "error_flags": sum(bits),
            "height_of_home": self.motion.height,
            "vz": self.motion.vertical_speed,
            "backup_power_voltage": 8.2,
        }

    @property
    def vehicle_connected(self) -> bool:
        """VehicleStatus is heard."""
        return self.now - self._vehicle_heard < VEHICLE_TIMEOUT

    # -- states ----------------------------------------------------------------------------------

    def _move(self, stimulus: Stimulus) -> None:
        self._enter(machine.next_state(self.state, stimulus))

    def _enter(self, state: ParachuteState) -> None:
        if state is not self.state or state is _S.NOT_READY:
            self.say(state.name)
        self.state = state
        self._rest_since = math.nan
        self.send_soon(names.PARACHUTE_STATUS)
        # What the state before asked for must not be asked again after what this one asks for.
        self.calls.cancel(self._entry_call, self.now)
        wanted = machine.ENTRY_REQUESTS.get(state)
        self._entry_call = 0 if wanted is None else self._ask_vehicle(wanted)

    def _possible(self, stimulus: Stimulus) -> bool:
        return (self.state, stimulus) in machine.TRANSITIONS

    def _set_errors(self, errors: set[str]) -> None:
        self.errors = errors
        stimulus = Stimulus.FAULT if errors else Stimulus.FAULT_CLEARED
        if self._possible(stimulus):
            self._move(stimulus)

    def _rest(self, now: float) -> None:
        if not self.motion.at_rest:
            self._rest_since = math.nan
        elif math.isnan(self._rest_since):
            self._rest_since = now
        rested = now - self._rest_since
        if self.state is _S.LAUNCHED and rested >= machine.REST_TIME:
            self._move(Stimulus.AT_REST)

    def _automatic(self, now: float) -> None:
        how, height = self.how, self.motion.height
        if self.state is _S.READY and self.switch(p.AUTO_TAKEOFF):
            if height >= how.takeoff_height:
                self._move(Stimulus.TAKEOFF)
        elif self.state is _S.TAKEOFF:
            landed = now - self._rest_since >= how.land_time and height < 0.5
            if height >= how.arm_height and self.switch(p.AUTO_ARM):
                self._move(Stimulus.ARM)
            elif landed and self.switch(p.AUTO_LAND):
                self._move(Stimulus.LAND)
        elif self.state is _S.ARMED and self.switch(p.AUTO_DISARM):
            calm = self.motion.vertical_speed > -self.how.aps.sink_speed / 2
            if height < how.disarm_height and calm:
                self._move(Stimulus.DISARM)

    # -- launching -------------------------------------------------------------------------------

    def _fire(self, now: float) -> None:
        self._launch_at = math.nan
        self.calls.cancel(self._kill_call, now)
        values = self.definitions.request(names.TRIGGER_SERVICE, "TYPE_LAUNCH")
        if self._trigger_node:
            self._start(Call(self._trigger_node, names.TRIGGER_SERVICE, values, 2))
        constants = self.definitions.types.message(names.TRIGGER_LAUNCH).constants
        self.broadcast(names.TRIGGER_LAUNCH, {"magic_number": constants[names.MAGIC]}, 2)

    def answered(self) -> None:
        """The vehicle answered the kill switch: launch now."""
        for finished in self.calls.take_finished():
            if finished.command.service != names.VEHICLE_SERVICE:
                continue
            result = "no answer"
            if finished.values is not None:
                result = self.definitions.result_name(names.VEHICLE_SERVICE, finished.values)
            service, values = names.VEHICLE_SERVICE, finished.command.values
            self.say(f"{self.definitions.type_name(service, values)} answered: {result}")
            if finished.token == self._kill_call and not math.isnan(self._launch_at):
                self._fire(self.now)

    def _ask_vehicle(self, type_name: str) -> int:
        """Request something of the vehicle; number of the call, 0: no vehicle is known."""
        if not self._vehicle_node or not self.node_id:
            return 0
        values = self.definitions.request(names.VEHICLE_SERVICE, type_name)
        priority = 2 if type_name == machine.LAUNCH_REQUEST else 16
        self.say(f"asks for {type_name}")
        return self._start(Call(self._vehicle_node, names.VEHICLE_SERVICE, values, priority))

    def _start(self, call: Call) -> int:
        self._call_number += 1
        self.calls.start(self._call_number, call, self.now, urgent=call.priority < 8)
        return self._call_number

    # -- what comes ------------------------------------------------------------------------------

    def _vehicle_status(self, source: int, values: Mapping[str, Any]) -> None:
        first = self._vehicle_node != source or not self.vehicle_connected
        self._vehicle_node, self._vehicle_heard = source, self.now
        wanted = machine.ENTRY_REQUESTS.get(self.state)
        if first and wanted is not None:
            # It was not there when the state was entered.
            self._entry_call = self._ask_vehicle(wanted)

    def _trigger_status(self, source: int, values: Mapping[str, Any]) -> None:
        self._trigger_node, self._trigger_heard = source, self.now
        name = self.definitions.state_name(names.TRIGGER_STATUS, values)
        fired = bool(values.get("is_launched")) or name == "LAUNCHED"
        if fired and not self._trigger_fired and self._possible(Stimulus.TRIGGER_FIRED):
            self._trigger_fired = True
            self._move(Stimulus.TRIGGER_FIRED)

    def _parachute_service(self, request: Heard) -> dict[str, Any]:
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
            stimulus = Stimulus[name.removeprefix("TYPE_")]
            if not self._possible(stimulus):
                return "FAILED"
            self._move(stimulus)
            return "SUCCESS"
        if name not in ("TYPE_DEPLOY", "TYPE_DEPLOY_FORCE"):
            return "REJECTED"
        if self.state in machine.DEPLOYED:
            return "SUCCESS"
        if not self.switch(p.ENABLE_PARACHUTE):
            return "REJECTED"
        if name == "TYPE_DEPLOY":
            if self.state not in (_S.TAKEOFF, _S.ARMED):
                return "FAILED"
            if self.motion.height < self.how.minimum_height:
                return "TEMPORARILY_REJECTED"
        self.launch(name)
        return "SUCCESS"


def names_of_errors(definitions: Definitions) -> dict[str, int]:
    """ERROR_* of ParachuteStatus without the prefix -> its bit."""
    constants = definitions.types.message(names.PARACHUTE_STATUS).constants
    return {n.removeprefix("ERROR_"): b for n, b in constants.items() if n.startswith("ERROR_")}
