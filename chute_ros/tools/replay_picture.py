"""What was decided and what would have been, one below the other over the flight's height."""

from __future__ import annotations

import math

from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.state import State
from chute_ros.tools.recording import Recording
from chute_ros.tools.replaying import Outputs, told
from chute_ros.tools.timeline import close_up, draw
from chute_ros.tools.timeline_rows import (
    ACTION_TONES,
    STAGE_TONES,
    STYLE,
    Band,
    Curve,
    Mark,
    Marks,
    Row,
    Segment,
    Window,
)

_FIRED = ("KILL", "DEPLOY")


class Track:
    """The stages and decisions of one run of the core. name: which, in a word."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._segments: list[Segment] = []
        self._marks: list[Mark] = []

    def follow(self, seconds: float, state: State | None, outputs: Outputs) -> None:
        """After a turn. seconds: from the start."""
        for output in outputs:
            if isinstance(output, i.Decide) and not output.again:
                action = output.decision.action
                sign = action.name.replace("FLIGHT_", "").replace("BLOCK_RELEASE", "UNBLOCK")
                self._marks.append(Mark(seconds, sign, told(output), ACTION_TONES[action]))
        if state is None:
            return
        name = state.stage.name
        if self._segments:
            newest = self._segments[-1]
            self._segments[-1] = Segment(newest.start, seconds, newest.text, newest.tone)
            if newest.text == name:
                return
        self._segments.append(Segment(seconds, seconds, name, STAGE_TONES[state.stage]))

    def rows(self) -> list[Row]:
        """For a timeline."""
        return [
            Band(f"state, {self._name}", self._segments),
            Marks(f"decisions, {self._name}", self._marks),
        ]

    @property
    def fired(self) -> list[float]:
        """When it decided to kill or to deploy, s."""
        return [mark.at for mark in self._marks if mark.sign in _FIRED]


def picture(recording: Recording, before: Track, after: Track) -> str:
    """A whole SVG file."""
    rows = [*before.rows(), *after.rows(), *vehicle_curves(recording)]
    end = recording.seconds(recording.turns[-1].wall)
    windows = [Window("everything", 0.0, end), *close_up([*before.fired, *after.fired], end)]
    head, _, rest = draw(rows, windows, "recorded and replayed decisions").partition("\n")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{head}\n<style>{STYLE}</style>\n{rest}\n'


def vehicle_curves(recording: Recording) -> list[Row]:
    """Height and vertical speed as the core was told of them."""
    told_of = [
        (recording.seconds(one.wall), report.state)
        for one in recording.turns
        for report in one.turn.inputs
        if isinstance(report, i.VehicleReport)
    ]
    curves = (
        Curve("height", "m", [(at, state.height) for at, state in told_of]),
        Curve("vertical speed", "m/s", [(at, state.vertical_speed) for at, state in told_of]),
    )
    return [one for one in curves if any(math.isfinite(value) for _, value in one.points)]
