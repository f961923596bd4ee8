"""JSON of the core's record from a program: of its classes and fields, and of what fits none."""

from __future__ import annotations

import dataclasses
import functools
import json
import typing
from typing import Any

from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.codec import CLASS
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.resume import SavedState, dump
from chute_ros.supervisor.state import Own, State
from fuzz.program import Program

#: The clock of all that is made here, s.
NOW = 1010.0
BOOT, SETTINGS = "boot", "settings"
_NUMBERS = (0, 1, -1, 3, 255, 2**31, 2**64, 10**400, 0.5, -0.0, 1e308, NOW, 1e9)
_ODD = (float("nan"), float("inf"), float("-inf"))
_DEEPEST = 4


@functools.cache
def _classes() -> tuple[type, ...]:
    """Those that a record may hold, with those of their fields."""
    found: dict[str, type] = {}

    def learn(kind: Any) -> None:
        is_new = kind not in found.values()
        if is_new and isinstance(kind, type) and dataclasses.is_dataclass(kind):
            found[kind.__name__] = kind
            for hint in typing.get_type_hints(kind).values():
                learn(hint)
        for argument in typing.get_args(kind):
            learn(argument)

    for kind in (State, SupervisorConfig, SavedState, *typing.get_args(i.Input)):
        learn(kind)
    return tuple(found.values())


def anything(p: Program, depth: int = 0) -> Any:
    """Any value of JSON; objects are mostly of the classes that are known."""
    what = p.byte() % 10
    if what < 2:
        return p.choice((None, True, False, "", [], "drone"))
    if what < 5 or depth >= _DEEPEST:
        return p.choice(_NUMBERS + _ODD) if p.flag() else p.byte()
    if what == 5:
        return p.piece().decode("utf-8", "replace")
    if what < 8:
        return [anything(p, depth + 1) for _ in range(p.byte() % 4)]
    kind = p.choice(_classes())
    made: dict[str, Any] = {CLASS: kind.__name__}
    for field in dataclasses.fields(kind):
        needed = field.default is field.default_factory is dataclasses.MISSING
        if needed or p.byte() % 8 == 0:
            made[field.name] = anything(p, depth + 1)
    return made


@functools.cache
def _left() -> str:
    """As a supervisor leaves it."""
    state = State(7, NOW - 100.0, own=Own(updated_at=NOW - 5.0))
    return dump(SavedState(BOOT, SETTINGS, state))


def left(p: Program) -> Any:
    """What a supervisor left, of which some values are others."""
    whole: Any = json.loads(_left())
    for _ in range(p.byte() % 5):
        changed(whole, p)
    return whole


def changed(whole: Any, p: Program) -> None:
    """Put another value somewhere into an object or list."""
    at = whole
    while True:
        keys = list(at) if isinstance(at, dict) else list(range(len(at)))
        if not keys:
            return
        key = p.choice(keys)
        inside = isinstance(at[key], (dict, list)) and bool(at[key])
        if not inside or p.flag():
            at[key] = anything(p, 2)
            return
        at = at[key]
