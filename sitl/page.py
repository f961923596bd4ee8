"""docs/evidence/real_autopilots.md: each autopilot is written by itself, and keeps its place."""

from __future__ import annotations

import statistics
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from chute_ros.tools import pages
from chute_ros.tools.machine import machine
from sitl.autopilots import KINDS
from sitl.judge import Verdict

_HEAD = """\
# Real autopilots

Written by `make sitl AUTOPILOT="PATH ..."`, which flies simulator binaries of ArduCopter,
ArduPlane (as a quadplane) and PX4 that you have; each autopilot's part is written alone. The
numbers belong to the machine that made them: {machine}.

The autopilot runs in its own simulator, on loopback, in real time. With it run the real nodes
(`mavlink_parachute`, `safety_supervisor`, default parameters unless a story names others), a
simulated parachute, a router (an addressed message goes to the port of its addressee, as with
mavlink-router) and a ground station. The simulator's own state judges each run, never
the supervisor's picture. A fall that only a parachute helps must end with a release, in time
(one motor dead to the release: 1.0 s, over a slow or fought-over wire 1.5 s; an operator's call to
the release: 0.3 s); any other flight must see no kill and no release; a blocked vehicle must not
rise. Deviations stand in the last column, in bold.

A run in which other load of the machine delayed the node or the simulator is flown again. No story
restarts an autopilot in flight: these simulators begin anew on the ground.

To run it, give the executable that a build of ArduPilot for the board SITL makes (`arducopter`,
`arduplane`), or `bin/px4` in the folder of a PX4 build for POSIX with the SIH simulator.
ArduPilot's and PX4's own documentation of their simulators says how to get one.
`make sitl AUTOPILOT=PATH STORIES="motor-30 block" RUNS=1` flies some stories;
`python3 -m sitl --list` names all.
"""
_RIGHT = "right"


@dataclass(frozen=True)
class Flown:
    """One run of a story."""

    kind: str
    version: str
    story: str
    text: str
    verdict: Verdict


def with_autopilot(page: str, flown: Sequence[Flown]) -> str:
    """The page with the part of this autopilot written anew; the others as page has them."""
    parts = pages.with_part(page, "autopilot", flown[0].kind, _part(flown), KINDS)
    return f"{_HEAD.format(machine=machine())}\n{parts}"


def _part(flown: Sequence[Flown]) -> str:
    wrong = sum(bool(one.verdict.wrong) for one in flown)
    loads = [one.verdict.load for one in flown]
    told = (
        f"{len(flown)} runs, {wrong} of them wrong. Load of the machine meanwhile: "
        f"{min(loads):.1f} to {max(loads):.1f} (of a minute)."
    )
    runs = Counter(one.story for one in flown)
    if fewer := [f"`{name}`" for name in runs if runs[name] < max(runs.values())]:
        told += f" Fewer runs than the others have: {', '.join(fewer)}."
    rows = [_row([one for one in flown if one.story == name]) for name in runs]
    table = pages.table(("story", "runs", "what happened", "times", ""), rows)
    return f"## {flown[0].kind} {flown[-1].version}\n\n{told}\n\n{table}"


def _row(runs: Sequence[Flown]) -> list[str]:
    happened = _each(one.verdict.happened for one in runs)
    names = dict.fromkeys(name for one in runs for name in one.verdict.times)
    times = [_span(name, [one.verdict.times[name] for one in runs if name in one.verdict.times])
             for name in names]  # fmt: skip
    wrong = _each(one.verdict.wrong for one in runs)
    judged = "; ".join(f"**{text}**" for text in wrong) or _RIGHT
    cells = (f"`{runs[0].story}`: {runs[0].text}", str(len(runs)), "; ".join(happened),
             "; ".join(times), judged)  # fmt: skip
    return [" ".join(text.split()).replace("|", "/") for text in cells]


def _each(lists: Iterable[Iterable[str]]) -> list[str]:
    """What the runs say, each once, with the number of runs if several say it differently."""
    return list(dict.fromkeys(text for one in lists for text in one))


def _span(name: str, values: Sequence[float]) -> str:
    """The middle one of the runs, with the least and the greatest."""
    middle = statistics.median(values)
    if len(values) == 1:
        return f"{name} {middle:.2f} s"
    return f"{name} {middle:.2f} s ({min(values):.2f} to {max(values):.2f})"
