"""The parameters of upf_can and what they become."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from chute_ros.links.upf.protocol.config import NODE_ID, Policy, UpfConfig
from chute_ros.nodes.parameters import liveness_from
from chute_ros.protocol.dronecan.calls import CallLimits
from chute_ros.protocol.effect import EffectLimits
from chute_ros.settings import Parameter
from chute_ros.transport.can_address import CAN_FORMS

_POLICIES = tuple(policy.value for policy in Policy)

PARAMETERS = (
    Parameter("connection", "mcast:0", f"where the CAN bus is: {CAN_FORMS}"),
    Parameter("bitrate", 0, "of the bus, bit/s; 0: as the interface is set up", 0, 8_000_000),
    Parameter(
        "dsdl_path",
        "",
        "folder flyfire with the vendor's own data types (*.uavcan); empty: the ones shipped",
    ),
    Parameter(
        "node_id",
        NODE_ID,
        "our own DroneCAN node id; no other node's (ArduPilot has 10, PX4 1)",
        1,
        127,
    ),
    Parameter("controller_node_id", 0, "node id of our controller; 0: any", 0, 127),
    Parameter("trigger_node_id", 0, "node id of our trigger; 0: any", 0, 127),
    Parameter(
        "without_controller",
        False,
        "the vehicle has no controller: its trigger is the parachute and is fired directly",
    ),
    Parameter("device_stale_after", 1.5, "device silent for this long is STALE, s", 0.05, 600.0),
    Parameter("device_lost_after", 3.0, "device silent for this long is LOST, s", 0.05, 600.0),
    Parameter("status_timeout", 1.5, "ParachuteStatus older than this is a fault, s", 0.05, 600.0),
    Parameter("call_timeout", 0.25, "wait for a response before sending again, s", 0.02, 60.0),
    Parameter("call_tries", 3, "how often a request is sent at most", 1, 7),
    Parameter(
        "effect_timeout",
        0.5,
        "from acknowledgement to effect, then the request is tried again, s",
        0.05,
        60.0,
    ),
    Parameter("retry_interval", 0.25, "between two tries, and between two looks, s", 0.02, 60.0),
    Parameter("give_up_after", 5.0, "for all tries of a request together, s", 0.1, 600.0),
    Parameter(
        "decided_deploy_forces",
        True,
        "a deploy that the supervisor decided is sent as TYPE_DEPLOY_FORCE",
    ),
    Parameter(
        "last_resort",
        True,
        "a deploy that the controller does not answer goes to the triggers directly",
    ),
    Parameter(
        "last_resort_after", 1.0, "how long the controller has to answer a deploy, s", 0.05, 60.0
    ),
    Parameter(
        "killswitch_policy",
        "forward",
        "what becomes of the device's TYPE_KILLSWITCH: forward asks the supervisor and answers "
        "success once the kill is confirmed, accept asks and answers success at once, reject "
        "does neither",
        choices=_POLICIES,
    ),
    Parameter(
        "flight_block_policy",
        "forward",
        "the same for TYPE_FLIGHT_BLOCK and TYPE_FLIGHT_BLOCK_RELEASE",
        choices=_POLICIES,
    ),
    Parameter(
        "vehicle_service_timeout",
        0.8,
        "what the device asked for must have happened by then, or it is told a failure, s",
        0.05,
        60.0,
    ),
    Parameter("vehicle_status_rate", 10.0, "rate of VehicleStatus on the bus, Hz", 0.1, 100.0),
    Parameter(
        "vehicle_state_age",
        1.0,
        "parts of vehicle/state that are older are told to the device as not known, s",
        0.05,
        60.0,
    ),
    Parameter(
        "allocator",
        "auto",
        "give node ids to the nodes that ask for one; auto: only while no other node on the bus "
        "does, as an autopilot",
        choices=("auto", "true", "false"),
    ),
    Parameter(
        "allocation_table_file",
        "",
        "where the node ids given out are kept; empty: under ROS_HOME (~/.ros)/chute_ros",
    ),
    Parameter("time_master", True, "tell the bus the time (GlobalTimeSync)"),
)


def config_from(
    values: Mapping[str, Any], table: Mapping[bytes, int], node_name: str, utc_offset: float
) -> UpfConfig:
    """The settings of the protocol; ParameterError where two parameters contradict each other.

    node_name: fully qualified; utc_offset: UTC minus monotonic time, s.
    """
    return UpfConfig(
        node_id=values["node_id"],
        unique_id=_unique_id(node_name),
        controller_node_id=values["controller_node_id"],
        trigger_node_id=values["trigger_node_id"],
        without_controller=values["without_controller"],
        liveness=liveness_from(values, "device"),
        status_timeout=values["status_timeout"],
        calls=CallLimits(values["call_timeout"], values["call_tries"]),
        effect=EffectLimits(
            values["effect_timeout"], values["retry_interval"], values["give_up_after"]
        ),
        last_resort=values["last_resort"],
        last_resort_after=values["last_resort_after"],
        kill_policy=Policy(values["killswitch_policy"]),
        flight_block_policy=Policy(values["flight_block_policy"]),
        vehicle_service_timeout=values["vehicle_service_timeout"],
        vehicle_status_interval=1.0 / values["vehicle_status_rate"],
        vehicle_state_age=values["vehicle_state_age"],
        allocator=values["allocator"] != "false",
        allocator_yields=values["allocator"] == "auto",
        allocation_table=table,
        time_master=values["time_master"],
        utc_offset=utc_offset,
    )


def _unique_id(node_name: str) -> bytes:
    """Sixteen bytes that are the same at each start, and of this node on this machine alone."""
    machine = Path("/etc/machine-id")
    text = machine.read_text() if machine.is_file() else ""
    return sha256(f"chute_ros {text} {node_name}".encode()).digest()[:16]
