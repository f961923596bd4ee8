"""Writes docs/reference/states.* from the tables of the supervisor (make docs).

With --check it only names the files that are out of date.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

from chute_ros.supervisor import lease, machine
from chute_ros.tools.pages import table, write_or_check
from chute_ros.tools.state_drawing import drawing

_State = TypeVar("_State", bound=enum.Enum)
_Event = TypeVar("_Event", bound=enum.Enum)
TEXT, PICTURE = Path("docs/reference/states.md"), Path("docs/reference/states.svg")

_HEAD = """\
# States

Written by `make docs` from the tables in `chute_ros/supervisor/machine.py` and
`chute_ros/supervisor/lease.py`. A pair of state and event that is not listed is an error of the
program: it raises `TransitionError`.

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
        _table(machine.StageEvent, machine.TRANSITIONS),
        _LEASE,
        _table(lease.LeaseEvent, lease.TRANSITIONS),
    ]
    return "\n".join(parts)


def main() -> None:
    """Write, or check, both."""
    texts = {TEXT: states_text(), PICTURE: drawing()}
    write_or_check("state_diagram", __doc__, lambda: texts)


def _table(events: type[_Event], transitions: Mapping[tuple[_State, _Event], _State]) -> str:
    """One row an event; two if it leads to two states."""
    rows = []
    for event in events:
        befores: dict[_State, list[str]] = {}
        for (before, one), after in transitions.items():
            if one is event:
                befores.setdefault(after, []).append(before.name)
        rows += [(event.name, ", ".join(befores[to]), to.name, event.value) for to in befores]
    return table(("event", "leads from", "to", "meaning"), rows) + "\n"


if __name__ == "__main__":
    main()
