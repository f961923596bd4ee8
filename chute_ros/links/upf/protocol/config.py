"""Settings of one UPF link. Times in s; node ids 1 to 127, 0: any."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from chute_ros.errors import ParameterError
from chute_ros.protocol.dronecan.bus_config import BusNodeConfig
from chute_ros.protocol.dronecan.calls import CallLimits
from chute_ros.protocol.effect import EffectLimits
from chute_ros.protocol.liveness import LivenessLimits

#: Ours: far from autopilots (PX4 1, ArduPilot 10), from devices with low static ids, from those
#: given out from 125 downwards and from the tools' own 126 and 127.
NODE_ID = 100
#: As delivered (document, "node discovery"); never given out by the allocator.
CONTROLLER_NODE_ID, TRIGGER_NODE_ID = 33, 34
#: Of a node's name (uavcan.protocol.GetNodeInfo).
MOST_NAME_BYTES = 80


class Policy(enum.Enum):
    """Handling of a device's request to the vehicle."""

    #: To the supervisor; success once it has happened.
    FORWARD = "forward"
    #: To the supervisor as well; success at once, whatever comes of it.
    ACCEPT = "accept"
    #: Rejected, and nobody is told.
    REJECT = "reject"


@dataclass(frozen=True)
class UpfConfig:
    """Settings of a UpfLink."""

    node_id: int = NODE_ID
    node_name: str = "org.chute_ros.upf_can"
    unique_id: bytes = bytes(16)
    #: The controller and trigger that are ours; 0: the first ones heard.
    controller_node_id: int = 0
    trigger_node_id: int = 0
    #: The vehicle has no controller: the trigger is the parachute.
    without_controller: bool = False
    liveness: LivenessLimits = field(default=LivenessLimits(1.5, 3.0))
    status_timeout: float = 1.5
    calls: CallLimits = field(default=CallLimits())
    #: A controller that acknowledges a deploy may not have reached its trigger: told again soon.
    effect: EffectLimits = field(default=EffectLimits(0.5, 0.25, 5.0))
    #: A deploy that the controller has not acknowledged by then goes to the triggers directly.
    last_resort: bool = True
    last_resort_after: float = 1.0
    kill_policy: Policy = Policy.FORWARD
    flight_block_policy: Policy = Policy.FORWARD
    #: How long a device's request may take to happen before it is answered with a failure.
    vehicle_service_timeout: float = 0.8
    vehicle_status_interval: float = 0.1
    #: Parts of vehicle/state that are older are told as not known.
    vehicle_state_age: float = 1.0
    allocator: bool = True
    #: To another allocator on the bus, as an autopilot is one.
    allocator_yields: bool = True
    allocation_table: Mapping[bytes, int] = field(default_factory=dict)
    time_master: bool = True
    #: UTC minus monotonic time at the start.
    utc_offset: float = 0.0

    def __post_init__(self) -> None:
        if len(self.unique_id) != 16:
            raise ParameterError(f"unique_id has {len(self.unique_id)} bytes: need 16")
        if not 1 <= len(self.node_name.encode("utf-8", "replace")) <= MOST_NAME_BYTES:
            raise ParameterError(
                f"node_name is {self.node_name!r}: need 1 to {MOST_NAME_BYTES} bytes"
            )
        if not 1 <= self.node_id <= 127:
            raise ParameterError(f"node_id is {self.node_id}: need 1 to 127")
        for name in ("controller_node_id", "trigger_node_id"):
            value = getattr(self, name)
            if not 0 <= value <= 127:
                raise ParameterError(f"{name} is {value}: need 0 (any) to 127")
            if value == self.node_id:
                raise ParameterError(
                    f"{name} and node_id are both {value}: a node id belongs to one node; "
                    "choose another node_id"
                )
        for name in (
            "status_timeout",
            "last_resort_after",
            "vehicle_service_timeout",
            "vehicle_status_interval",
            "vehicle_state_age",
        ):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ParameterError(f"{name} is {getattr(self, name)}: need a time above 0 s")

    def bus(self) -> BusNodeConfig:
        """Who we are on the bus."""
        never = (
            CONTROLLER_NODE_ID,
            TRIGGER_NODE_ID,
            self.controller_node_id,
            self.trigger_node_id,
        )
        return BusNodeConfig(
            node_id=self.node_id,
            name=self.node_name,
            unique_id=self.unique_id,
            calls=self.calls,
            allocator=self.allocator,
            allocator_yields=self.allocator_yields,
            table=self.allocation_table,
            never=never,
            time_master=self.time_master,
            utc_offset=self.utc_offset,
        )
