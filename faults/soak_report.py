"""What the soak found: a table by kind of fault, one of what processes hold, and a picture."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from pathlib import Path

from chute_ros.tools.pages import table
from faults.soak_measure import LIMITS, Growth, growth
from faults.soak_plan import KINDS, MOTOR, NODES, PERSON, SUPERVISORS
from faults.soak_run import Result

#: Processes of the vehicle, of which it is asked whether they stay flat.
OURS = (*NODES, *SUPERVISORS)
_PAGE = """\
# Soak

Written by `make soak LOOPS={loops} SEED={seed}`. The numbers belong to the machine that made them:
{machine}. {load}

One vehicle of real processes (`mavlink_parachute`, `upf_can`, `umbilical`, one supervisor, then
two with `hot_standby`, black boxes on) lives through all loops; simulated autopilot, parachute
and UPF are new with each flight. A simulated flight computer stands beside and sends: nothing is
deployed through it. In each loop one fault is put on the vehicle at a random moment in flight
(none while it arms or takes off), and in some a motor then fails or a person deploys. The
autopilot is stopped, not killed: restarts of an autopilot in flight are in
[campaign.md](campaign.md). Losses are on the devices' wires; losses of a network between
supervisors are in [hosts.md](hosts.md). A valid flood is copies of frames on MAVLink,
NodeStatus of a stranger on CAN, and lines of the flight computer on the cable. Relays between
nodes and devices record the wires. Each loop is checked:

- was nothing killed or deployed without a cause, by the wires and by the devices' own records;
- after a cause: was the kill first, did each parachute come out once, within {answer} s;
- is it whole within {whole} s after the fault: processes run, links OK, one supervisor leads,
  diagnostics OK;
- no traceback, no process that ended by itself, no internal error of a node.

{took}

## By kind of fault

Heartbeats are those of all nodes and supervisors, 10 a second each, as one more listener missed
them; frames are those that did not pass the relays; entries are those of the black boxes. Times
count from the end of the fault (of a kill: from the kill).

{faults}

## Causes during and after faults

From the cause, or the end of the fault if that is later; below zero: the answer came before the
fault was over.

{causes}

## What the processes hold

Median of the first and the last third of the samples of each process' longest life, one after
each loop; growth by the median of the slopes of all pairs. A finding is a growth beyond both
limits: {limits};
over 40 samples and more the second limit alone. In the second half of the loops with one
supervisor, and of those with two, none of them is killed, so that some live for so long.

{holds}

![memory and descriptors]({picture})

## Findings

{findings}
"""


def by_kind(results: Sequence[Result]) -> str:
    """As Markdown."""
    rows = []
    for kind in KINDS:
        some = [one for one in results if one.plan.kind == kind]
        if not some:
            continue
        missed = [one.heartbeats_missed for one in some]
        rows.append(
            (
                kind,
                str(len(some)),
                f"{statistics.median(missed):.0f} / {max(missed)}",
                str(sum(one.frames_dropped for one in some)),
                str(sum(one.decisions_unanswered for one in some)),
                str(sum(one.entries_lost for one in some)),
                _spread(one.until_whole for one in some),
                str(sum(bool(one.findings) for one in some)),
            )
        )
    head = (
        "fault",
        "loops",
        "heartbeats missed: median / most",
        "frames lost",
        "decisions without a report",
        "entries lost",
        "whole again: median / longest",
        "loops with findings",
    )
    return table(head, rows)


def by_cause(results: Sequence[Result]) -> str:
    """As Markdown."""
    rows = []
    for cause in (MOTOR, PERSON):
        some = [one for one in results if one.plan.cause == cause]
        if some:
            kills, out = (one.until_kill for one in some), (one.until_out for one in some)
            rows.append((cause, str(len(some)), _spread(kills), _spread(out)))
    head = ("cause", "loops", "kill taken: median / longest", "parachute out: median / longest")
    return table(head, rows)


def _spread(values: Iterable[float]) -> str:
    known = [one for one in values if one == one]
    if not known:
        return "-"
    return f"{statistics.median(known):.2f} / {max(known):.2f} s"


Series = dict[str, list[tuple[float, float]]]


def longest_lives(results: Sequence[Result], measure: str) -> Series:
    """Of each process of ours its longest life: (number of the sample, value)."""
    lives: dict[tuple[str, int, int], list[tuple[float, float]]] = {}
    for number, result in enumerate(results):
        for (name, life), sample in result.samples.items():
            if name in OURS:
                point = (float(number), float(getattr(sample, measure)))
                lives.setdefault((name, result.supervisors, life), []).append(point)
    best: Series = {}
    for (name, _, _), points in lives.items():
        if len(points) > len(best.get(name, ())):
            best[name] = points
    return best


def growths(results: Sequence[Result]) -> dict[tuple[str, str], Growth]:
    """(measure, process) -> how it grew, of all lives that are long enough to say."""
    every = {
        (measure, name): growth(points)
        for measure in LIMITS
        for name, points in longest_lives(results, measure).items()
    }
    return {key: grown for key, grown in every.items() if grown is not None}


def not_flat(results: Sequence[Result]) -> list[str]:
    """Growths that are findings."""
    return [
        f"{measure} of {name} grew from {grown.first:.1f} to {grown.last:.1f} "
        f"({grown.per_hundred:+.1f} in 100 loops)"
        for (measure, name), grown in growths(results).items()
        if grown.too_much(LIMITS[measure])
    ]


def holds(results: Sequence[Result]) -> str:
    """As Markdown."""
    every = growths(results)
    rows = []
    for name in OURS:
        cells = [every.get((measure, name)) for measure in LIMITS]
        if any(cells):
            rows.append((name, str(max(one.samples for one in cells if one)), *map(_cell, cells)))
    return table(("process", "loops", "memory, MB", "descriptors", "threads"), rows)


def _cell(one: Growth | None) -> str:
    if one is None:
        return "-"
    return f"{one.first:.1f} to {one.last:.1f} ({one.per_hundred:+.1f} in 100 loops)"


def findings(results: Sequence[Result], more: Sequence[str]) -> str:
    """As Markdown: what must not be, with the loop that shows it again."""
    lines = [
        f"- loop {one.plan.number} ({one.supervisors} supervisors; {one.plan.text()}): {said}"
        for one in results
        for said in one.findings
    ]
    lines += [f"- {one}" for one in more]
    return "\n".join(lines) or "None."


def write(path: Path, **values: str) -> None:
    """The page."""
    path.write_text(_PAGE.format(**values))
