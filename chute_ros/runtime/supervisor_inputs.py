"""Messages to the supervisor, as inputs of its core."""

from __future__ import annotations

from typing import Any

from chute_ros.protocol.events import SafetyAsk
from chute_ros.runtime.topics import ActionTold, DeviceBeat, DeviceRequest
from chute_ros.supervisor import inputs


def input_of(one: Any, difference: float) -> inputs.Input:
    """difference: the wall clock here less its stamp, s; NaN: it has none."""
    if isinstance(one, DeviceBeat):
        return inputs.LinkHeartbeat(
            one.link,
            one.link_state,
            one.device_healthy,
            one.seq,
            difference,
            one.reasons,
            one.behind,
        )
    if isinstance(one, ActionTold):
        return one.report
    if isinstance(one, DeviceRequest):
        return _asked(one)
    told: inputs.ParachuteReport | inputs.VehicleReport = one
    return told


def _asked(one: DeviceRequest) -> inputs.Input:
    if one.ask is SafetyAsk.KILL:
        return inputs.KillRequest(0, f"{one.link} {one.device}".strip(), one.reason)
    block = one.ask is SafetyAsk.FLIGHT_BLOCK
    return inputs.BlockRequest(one.link, one.device, block, one.reason)
