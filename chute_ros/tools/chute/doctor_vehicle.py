"""What can be wrong with a vehicle, by what was received of it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence

from chute_ros.ros.middleware_diagnostics import TASK, VERSION
from chute_ros.tools.chute.diagnostic_tasks import Task
from chute_ros.tools.chute.finding import NOTE, OK, WRONG, DoctorFinding
from chute_ros.tools.chute.hearing import ReceivedMessages

#: Half of max_decision_age: what a decision may be late by its clock alone, s.
CLOCKS_APART = 0.25
#: With this computer, which decides nothing, s.
HERE_APART = 1.0
MOST_TASKS_SHOWN = 10


def supervisor_findings(picture: ReceivedMessages, namespace: str) -> list[DoctorFinding]:
    """There is one that leads, and no more."""
    beats = [one.message for one in picture.heartbeats.values() if one.message.supervisor]
    leaders = sorted(one.link for one in beats if one.device_healthy)
    others = sorted(one.link for one in beats if not one.device_healthy)
    standby = f", standby: {', '.join(others)}" if others else ""
    if len(leaders) == 1:
        return [DoctorFinding(OK, f"supervisor of {namespace}: {leaders[0]}{standby}")]
    if leaders:
        text = f"{len(leaders)} supervisors lead in {namespace}: {', '.join(leaders)}"
        remedy = "end all but one, or give each a rank of its own and hot_standby: true"
        return [DoctorFinding(WRONG, text, remedy)]
    remedy = "start safety_supervisor in this namespace, or name another: --namespace"
    return [DoctorFinding(WRONG, f"no supervisor leads in {namespace}{standby}", remedy)]


def namesake_findings(nodes: Iterable[tuple[str, str]], namespace: str) -> list[DoctorFinding]:
    """Two nodes of one name. nodes: (name, namespace) of each in the graph."""
    counted = Counter(name for name, where in nodes if where == namespace)
    return [
        DoctorFinding(
            WRONG,
            f"{count} nodes are called {namespace.rstrip('/')}/{name}",
            "end all but one: they answer the same calls and publish the same topics",
        )
        for name, count in sorted(counted.items())
        if count > 1
    ]


def clock_findings(picture: ReceivedMessages) -> list[DoctorFinding]:
    """The wall clocks of the computers of the vehicle, and of this one."""
    ahead = {
        name: -difference
        for name in sorted(picture.heartbeats)
        if not math.isnan(difference := picture.clock_difference(name))
    }
    if not ahead:
        return []
    least, most = min(ahead, key=lambda n: ahead[n]), max(ahead, key=lambda n: ahead[n])
    remedy = "set the clocks of all computers by one NTP server (chrony)"
    if (apart := ahead[most] - ahead[least]) > CLOCKS_APART:
        text = f"clocks: that of {most} is {apart:.2f} s ahead of that of {least}"
        return [DoctorFinding(WRONG, text, remedy)]
    if abs(ahead[most]) > HERE_APART:
        text = f"clocks: those of the vehicle are {ahead[most]:+.1f} s to that of this computer"
        return [DoctorFinding(NOTE, text, remedy)]
    return [DoctorFinding(OK, f"clocks: {apart:.2f} s apart in the vehicle")]


def version_findings(
    picture: ReceivedMessages, tasks: Sequence[Task], here: str
) -> list[DoctorFinding]:
    """The nodes of the vehicle are of one version of chute_ros. here: that of this command."""
    # Others' nodes may be in the namespace as well; those of the vehicle send heartbeats.
    versions = dict.fromkeys(sorted(picture.heartbeats), "")
    versions |= {
        one.node: one.values[VERSION]
        for one in tasks
        if one.task == TASK and one.node in versions and VERSION in one.values
    }
    found = []
    if silent := [node for node, version in versions.items() if not version]:
        text = f"no version of chute_ros is received of {', '.join(silent)}"
        found.append(DoctorFinding(NOTE, text, "look whether it is an older one, and update it"))
    nodes_of: dict[str, list[str]] = {}
    for node, version in versions.items():
        if version:
            nodes_of.setdefault(version, []).append(node)
    told = "; ".join(f"{version} of {', '.join(nodes)}" for version, nodes in nodes_of.items())
    if len(nodes_of) > 1:
        remedy = "install one version on all computers of the vehicle and start its nodes again"
        found.append(DoctorFinding(WRONG, f"versions of chute_ros differ: {told}", remedy))
    elif nodes_of and here not in nodes_of:
        text = f"the vehicle has chute_ros {told}; this command is of {here}"
        found.append(DoctorFinding(NOTE, text, "use the command of the vehicle's version"))
    return found


def task_findings(tasks: Sequence[Task]) -> list[DoctorFinding]:
    """What the nodes themselves report as wrong."""
    bad = [one for one in tasks if one.level in ("ERROR", "STALE", "WARN")]
    found = [_task_finding(one) for one in bad[:MOST_TASKS_SHOWN]]
    if len(bad) > MOST_TASKS_SHOWN:
        left_out = len(bad) - MOST_TASKS_SHOWN
        found.append(DoctorFinding(WRONG, f"{left_out} more", "`chute diagnostics` lists them"))
    return found or [DoctorFinding(OK, f"diagnostics: {len(tasks)} tasks, none reports a fault")]


def _task_finding(one: Task) -> DoctorFinding:
    if not one.received:
        remedy = "it hangs, has died or was never started: look at its log, and start it again"
        return DoctorFinding(WRONG, f"{one.node}: no {one.task}: {one.message}", remedy)
    return DoctorFinding(
        NOTE if one.level == "WARN" else WRONG,
        f"{one.node} reports {one.level}: {one.task}: {one.message}",
        f"`chute diagnostics --all` shows its values{_page(one)}",
    )


def _page(task: Task) -> str:
    return "; docs/guide/security.md" if task.task == "middleware" else ""
