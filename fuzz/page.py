"""docs/evidence/fuzz.md: what was tried, for how long, and what was found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from chute_ros.tools.machine import machine
from chute_ros.tools.pages import table
from fuzz.run import Outcome
from fuzz.stored import stored
from fuzz.targets import NAMES, target_of

PAGE = Path(__file__).resolve().parent.parent / "docs" / "evidence" / "fuzz.md"
_PAGE = """\
# Fuzzed

Written by `make fuzz MINUTES={minutes:g}`. The numbers belong to the machine that made them:
{machine}.

libFuzzer (through atheris) feeds the readers of foreign bytes in the table, and the links with
their transactions, with inputs that it changes until they reach new code. In the
targets of links an input is a program: time that passes, frames with fuzzed fields, requests.
For every input: only the named errors of files and settings are raised; no input takes
long; an instance that reads variations of an input does not grow with each of them; dropped data
is counted; every request ends once; and nothing that fires leaves without an order.
`fuzz/targets/` has the details of each.

There is no target for ROS messages, which the middleware has given their types (only the state
of a leading supervisor is fed); for the sockets and ports of the wires, whose bytes go
to these readers; for DSDL files, which the DroneCAN library reads; and for a node's saved times of
MAVLink signatures.

{table}

Edges and features as libFuzzer counts them; new: inputs that reached more than all before them;
slowest: time of the processor; held: entries of the largest store of an instance, where that
is looked at; memory: of the process at its start and at most.

{found}

{stored} inputs ({size} kB) are stored in `fuzz/corpus/`: together they reached every edge that any
had reached when they were last chosen among the stored and the new ones. Only
`python3 -m fuzz --merge` chooses again. `make test` feeds them again. One file:
`python3 -m fuzz --replay TARGET FILE`.
"""


def page(outcomes: Sequence[Outcome], minutes: float) -> str:
    """The whole page."""
    rows = [
        (
            f"{one.name}: {target_of(one.name).what}",
            f"{one.seconds:.0f} s",
            f"{one.inputs:,}",
            f"{one.edges} / {one.features}",
            str(one.new),
            f"{one.slowest:.0f} ms",
            str(one.largest or ""),
            f"{one.memory[0]} / {one.memory[1]} MB",
        )
        for one in outcomes
    ]
    head = ("target", "for", "inputs", "edges / features", "new", "slowest", "held", "memory")
    inputs = sum(one.inputs for one in outcomes)
    found = [f"- {line}" for one in outcomes for line in told(one)]
    text = "\n".join(["Found:", "", *found]) if found else f"Found in {inputs:,} inputs: nothing."
    inputs_stored = [stored(name) for name in NAMES]
    return _PAGE.format(
        minutes=minutes,
        machine=machine(),
        table=table(head, rows),
        found=text,
        stored=sum(map(len, inputs_stored)),
        size=round(sum(len(data) for each in inputs_stored for data in each) / 1000),
    )


def told(outcome: Outcome) -> list[str]:
    """What was found, one line each, with how to see it again."""
    root = PAGE.parent.parent
    lines = []
    for path in outcome.found:
        shown = path.relative_to(root) if path.is_relative_to(root) else path
        lines.append(f"`python3 -m fuzz --replay {outcome.name} {shown}`")
    return lines + ([f"{outcome.name}: {outcome.died}"] if outcome.died else [])
