"""A state machine is a table: which state follows which, by what; an unlisted pair raises."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from typing import TypeVar

from chute_ros.errors import TransitionError

StateT = TypeVar("StateT", bound=enum.Enum)
StimulusT = TypeVar("StimulusT", bound=enum.Enum)


def after(
    table: Mapping[tuple[StateT, StimulusT], StateT], state: StateT, stimulus: StimulusT
) -> StateT:
    """The state that follows; TransitionError for a pair that the table does not list."""
    try:
        return table[state, stimulus]
    except KeyError:
        raise TransitionError(f"{state.name} cannot take '{stimulus.value}'") from None
