"""What a leading supervisor tells those that follow, so that one can go on where it stopped.

What each supervisor hears itself is not in it. What is in it is what was decided and what became
of it, with each Time moved to the clock of the one that is told.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import is_dataclass
from types import MappingProxyType
from typing import Any, TypeVar, cast, get_args, get_type_hints

from chute_ros.errors import RecordError
from chute_ros.supervisor.codec import Codec
from chute_ros.supervisor.epochs import LARGEST_EPOCH
from chute_ros.supervisor.pending import Time
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.state import HeardHere, Own, State

T = TypeVar("T")
_CODEC = Codec(State)
#: An id of chute_msgs/SafetyDecision has 64 bits; who goes on from here must have ids left.
_LARGEST_ID = 2**63


def told(state: State, now: float) -> str:
    """The state for those that follow, as JSON, with its times as ages at now (monotonic s)."""
    return _CODEC.to_json(_moved(replace(state, heard=HeardHere(), own=Own()), -now))


def followed(state: State, text: str, now: float) -> State:
    """state with what the leader told just now (monotonic s of this host). RecordError: another
    version wrote it, or none of ours did."""
    leader = _CODEC.from_json(text)
    if not isinstance(leader, State):
        raise RecordError(f"not a state: {text[:80]!r}")
    check_numbers(leader)
    own = Own(leading=False, updated_at=state.own.updated_at, late_count=state.own.late_count)
    return replace(_moved(leader, now), heard=state.heard, own=own)


def check_numbers(state: State) -> None:
    """RecordError for numbers under which nothing can be decided nor told."""
    slots = (state.block, state.killing.kill, *state.deploying.deploys)
    pending = [one for one in slots if one is not None]
    numbers = [(state.epoch, state.next_id), *(one.number for one in pending)]
    if state.newest is not None:
        numbers.append((state.newest.epoch, state.newest.id))
    for epoch, number in numbers:
        if not (1 <= epoch <= LARGEST_EPOCH and 1 <= number <= _LARGEST_ID):
            raise RecordError(f"there is no decision {number} of epoch {epoch}")


def _moved(value: T, by: float) -> T:
    """value with every Time in it moved by so many s."""
    told: Any = value
    if isinstance(told, tuple):
        told = tuple(_moved(one, by) for one in told)
    elif isinstance(told, Mapping):
        told = MappingProxyType({key: _moved(one, by) for key, one in told.items()})
    elif is_dataclass(told) and (moving := _moving(cast(type, type(told)))):
        known = ((name, is_time, getattr(told, name)) for name, is_time in moving)
        changes = {name: one + by if is_time else _moved(one, by) for name, is_time, one in known}
        told = replace(cast(Any, told), **changes)
    return cast(T, told)


@functools.cache
def _moving(kind: type) -> tuple[tuple[str, bool], ...]:
    """The fields of a class that are a Time, or (False) hold one."""
    hints = get_type_hints(kind, include_extras=True)
    return tuple((name, hint == Time) for name, hint in hints.items() if _has_time(hint))


def _has_time(hint: Any) -> bool:
    if hint == Time or (isinstance(hint, type) and is_dataclass(hint) and _moving(hint)):
        return True
    return any(map(_has_time, get_args(hint)))
