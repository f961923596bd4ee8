"""What one supervisor tells the others of its state, up to one that takes over with it."""

from __future__ import annotations

import dataclasses
import functools
import json
from pathlib import Path
from typing import Any

from chute_ros.errors import ChuteError, RecordError
from chute_ros.supervisor import core
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.epochs import LARGEST_EPOCH, RANKS, epoch_above
from chute_ros.supervisor.handover import followed, told
from chute_ros.supervisor.lease import Claim
from chute_ros.supervisor.record import CODEC
from chute_ros.supervisor.state import Own, State
from chute_ros.supervisor.wakes import next_deadline
from chute_ros.tools.explore_steps import LINKS, Step, configuration, steps
from chute_ros.tools.explorer import BEGINNINGS, Explorer
from fuzz.plain_json import NOW, changed
from fuzz.program import Program
from fuzz.target import Target, WrongError

_ROOT = Path(__file__).resolve().parents[2]
_RANK = 1
#: What devices want is in no story of the exploration's beginnings.
_STORIES = (
    *BEGINNINGS.values(),
    ("stands disarmed", "a device blocks flight", "a device asks for a kill"),
)
_WHOLE = (0, -1, 1, 2, 255, 2**32 - 8, 2**32, 2**63, 2**64 - 2, 2**64 - 1, 10**30)
_ODD = (float("nan"), float("inf"), float("-inf"))
_NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-9, -0.5, 8.2, -1e3, 1e3, 1e9, 1e308, -1e308, *_ODD)
_TEXTS = ("", *LINKS, f"{LINKS[1]} 33", "trigger", "1/161", "operator")
#: So many times one that leads may be due within as little time, s.
_MOST_DUE, _WITHIN = 30, 0.01


@functools.cache
def _config() -> SupervisorConfig:
    return dataclasses.replace(configuration(_ROOT), rank=_RANK, standby=True)


@functools.cache
def _steps() -> tuple[Step, ...]:
    return tuple(steps())


@functools.cache
def _leaders() -> tuple[str, ...]:
    """What a leader tells in each of the stories, with the fields as well that it leaves out."""
    explorer = Explorer(_ROOT)
    begun = [explorer._begun(story) for story in _STORIES]
    texts = [told(one.state, one.now) for one in begun]
    return tuple(CODEC.to_json(CODEC.from_json(text), whole=True) for text in texts)


def leader(p: Program) -> Any:
    """The state of one that leads, of which some values are others."""
    whole: Any = json.loads(p.choice(_leaders()))
    for _ in range(p.byte() % 5):
        if p.byte() % 8 == 0:
            changed(whole, p)  # which is mostly refused
        else:
            _varied(whole, p)
    return whole


def _varied(whole: Any, p: Program) -> None:
    """Put another value of the same kind somewhere into an object or list, so that it is read."""
    at = whole
    while True:
        keys = list(at) if isinstance(at, dict) else list(range(len(at)))
        if not keys:
            return
        key = p.choice(keys)
        one = at[key]
        if not isinstance(one, (dict, list)):
            at[key] = _like(one, p)
            return
        if isinstance(at, list) and p.byte() % 4 == 0:
            at[key : key + 1] = [one] * (p.byte() % 3)
            return
        at = one


def _like(one: Any, p: Program) -> Any:
    if isinstance(one, bool):
        return not one
    if isinstance(one, int):
        return p.choice(_WHOLE) if p.flag() else p.byte() % 12
    if isinstance(one, float):
        return p.choice(_NUMBERS) if p.flag() else p.whole(2) / 16.0
    return p.piece().decode("utf-8", "replace") if p.flag() else p.choice(_TEXTS)


class Follower:
    """It follows what a leader tells, takes over, and decides. The input is the text itself, or
    what its program makes of a good one, by its first byte."""

    def __init__(self) -> None:
        self._state = State(7, NOW, own=Own(leading=False))
        self._now = NOW
        self._number = 0

    def held(self) -> object:
        return self._state

    def feed(self, data: bytes) -> None:
        is_program = data[:1] == b"\1"
        program = Program(data[1:] if is_program else b"")
        text = json.dumps(leader(program)) if is_program else data.decode("utf-8", "replace")
        for _ in range(program.byte() % 4):
            self._step(program)
        try:
            state = followed(self._state, text, self._now)
        except RecordError as error:
            if not str(error):
                raise WrongError("it is not followed, without a word") from None
            return
        # Whose claim is not listened to is not followed either.
        claim = Claim("leader", state.epoch % RANKS, state.epoch, leading=True, empty=False)
        if claim.implausible(_RANK):
            return
        self._state = state
        self._update(())
        self._update((i.TakeOver(epoch_above(self._state.epoch, _RANK)),))
        while not program.over:
            self._step(program)
        self._wake_often()
        self._check_is_followed()
        self._update((i.StepDown("another leads"),))

    def _step(self, p: Program) -> None:
        """Time passes, and something comes."""
        self._now += p.choice((0.0, 0.1, 0.2, 1.2, 8.2))
        step = p.choice(_steps())
        self._number += 1
        try:
            inputs = step.make(self._state, self._now, self._number)
        except IndexError:
            return  # a report of the first of no targets
        self._update(inputs or ())

    def _update(self, new: tuple[i.Input, ...]) -> None:
        try:
            self._state, outputs = core.update(_config(), self._state, new, self._now)
        except ChuteError as error:
            raise WrongError(f"the core: {error}") from error
        for output in outputs:
            if isinstance(output, i.Decide):
                number = output.decision.epoch, output.decision.id
                if not (0 < number[0] <= LARGEST_EPOCH and 0 < number[1] < 2**64):
                    raise WrongError(f"no device can be told decision {number}")
        if not self._deadline() > self._now:
            raise WrongError(f"at {self._now!r} it wants to be woken at {self._deadline()!r}")

    def _deadline(self) -> float:
        return next_deadline(_config(), self._state, self._now)

    def _wake_often(self) -> None:
        """At each of its deadlines, of which there are not many at once."""
        began = self._now
        for _ in range(_MOST_DUE):
            if self._deadline() > self._now + 10.0:
                return
            self._now = self._deadline()
            self._update(())
        if self._now < began + _WITHIN:
            raise WrongError(f"spins: it was due {_MOST_DUE} times in {self._now - began!r} s")

    def _check_is_followed(self) -> None:
        """What it tells now that it leads, another can follow."""
        followed(State(3, self._now), told(self._state, self._now), self._now)


TARGETS = (
    Target(
        "supervisor.handover",
        "what a supervisor tells those that take over",
        Follower,
        longest=128,
    ),
)
