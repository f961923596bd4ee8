"""Writes one HTML page of each recorded flight. A page needs no other file.

It has each release of a parachute, the timeline of the links, states, height and speed, the rules
and their counters, and the decisions with their reasons and outcomes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from chute_msgs.msg import PersonRequest, SafetyDecision, SafetyState

from chute_ros.ros.supervisor_messages import state_message
from chute_ros.runtime.topics import safety_told
from chute_ros.tools.flight_story import DECISION, PERSON, tell
from chute_ros.tools.progress import Progress
from chute_ros.tools.recording import Recording, read
from chute_ros.tools.recording_options import write_pages
from chute_ros.tools.releases import releases
from chute_ros.tools.replay_picture import vehicle_curves
from chute_ros.tools.replaying import Replayer
from chute_ros.tools.report_page import page
from chute_ros.tools.state_rows import rules_of, state_rows
from chute_ros.tools.timeline import close_up, draw
from chute_ros.tools.timeline_rows import Marks, Row, Window

STATE = "safety/state"
#: Pictures between which nothing came out of the core are this far apart, s; but never so many
#: that nobody could see them all.
_APART, _MOST = 0.05, 20_000


def main() -> None:
    """Exit code 0: written; 2: a recording cannot be read, or a page cannot be written."""
    write_pages("report", __doc__, ".html", report)


def report(files: list[Path]) -> str:
    """The page of these files; RecordError if they cannot be read."""
    kinds = {STATE: SafetyState, DECISION: SafetyDecision, PERSON: PersonRequest}
    recording = read(files, kinds)
    story = tell(recording)
    published = recording.messages.get(STATE, [])
    states = replayed_states(recording) or [
        (recording.seconds(wall), state) for wall, state in published
    ]
    rows: list[Row] = [
        *state_rows(states),
        Marks("decisions", story.decision_marks()),
        Marks("outcomes", story.report_marks()),
        Marks("alarms", story.alarm_marks()),
        *vehicle_curves(recording),
    ]
    end = recording.seconds(recording.turns[-1].wall)
    windows = [Window("the whole recording", 0.0, end), *close_up(story.fired, end)]
    title = f"Flight report: {files[0].name}"
    if len(files) > 1:
        title += f" and {len(files) - 1} more"
    timeline = draw(rows, windows, title)
    return page(title, recording, story, releases(story, end), rules_of(states), timeline)


def replayed_states(recording: Recording) -> list[tuple[float, Any]]:
    """(s from the start, SafetyState) by deciding once more what was recorded; nothing from what
    cannot be replayed."""
    core = Replayer()
    apart = max(_APART, recording.seconds(recording.turns[-1].wall) / _MOST)
    progress = Progress("replaying", len(recording.turns))
    pictures: list[tuple[float, Any]] = []
    for number, turn in enumerate(recording.turns):
        progress.at(number)
        outputs = core.step(turn)
        if outputs is None or core.state is None or core.config is None:
            continue
        at = recording.seconds(turn.wall)
        if outputs or not pictures or not 0.0 <= at - pictures[-1][0] < apart:
            told = safety_told(core.config, "", core.state, {}, turn.turn.now)
            picture = state_message(core.config, told, Time())
            pictures.append((at, picture))
    return pictures
