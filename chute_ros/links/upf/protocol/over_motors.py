"""Whether a parachute was released over motors that are known to turn, which tear its lines."""

from __future__ import annotations

from dataclasses import replace

from chute_ros.links.upf.protocol.roster import UpfDevices
from chute_ros.links.upf.protocol.vehicle_service import VehicleService
from chute_ros.links.upf.protocol.vehicle_status import Vehicle
from chute_ros.protocol.effect import EffectFinished
from chute_ros.protocol.events import Severity


class OverMotors:
    """Knows the deploys under way, and says it in the answer to each."""

    def __init__(self, vehicle: Vehicle, service: VehicleService, devices: UpfDevices) -> None:
        self._vehicle, self._service, self._devices = vehicle, service, devices
        self._deploys: set[int] = set()

    def begin(self, token: int) -> None:
        """This request releases the parachute."""
        self._deploys.add(token)

    def end(self, finished: EffectFinished, now: float) -> EffectFinished:
        """The end of any request; of a deploy that was sent while the motors turn, with that."""
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
