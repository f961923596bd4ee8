"""`chute record`: where the black box is, whether it records, and its newest files."""

from __future__ import annotations

import time

from chute_ros.plain_text import plain
from chute_ros.tools.chute.errors import CommandError
from chute_ros.tools.chute.gathering import gather
from chute_ros.tools.chute.json_text import json_text
from chute_ros.tools.chute.options import DONE, NOT_WELL, Chosen
from chute_ros.tools.chute.record_text import BLACK_BOX, box_lines, box_of, newest_files
from chute_ros.tools.chute.session import opened


def main(chosen: Chosen) -> int:
    """Exit code 0: every black box records all; 1: one does not, or none was received."""
    within = chosen.wait()
    with opened(chosen.namespace) as session:
        tasks = gather(session, within)
        if not tasks:
            raise session.not_heard("no diagnostics are received", within)
    now = time.time()
    boxes = [
        box_of(one, newest_files(one.values.get("file", ""), now))
        for one in tasks
        if one.task == BLACK_BOX
    ]
    if not boxes:
        nodes = ", ".join(sorted({one.node for one in tasks if one.received}))
        raise CommandError(
            f"no black box in {chosen.namespace}: the supervisor is not received, or its "
            f"parameter black_box is false (nodes received: {nodes})"
        )
    if chosen.json:
        print(json_text({"namespace": chosen.namespace, "black_boxes": boxes}))
    else:
        print("\n".join(plain(line) for box in boxes for line in box_lines(box)))
    return DONE if all(box.recording for box in boxes) else NOT_WELL
