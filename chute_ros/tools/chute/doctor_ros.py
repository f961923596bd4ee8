"""Asks ROS for all that the doctor looks at."""

from __future__ import annotations

from collections.abc import Sequence

from chute_ros.ros.own_version import own_version
from chute_ros.tools.chute.diagnostic_tasks import Task
from chute_ros.tools.chute.doctor_ports import connection_finding, trouble_here
from chute_ros.tools.chute.doctor_vehicle import (
    clock_findings,
    namesake_findings,
    supervisor_findings,
    task_findings,
    version_findings,
)
from chute_ros.tools.chute.finding import NOTE, WRONG, DoctorFinding
from chute_ros.tools.chute.gathering import gather
from chute_ros.tools.chute.listening import Listening
from chute_ros.tools.chute.node_parameters import nodes, parameters_of_node
from chute_ros.tools.chute.record_text import BLACK_BOX
from chute_ros.tools.chute.session import ChuteSession, opened

_START = (
    "start the vehicle with the same ROS_DOMAIN_ID; from another computer both sides need "
    "ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET (vehicle.launch.py range:=SUBNET)"
)


def vehicle_findings(namespace: str, seconds: float) -> tuple[list[DoctorFinding], str]:
    """Of the vehicle in this namespace, and the file of its black box (empty: none)."""
    with opened(namespace) as session:
        listening = Listening(session)
        if not session.until(lambda: listening.picture.heartbeats, seconds):
            nothing = session.looked_for("no node is received", seconds)
            return [DoctorFinding(WRONG, nothing, _START)], ""
        tasks = gather(session, seconds, listening)
        found = supervisor_findings(listening.picture, namespace)
        graph = session.node.get_node_names_and_namespaces()
        found += namesake_findings(graph, namespace)
        found += clock_findings(listening.picture)
        found += version_findings(listening.picture, tasks, own_version())
        found += _connections(session, tasks, seconds)
        # The wire of each node was told of with its connection.
        found += task_findings([one for one in tasks if one.task != "link"])
        boxes = [one.values.get("file", "") for one in tasks if one.task == BLACK_BOX]
    return found, boxes[0] if boxes else ""


def _connections(
    session: ChuteSession, tasks: Sequence[Task], seconds: float
) -> list[DoctorFinding]:
    found = []
    for node in nodes(session, None, seconds):
        values = parameters_of_node(session, node, seconds)
        if values is None:
            text = f"{node} does not answer for its parameters within {seconds:g} s"
            found.append(DoctorFinding(NOTE, text, f"`chute parameters {node}` tries again"))
        elif connection := values.get("connection"):
            link = next((one for one in tasks if (one.node, one.task) == (node, "link")), None)
            found.append(connection_finding(node, str(connection), link, trouble_here))
    return found
