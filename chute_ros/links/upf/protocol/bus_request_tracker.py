"""The bus requests of one link: begun, refused where they would endanger a flight, ended.

Source: Flyfire UPF UAVCAN protocol V1.0, "standard UAVCAN protocols" and "parameters".
"""

from __future__ import annotations

import math
from collections.abc import Callable

from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.bus_requests import BusRequest, BusRequestDone
from chute_ros.links.upf.protocol.device_table import DeviceTable
from chute_ros.links.upf.protocol.events import BusRequestFinished
from chute_ros.protocol.dronecan.bus_node import BusNode
from chute_ros.protocol.events import Severity

#: The parameters of a controller are read again after this, s: another tool may have changed them.
READ_AGAIN = 10.0


class BusRequestTracker:
    """Every bus request ends in one BusRequestFinished with its token."""

    def __init__(
        self,
        bus: BusNode,
        devices: DeviceTable,
        in_air: Callable[[float], bool],
        status_timeout: float,
    ) -> None:
        self._bus, self._devices, self._in_air = bus, devices, in_air
        self._status_timeout = status_timeout
        #: Controller -> when its parameters are to be read again.
        self._read_again: dict[int, float] = {}
        #: Controllers whose parameters are being read.
        self._reading: set[int] = set()
        self._finished: list[BusRequestFinished] = []

    def bus_request(
        self, token: int, node_id: int, make: Callable[[int], BusRequest], now: float
    ) -> None:
        """Ask something of a device. node_id 0: the chosen one."""
        target = self._target(node_id)
        if target:
            self._bus.begin(token, make(target), now)
        else:
            what = f"there is no node id {node_id}" if node_id else "no UPF device was received"
            self._refuse(token, node_id, f"{what} on this link; name a node id from 1 to 127")

    def set_parameter(
        self, token: int, node_id: int, name: str, text: str, force: bool, now: float
    ) -> None:
        """Set one and read it back; in the air it needs force, but for what only lights."""
        if name != p.LIGHT and self._in_air(now) and not force:
            why = (
                f"{name} may take the parachute away in the air; force does it all the same; "
                "nothing was sent"
            )
            self._refuse(token, node_id, why)
            return
        if name in p.PROTECTION and not p.switches_on(text):
            self._devices.notice(Severity.WARNING, f"{name} is being switched off")

        def make(target: int) -> BusRequest:
            return bus_requests.set_parameter(
                target, name, text, lambda: self._keeps(target), self._status_timeout
            )

        self.bus_request(token, node_id, make, now)

    def disturb(
        self, token: int, node_id: int, force: bool, make: Callable[[int], BusRequest], now: float
    ) -> None:
        """The same for what takes the device away for a while: in the air it needs force."""
        if self._in_air(now) and not force:
            why = "refused while the vehicle is in the air; force does it all the same"
            self._refuse(token, node_id, why)
        else:
            self.bus_request(token, node_id, make, now)

    def update(self, now: float) -> None:
        """Read the parameters of new controllers, and end what has ended."""
        for node_id in [n for n, due in self._read_again.items() if now >= due]:
            del self._read_again[node_id]
            controller = self._devices.controllers.get(node_id)
            if controller is not None and controller.alive:
                self._devices.to_read.append(controller)
        for controller in self._devices.to_read:
            if controller.node_id in self._reading:
                # One at a time; it is read once more when this one has ended.
                self._read_again[controller.node_id] = now + READ_AGAIN
                continue
            self._read_again.pop(controller.node_id, None)
            self._reading.add(controller.node_id)
            token = ("parameters", controller.node_id)
            self._bus.begin(token, bus_requests.list_parameters(controller.node_id), now)
        self._devices.to_read.clear()
        for ended, result in self._bus.take_ended():
            assert isinstance(result, BusRequestDone)
            self._end(ended, result, now)

    def next_deadline(self) -> float:
        """When update has something to do by itself; infinity: never."""
        return min(self._read_again.values(), default=math.inf)

    def take_finished(self) -> list[BusRequestFinished]:
        """What has ended; each is handed out once."""
        finished, self._finished = self._finished, []
        return finished

    # -- inside ----------------------------------------------------------------------------------

    def _target(self, node_id: int) -> int:
        """The node meant; 0: there is none."""
        device = self._devices.controller() or self._devices.trigger()
        target = node_id or (device.node_id if device is not None else 0)
        return target if 1 <= target <= 127 else 0

    def _keeps(self, node_id: int) -> bool | None:
        controller = self._devices.controllers.get(node_id)
        return None if controller is None else controller.switch(p.AUTO_SAVE)

    def _refuse(self, token: int, node_id: int, why: str) -> None:
        self._finished.append(BusRequestFinished(token, BusRequestDone(False, why, node_id)))

    def _end(self, token: object, done: BusRequestDone, now: float) -> None:
        controller = self._devices.controllers.get(done.node_id)
        if controller is not None:
            controller.parameters |= {one.name: one.value for one in done.parameters}
        if isinstance(token, int):
            self._finished.append(BusRequestFinished(token, done))
            return
        self._reading.discard(done.node_id)
        # A list that never ends is not begun again.
        if done.success or len(done.parameters) < bus_requests.MOST_PARAMETERS:
            self._read_again[done.node_id] = now + READ_AGAIN
