"""Settings of a UPF link."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field

from chute_ros.errors import ParameterError
from chute_ros.protocol.dronecan.bus_node import MOST_NAME_BYTES, BusNodeConfig
from chute_ros.protocol.dronecan.calls import CallLimits
from chute_ros.protocol.dronecan.transfer import HIGHEST_NODE_ID
from chute_ros.protocol.goal import Commanded, EffectLimits
from chute_ros.protocol.liveness import LivenessLimits
from chute_ros.settings import Settings, nested, parameter

#: Ours: far from autopilots (PX4 1, ArduPilot 10), from devices with low static ids, from those
#: given out from 125 downwards and from the tools' own 126 and 127.
NODE_ID = 100
#: As delivered (document, "node discovery"); never given out by the allocator.
CONTROLLER_NODE_ID, TRIGGER_NODE_ID = 33, 34


class Policy(enum.Enum):
    """Handling of a device's request to the vehicle."""

    #: To the supervisor; success once it has happened.
    FORWARD = "forward"
    #: To the supervisor as well; success at once, whatever comes of it.
    ACCEPT = "accept"
    #: Rejected, and nobody is told.
    REJECT = "reject"


class AllocatorUse(enum.Enum):
    """Whether node ids are given to the nodes that ask for one."""

    #: Until another node on the bus does.
    AUTO = "auto"
    YES = "true"
    NO = "false"


@dataclass(frozen=True)
class UpfConfig(Commanded, Settings):
    """Settings of a UpfLink. utc_offset: UTC minus monotonic time at the start, s."""

    node_id: int = parameter(
        NODE_ID,
        "DroneCAN node id of this node; no other node may have it (ArduPilot has 10, PX4 1)",
        1,
        HIGHEST_NODE_ID,
    )
    node_name: str = "org.chute_ros.upf_can"
    unique_id: bytes = bytes(16)
    controller_node_id: int = parameter(0, "node id of the controller; 0: any", 0, HIGHEST_NODE_ID)
    trigger_node_id: int = parameter(0, "node id of the trigger; 0: any", 0, HIGHEST_NODE_ID)
    without_controller: bool = parameter(
        False, "the vehicle has no controller: its trigger is the parachute and is fired directly"
    )
    liveness: LivenessLimits = nested(LivenessLimits(1.5, 3.0), "device")
    status_timeout: float = parameter(
        1.5, "a ParachuteStatus older than this is a fault", 0.05, 600.0, "s"
    )
    calls: CallLimits = nested(CallLimits(), "call")
    #: A controller that acknowledges a deploy may not have reached its trigger: told again soon.
    effect: EffectLimits = nested(EffectLimits(0.5, 0.25, 5.0))
    last_resort: bool = parameter(
        True, "send a deploy that the controller does not answer to the triggers directly"
    )
    last_resort_after: float = parameter(
        1.0, "wait for the controller's answer to a deploy before last_resort", 0.05, 60.0, "s"
    )
    kill_policy: Policy = parameter(
        Policy.FORWARD,
        "reaction to the device's TYPE_KILLSWITCH: forward asks the supervisor and answers "
        "success once the kill is confirmed; accept asks it and answers success at once; reject "
        "does neither",
        name="killswitch_policy",
    )
    flight_block_policy: Policy = parameter(
        Policy.FORWARD,
        "reaction to the device's TYPE_FLIGHT_BLOCK and TYPE_FLIGHT_BLOCK_RELEASE, as "
        "killswitch_policy",
    )
    vehicle_service_timeout: float = parameter(
        0.8,
        "a request of the device fails if it is not fulfilled within this time",
        0.05,
        60.0,
        "s",
    )
    vehicle_status_rate: float = parameter(
        10.0, "rate of VehicleStatus on the bus", 0.1, 100.0, "Hz"
    )
    vehicle_state_age: float = parameter(
        1.0,
        "parts of vehicle/state older than this are sent to the device as unknown",
        0.05,
        60.0,
        "s",
    )
    allocator: AllocatorUse = parameter(
        AllocatorUse.AUTO,
        "give node ids to the nodes that ask for one; auto: only while no other node on the bus, "
        "such as an autopilot, does",
    )
    allocation_table: Mapping[bytes, int] = field(default_factory=dict)
    time_master: bool = parameter(True, "send the time to the bus (GlobalTimeSync)")
    utc_offset: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.unique_id) != 16:
            raise ParameterError(f"unique_id has {len(self.unique_id)} bytes: need 16")
        if not 1 <= len(self.node_name.encode("utf-8", "replace")) <= MOST_NAME_BYTES:
            raise ParameterError(
                f"node_name is {self.node_name!r}: need 1 to {MOST_NAME_BYTES} bytes"
            )
        for name in ("controller_node_id", "trigger_node_id"):
            if getattr(self, name) == self.node_id:
                why = "a node id belongs to one node; choose another node_id"
                raise self.contradiction(why, name, "node_id")

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
            allocator=self.allocator is not AllocatorUse.NO,
            allocator_yields=self.allocator is AllocatorUse.AUTO,
            table=self.allocation_table,
            never=never,
            time_master=self.time_master,
            utc_offset=self.utc_offset,
        )
