"""Topics in the black box besides the core's turns: every topic of the contract."""

from __future__ import annotations

from typing import Any

from chute_msgs.msg import (
    ActionReport,
    LinkHeartbeat,
    ParachuteStatus,
    PersonRequest,
    SafetyDecision,
    SafetyRequest,
    SafetyState,
    SupervisorLease,
    SupervisorRecord,
    Telem,
    TriggerStatus,
    VehicleState,
)
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from chute_ros.ros import qos
from chute_ros.ros.box_writer import RECORD
from chute_ros.ros.mcap_file import Topic

#: What the supervisor hears or says anyhow.
_OWN: dict[str, tuple[Any, Any]] = {
    "safety/heartbeat": (LinkHeartbeat, qos.STATUS),
    "parachute/status": (ParachuteStatus, qos.STATUS),
    "safety/request": (SafetyRequest, qos.STATUS),
    "safety/action": (ActionReport, qos.DECISION),
    "safety/decision": (SafetyDecision, qos.DECISION),
    "safety/state": (SafetyState, qos.LATCHED),
}
#: What is heard only to be kept, or elsewhere as well.
BESIDES: dict[str, tuple[Any, Any]] = {
    "vehicle/state": (VehicleState, qos.STATUS),
    "safety/person": (PersonRequest, qos.STATUS),
    "safety/lease": (SupervisorLease, qos.STATUS),
    "upf/trigger_status": (TriggerStatus, qos.STATUS),
    "umbilical/telem": (Telem, qos.STATUS),
    # Of this vehicle; /diagnostics are those of all.
    "diagnostics": (DiagnosticArray, qos.STATUS),
}


def recorded_topics(node: Node) -> dict[str, Topic]:
    """Every topic of a black box: relative name -> with its whole name as seen from node."""
    every = {RECORD: (SupervisorRecord, qos.DECISION), **_OWN, **BESIDES}
    return {
        name: Topic(node.resolve_topic_name(name), kind, profile)
        for name, (kind, profile) in every.items()
    }
