"""What the black box keeps of the core, so that the same decisions can be made once more.

The core is one function of (settings, state, inputs, now): with these four of every turn, and the
state at the beginning of each file, a replay decides what was decided, to the last bit.
"""

from __future__ import annotations

import typing
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.codec import Codec
from chute_ros.supervisor.conditions import CONDITIONS
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.state import State

CODEC = Codec(
    SupervisorConfig,
    State,
    *CONDITIONS.values(),
    *typing.get_args(i.Input),
    *typing.get_args(i.Output),
    once={"Say": i.LogMessage},
)


@dataclass(frozen=True)
class CoreTurn:
    """One update of the core: what went in and what came out. now: monotonic s."""

    now: float
    inputs: tuple[i.Input, ...]
    outputs: tuple[i.Output, ...]


def replay(
    config: SupervisorConfig, state: State, turns: Iterable[CoreTurn]
) -> Iterator[tuple[CoreTurn, State, tuple[i.Output, ...]]]:
    """Decide once more: each turn as it was recorded, the state after it, what comes out now."""
    for turn in turns:
        state, outputs = update(config, state, turn.inputs, turn.now)
        yield turn, state, outputs
