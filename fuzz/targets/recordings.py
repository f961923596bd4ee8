"""What is read with ROS: a whole black box, and a ROS parameter file."""

from __future__ import annotations

import json
from pathlib import Path

from chute_ros.errors import ChuteError, RecordError
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.record import CODEC, CoreTurn
from chute_ros.supervisor.state import State
from chute_ros.tools.parameter_file import other_from
from chute_ros.tools.recording import RecordedTurn, read
from chute_ros.tools.replaying import Replayer, require_replayable
from fuzz.plain_json import NOW, anything
from fuzz.program import Program
from fuzz.target import Target, WrongError
from fuzz.targets.files import InFile, Reading


def _recording(path: Path) -> None:
    """Read it, and decide it once more."""
    recording = read([path], {})
    require_replayable(recording.turns)
    replayer = Replayer()
    for turn in recording.turns:
        replayer.step(turn)


def _turns(data: bytes) -> None:
    """Turns of the core, replayed from its start, with inputs of the right classes and any values.

    A state that contradicts itself is not among them: a replay may end with whatever the core
    makes of it.
    """
    program, replayer, now = Program(data), Replayer(), NOW
    begin: State | None = State(7, NOW)
    number = 0
    while not program.over:
        now += program.choice((0.0, 0.1, 1.0, 10.0))
        inputs = []
        for _ in range(program.byte() % 4):
            try:
                inputs.append(CODEC.from_json(json.dumps(anything(program)), i.Input))
            except RecordError:
                pass  # the others may be good
        number += 1
        turn = CoreTurn(now, tuple(inputs), ())
        try:
            replayer.step(RecordedTurn(0, number, turn, SupervisorConfig(), begin))
        except ChuteError as error:
            raise WrongError(f"the core: {error}") from error
        begin = None


TARGETS = (
    Target("recordings.turns", "recorded turns, replayed", lambda: Reading(_turns), 0),
    Target(
        "recordings.box", "a black box, replayed", lambda: InFile("fuzz.mcap", _recording), 0, 8192
    ),
    Target(
        "recordings.parameters",
        "the parameter file of a replay",
        lambda: InFile("fuzz.yaml", lambda path: other_from(path, "/fuzz/safety_supervisor")),
        0,
        4096,
    ),
)
