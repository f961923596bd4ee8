"""The supervisor's picture at every moment of a recording, not only when it was published."""

from __future__ import annotations

from typing import Any

from builtin_interfaces.msg import Time

from chute_ros.ros.supervisor_messages import state_message
from chute_ros.runtime.topics import SafetyTold
from chute_ros.tools.progress import Progress
from chute_ros.tools.recording import Recording
from chute_ros.tools.replaying import Replayer

#: Pictures between which nothing came out of the core are this far apart, s; but never so many
#: that nobody could see them all.
_APART, _MOST = 0.05, 20_000


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
            told = SafetyTold("", core.state, {}, turn.turn.now)
            picture = state_message(core.config, told, Time())
            pictures.append((at, picture))
    return pictures
