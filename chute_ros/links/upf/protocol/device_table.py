"""The UPF devices on the bus: who they are and what they say. It only listens.

A node that broadcasts ParachuteStatus is a controller, one that broadcasts TriggerStatus a
trigger; one node may be both. Source: Flyfire UPF UAVCAN protocol V1.0, "system architecture".
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any, TypeVar

from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.protocol.devices import (
    SAYINGS,
    SAYINGS_ORDERED,
    Controller,
    Device,
    Trigger,
)
from chute_ros.links.upf.protocol.events import TriggerChanged
from chute_ros.model import LinkState, ParachuteStatus
from chute_ros.protocol.events import EventLog, ParachuteChanged, Severity
from chute_ros.protocol.liveness import LinkChange, first_alive, has_room

DeviceT = TypeVar("DeviceT", bound=Device)
#: More devices of one kind than this are not followed: made-up node ids must not grow us.
MOST_DEVICES = 8


class DeviceTable(EventLog):
    """Follows the controllers and triggers that are ours."""

    def __init__(self, config: UpfConfig, definitions: Definitions) -> None:
        super().__init__()
        self._config = config
        self.definitions = definitions
        self.controllers: dict[int, Controller] = {}
        self.triggers: dict[int, Trigger] = {}
        #: Why something was not taken as it was said -> how often.
        self.counts: Counter[str] = Counter()
        #: Controllers whose parameters are to be read anew.
        self.to_read: list[Controller] = []
        #: Node ids that two nodes use: what their statuses say changes with each.
        self.doubled: frozenset[int] = frozenset()

    # -- who -------------------------------------------------------------------------------------

    def controller(self, node_id: int = 0) -> Controller | None:
        """The one with this node id; 0: the first that is not lost, or the first, of those that
        have not come back under another node id."""
        if node_id:
            return self.controllers.get(node_id)
        return first_alive(self._there()) or first_alive(self.controllers.values())

    def only_controller(self) -> Controller | None:
        """With several, nobody says which trigger is whose."""
        there = self._there()
        return there[0] if len(there) == 1 else None

    def _there(self) -> list[Controller]:
        return [one for one in self.controllers.values() if not self.came_back_as(one)]

    def came_back_as(self, gone: Controller) -> int:
        """The node id that this controller has now, as far as can be told: one that fell silent
        before another was first heard may be the same. 0: it has come back under none."""
        if gone.liveness.state is LinkState.OK:
            return 0
        after = (
            other.node_id
            for other in self.controllers.values()
            if other.alive and other.liveness.first_heard > gone.liveness.last_heard
        )
        return next(after, 0)

    def trigger(self) -> Trigger | None:
        """The first that is not lost, or the first."""
        return first_alive(self.triggers.values())

    def missing_trigger(self) -> int:
        """The node id of the trigger that is named and was never received; 0: none is missing."""
        wanted = self._config.trigger_node_id
        return 0 if wanted in self.triggers else wanted

    def alive_triggers(self) -> list[Trigger]:
        """Those that are heard."""
        return [trigger for trigger in self.triggers.values() if trigger.alive]

    def no_controller(self, node_id: int) -> str:
        """Why a request ends that needs the controller with this node id (0: any)."""
        known = ", ".join(map(str, self.controllers)) or "none"
        what = f"no controller {node_id}" if node_id else "no controller"
        triggers = ", ".join(map(str, self.triggers))
        beside = f"; triggers received: {triggers}" if triggers else ""
        return f"{what} was received on this link (received: {known}{beside})"

    def picture(self, now: float) -> ParachuteStatus | None:
        """The parachute, as this link sees it; None: there is none yet."""
        trigger = self.trigger()
        if trigger is not None and self._config.without_controller:
            return trigger.parachute_status(now)
        controller = self.controller()
        return None if controller is None else self.picture_of(controller, now)

    def picture_of(self, controller: Controller, now: float) -> ParachuteStatus:
        """One controller; with several, only its own word counts, as nobody says which trigger
        is whose."""
        alone = self.only_controller() is not None
        # A trigger that is lost counts only by being lost: it may have been exchanged.
        return controller.status(now, list(self.triggers.values()) if alone else [])

    # -- what they say ---------------------------------------------------------------------------

    def parachute_status(self, node_id: int, values: Mapping[str, Any], now: float) -> None:
        """A ParachuteStatus came."""
        wanted = self._config.controller_node_id
        controller = self._admit(node_id, wanted, self.controllers, Controller)
        if controller is None:
            return
        jumps = controller.unknown_jumps
        before = controller.state
        self._changed(controller, controller.status_message(values, now))
        if node_id in self.doubled:
            pass  # told once, as what it is
        elif controller.unknown_jumps > jumps:
            self.notice(
                Severity.WARNING,
                f"controller {node_id} went from {controller.newest_unknown_jump}, which "
                "is not in its document",
            )
        elif controller.state is not before:
            text = f"controller {node_id}: {before.name} to {controller.state.name}"
            self.notice(Severity.INFO, text)
        if self._controller_says_out():
            for trigger in self.triggers.values():
                if trigger.doubted:
                    trigger.believe()
                    self._has_fired(trigger, now)
        self._controller_changed(controller, now)

    def trigger_status(
        self, node_id: int, values: Mapping[str, Any], now: float, ordered: bool
    ) -> None:
        """A TriggerStatus came. ordered: a release is under way."""
        trigger = self._admit(node_id, self._config.trigger_node_id, self.triggers, Trigger)
        if trigger is not None:
            fired, doubted = trigger.launched, trigger.doubted
            sayings = SAYINGS_ORDERED if ordered else SAYINGS
            sayings = 1 if self._controller_says_out() else sayings
            self._changed(trigger, trigger.status_message(values, now, sayings))
            if trigger.launched and not fired:
                self._has_fired(trigger, now)
                self._controllers_changed(now)
                return
            self._trigger_changed(trigger, now)
            if trigger.doubted and not ordered:
                self.counts["launched without an order, not believed yet"] += 1
            if trigger.doubted and not doubted and not ordered:
                text = f"trigger {node_id} reports fired, without an order from this node"
                until = "it repeats this, or its controller reports it"
                self.notice(Severity.WARNING, f"{text}: believed once {until}")

    def node_status(self, node_id: int, values: Mapping[str, Any], now: float) -> None:
        """A NodeStatus of anybody."""
        for device in self._all():
            if device.node_id == node_id:
                self._changed(device, device.node_status(values, now))

    def restarted(self, node_id: int) -> None:
        """A node started anew: what it was told before may be gone."""
        for device in self._all():
            if device.node_id == node_id:
                device.restart_count += 1
        controller = self.controllers.get(node_id)
        if controller is not None:
            controller.parameters.clear()
            self.to_read.append(controller)

    def replaced(self, node_id: int, now: float) -> None:
        """Another device has this node id: what it does not say itself is not true of it."""
        known: dict[int, Any]
        for known in (self.controllers, self.triggers):
            if node_id in known and known[node_id].overdue(now):
                del known[node_id]

    def update(self, now: float) -> None:
        """Look at the clock."""
        for controller in self.controllers.values():
            changes, picture_changed = controller.update(now)
            self._changed(controller, changes)
            if picture_changed:
                self._controller_changed(controller, now)
        for trigger in self.triggers.values():
            changes, picture_changed = trigger.update(now)
            self._changed(trigger, changes)
            if picture_changed:
                self._trigger_changed(trigger, now)
                self._controllers_changed(now)

    def next_deadline(self) -> float:
        """When update has something to do; infinity: never."""
        return min((device.next_deadline() for device in self._all()), default=math.inf)

    # -- inside ----------------------------------------------------------------------------------

    def _all(self) -> list[Device]:
        return [*self.controllers.values(), *self.triggers.values()]

    def _admit(
        self, node_id: int, wanted: int, known: dict[int, DeviceT], kind: type[DeviceT]
    ) -> DeviceT | None:
        """The device with this node id, if it is ours."""
        found = known.get(node_id)
        if found is not None or node_id == 0:
            return found
        if wanted not in (0, node_id) or not has_room(known, MOST_DEVICES):
            # Not ours by a parameter, or too many.
            self.counts["status of devices not followed"] += 1
            return None
        made = known[node_id] = kind(node_id, self._config, self.definitions)
        if isinstance(made, Controller):
            self.to_read.append(made)
        return made

    def _changed(self, device: Device, changes: list[LinkChange]) -> None:
        self.link_changed(f"{device.kind} {device.node_id}", changes)
        if isinstance(device, Controller) and any(change.regained for change in changes):
            # Nobody knows what was done to it meanwhile.
            self.to_read.append(device)

    def _controller_says_out(self) -> bool:
        controller = self.only_controller()
        return controller is not None and controller.deployed

    def _controllers_changed(self, now: float) -> None:
        """What a trigger says is part of the picture of the only controller."""
        controller = self.only_controller()
        if controller is not None:
            self._controller_changed(controller, now)

    def _controller_changed(self, controller: Controller, now: float) -> None:
        """Without a controller the trigger is the parachute, whoever else speaks."""
        if not (self._config.without_controller and self.triggers):
            self._events.append(
                ParachuteChanged(self.picture_of(controller, now), controller.received)
            )

    def _has_fired(self, trigger: Trigger, now: float) -> None:
        self._trigger_changed(trigger, now)
        self.notice(Severity.WARNING, f"trigger {trigger.node_id} has fired")

    def _trigger_changed(self, trigger: Trigger, now: float) -> None:
        self._events.append(TriggerChanged(trigger_picture(trigger, now), trigger.received))
        if self._config.without_controller:
            self._events.append(ParachuteChanged(trigger.parachute_status(now), trigger.received))


def trigger_picture(trigger: Trigger, now: float) -> Mapping[str, Any]:
    """What chute_msgs/TriggerStatus tells, by its field names; state in words."""
    flags = trigger.values.get("error_flags", 0)
    return {
        "node_id": trigger.node_id,
        "link_state": trigger.liveness.state,
        "state": trigger.state,
        "launched": trigger.launched,
        "supply_voltage": trigger.number("supply_voltage"),
        "error_flags": flags if isinstance(flags, int) else 0,
        "faults": tuple(trigger.faults(now)),
    }
