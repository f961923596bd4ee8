"""`chute diagnostics`: how the nodes of the vehicle are, worst first."""

from __future__ import annotations

from chute_ros.tools.chute.diagnostic_tasks import NOT_WELL_LEVELS, task_lines
from chute_ros.tools.chute.gathering import gather
from chute_ros.tools.chute.json_text import json_text
from chute_ros.tools.chute.options import DONE, NOT_WELL, Chosen
from chute_ros.tools.chute.session import opened


def main(chosen: Chosen) -> int:
    """Exit code 0: all OK or WARN; 1: an ERROR, or something is STALE, or none was received."""
    within = chosen.wait()
    with opened(chosen.namespace) as session:
        tasks = gather(session, within)
        if not tasks:
            raise session.not_heard("no diagnostics are received", within)
    if chosen.json:
        print(json_text({"namespace": chosen.namespace, "tasks": tasks}))
    else:
        print("\n".join(task_lines(tasks, chosen.more.all)))
    return NOT_WELL if any(one.level in NOT_WELL_LEVELS for one in tasks) else DONE
