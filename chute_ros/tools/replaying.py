"""Decides once more what was recorded, and finds what comes out differently."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from chute_ros.errors import RecordError
from chute_ros.model import Action, Decision
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.record import CODEC
from chute_ros.supervisor.state import State
from chute_ros.tools.recording import RecordedTurn

Outputs = tuple[i.Output, ...]


@dataclass(frozen=True)
class Other:
    """Other settings than the recorded ones. mode: at the start; None: as it was."""

    config: SupervisorConfig
    mode: i.Mode | None = None


class Replayer:
    """The core, turn by turn over a recording. other: what it shall do differently; None: nothing,
    then what it remembers is compared with what was recorded of it, too."""

    def __init__(self, other: Other | None = None) -> None:
        self._other = other
        self._answers = _Answers()
        self._last = 0
        #: Its settings and what it remembers now; None: that cannot be told.
        self.config: SupervisorConfig | None = None
        self.state: State | None = None
        #: Turns that could not be replayed: what came before them is missing.
        self.skipped = 0
        #: Wall clocks (Unix ns) at which it remembered something else than was recorded.
        self.strayed: list[int] = []

    def step(self, recorded: RecordedTurn) -> Outputs | None:
        """What comes out of this turn now; None: it cannot be replayed."""
        follows = self.state is not None and recorded.number == self._last + 1
        self._last = recorded.number
        if recorded.state is not None and recorded.config is not None:
            self._begin(recorded.wall, recorded.config, recorded.state, follows)
        elif not follows:
            self.state = None
        if self.state is None or self.config is None:
            self.skipped += 1
            return None
        turn = recorded.turn
        inputs = turn.inputs
        if self._other is not None:
            inputs = tuple(self._answers.translated(one) for one in inputs)
        self.state, outputs = update(self.config, self.state, inputs, turn.now)
        if self._other is not None:
            self._answers.learn(turn.outputs, outputs)
        return outputs

    def _begin(self, wall: int, config: SupervisorConfig, state: State, follows: bool) -> None:
        if self._other is None:
            if follows and _text(state) != _text(self.state):
                self.strayed.append(wall)
            self.config, self.state = config, state
        elif not follows:
            self.config, self.state = self._other.config, state
            if self._other.mode is not None:
                self.state = replace(state, mode=self._other.mode)


class _Answers:
    """With other settings the same decision may have another number, and the recorded answers of
    the devices name the recorded one: they are given to the newest replayed decision of the same
    action. Answers to what was not decided this time are answers to nothing."""

    def __init__(self) -> None:
        self._actions: dict[tuple[int, int], Action] = {}
        self._newest: dict[Action, tuple[int, int]] = {}

    def learn(self, recorded: Outputs, replayed: Outputs) -> None:
        """Take note of the decisions of a turn."""
        for decision in _decisions(recorded):
            self._actions[decision.epoch, decision.id] = decision.action
        for decision in _decisions(replayed):
            self._newest[decision.action] = (decision.epoch, decision.id)

    def translated(self, one: i.Input) -> i.Input:
        """An answer with the numbers of the replay; everything else as it is."""
        if not isinstance(one, i.ActionReport):
            return one
        epoch, number = self._of(one.epoch, one.id)
        newest_epoch, newest = self._of(one.newest_epoch, one.newest_id)
        return replace(one, epoch=epoch, id=number, newest_epoch=newest_epoch, newest_id=newest)

    def _of(self, epoch: int, number: int) -> tuple[int, int]:
        action = self._actions.get((epoch, number))
        if action is None:
            return epoch, number  # of another supervisor, or before the recording
        return self._newest.get(action, (epoch, 0))


@dataclass(frozen=True)
class Row:
    """A moment at which something was decided or said as an alarm: then, and now. What is empty
    was not. wall: Unix ns; reasons: why, one each; same: no difference that counts."""

    wall: int
    recorded: str
    replayed: str
    recorded_reasons: tuple[str, ...] = ()
    replayed_reasons: tuple[str, ...] = ()
    same: bool = True


def rows(recorded: RecordedTurn, replayed: Outputs, exact: bool) -> Iterator[Row]:
    """What is to be told of a turn. exact: every output counts, to the last bit; otherwise the
    decisions, whatever their numbers and reasons, and the alarms."""
    before = [one for one in recorded.turn.outputs if exact or _counts(one)]
    now = [one for one in replayed if exact or _counts(one)]
    for old, new in itertools.zip_longest(before, now):
        same = _text(old) == _text(new) if exact else _essence(old) == _essence(new)
        if not same or any(map(_counts, (old, new))):
            yield Row(recorded.wall, told(old), told(new), _reasons(old), _reasons(new), same)


def told(output: i.Output | None) -> str:
    """An output in a few words; empty: none."""
    if output is None:
        return ""
    if isinstance(output, i.Decide):
        decision = output.decision
        again = " again" if output.again else ""
        shadow = " (SHADOW)" if decision.shadow else ""
        targets = ", ".join(decision.targets) or "nobody"
        return (
            f"{decision.action.name}{shadow}{again}, {decision.named}, by "
            f"'{decision.rule}' to {targets}"
        )
    if isinstance(output, i.LogMessage):
        return f"{'alarm' if output.alarm else 'log'}: {output.text}"
    return CODEC.to_json(output)


def require_replayable(recorded: Iterable[RecordedTurn]) -> None:
    """RecordError where no turn has what a replay begins with."""
    if not any(one.state is not None for one in recorded):
        raise RecordError("cannot be replayed: the state at its beginning is missing")


def _counts(output: i.Output | None) -> bool:
    if isinstance(output, i.Decide):
        return not output.again
    return isinstance(output, i.LogMessage) and output.alarm


def _essence(output: i.Output | None) -> object:
    if isinstance(output, i.Decide):
        decision = output.decision
        return decision.action, decision.rule, decision.targets, decision.shadow
    return told(output)


def _reasons(output: i.Output | None) -> tuple[str, ...]:
    return output.decision.reasons if isinstance(output, i.Decide) else ()


def _decisions(outputs: Outputs) -> Iterator[Decision]:
    return (one.decision for one in outputs if isinstance(one, i.Decide))


def _text(value: object) -> str:
    """To the last bit: numbers that are equal may differ, as 0 and -0.0 do."""
    return "" if value is None else CODEC.to_json(value, whole=True)
