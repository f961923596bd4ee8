"""A state machine is a table: which state follows which, by what; an unlisted pair raises."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from typing import TypeVar

from chute_ros.errors import TransitionError

StateT = TypeVar("StateT", bound=enum.Enum)
EventT = TypeVar("EventT", bound=enum.Enum)


def after(table: Mapping[tuple[StateT, EventT], StateT], state: StateT, event: EventT) -> StateT:
    """The state that follows; TransitionError for a pair that the table does not list."""
    try:
        return table[state, event]
    except KeyError:
        raise TransitionError(f"{state.name} cannot take '{event.value}'") from None
