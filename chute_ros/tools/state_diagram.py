"""Writes docs/reference/states.* from the tables of the supervisor (make docs).

With --check it only names the files that are out of date.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

from chute_ros.supervisor import lease, machine
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.pages import table, write_or_check
from chute_ros.tools.state_drawing import drawing

_State = TypeVar("_State", bound=enum.Enum)
_Event = TypeVar("_Event", bound=enum.Enum)
TEXT, PICTURE = Path("docs/reference/states.md"), Path("docs/reference/states.svg")

_HEAD = """\
# States

Written by `make docs` from the tables in `chute_ros/supervisor/machine.py` and
`chute_ros/supervisor/lease.py`. A pair of state and event that a table does not list is an
error of the program: it raises `TransitionError`.

## The vehicle

![The stages of a flight and what leads from one to the next](states.svg)

A supervisor begins in STARTUP.
"""
_LEASE = """\
## Which of several supervisors leads

A single supervisor begins as LEADING; one of several begins as FOLLOWING and looks for a leader.
"""


def states_text() -> str:
    """The whole of docs/reference/states.md."""
    parts = [
        _HEAD,
        _mermaid(machine.TRANSITIONS, first=Stage.STARTUP.name),
        _table(machine.Stage, machine.Event, machine.TRANSITIONS),
        _meanings(machine.Event),
        _LEASE,
        _mermaid(lease.TRANSITIONS),
        _table(lease.Role, lease.Event, lease.TRANSITIONS),
        _meanings(lease.Event),
    ]
    return "\n".join(parts)


def main() -> None:
    """Write, or check, both."""
    texts = {TEXT: states_text(), PICTURE: drawing()}
    write_or_check("state_diagram", __doc__, lambda: texts)


def _mermaid(transitions: Mapping[tuple[_State, _Event], _State], first: str = "") -> str:
    lines = ["```mermaid", "stateDiagram-v2"]
    lines += [f"    [*] --> {first}"] if first else []
    lines += [
        f"    {before.name} --> {after.name}: {event.name}"
        for (before, event), after in transitions.items()
    ]
    return "\n".join([*lines, "```", ""])


def _table(
    states: type[_State],
    events: type[_Event],
    transitions: Mapping[tuple[_State, _Event], _State],
) -> str:
    """One row an event, one column a state; a dash: the pair is not listed."""
    rows = []
    for event in events:
        after = [transitions.get((state, event)) for state in states]
        rows.append((event.name, *(one.name if one is not None else "-" for one in after)))
    return table(("", *(state.name for state in states)), rows) + "\n"


def _meanings(events: type[_Event]) -> str:
    return table(("event", "meaning"), [(one.name, one.value) for one in events]) + "\n"


if __name__ == "__main__":
    main()
