"""make sitl: flies real autopilots in their simulators, writes docs/evidence/real_autopilots.md.

python3 -m sitl AUTOPILOT ... [--stories NAME ...] [--runs N] [--list]
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from chute_ros.errors import ChuteError
from chute_ros.tools.arguments import positive
from chute_ros.tools.isolation import isolated_ros
from faults.ending import take_down_when_ended
from sitl import results, stories
from sitl.autopilots import KINDS, WHAT_TO_GIVE, Autopilot, recognise
from sitl.hangar import Hangar
from sitl.judge import Verdict
from sitl.network import enter_own_network
from sitl.page import Flown, with_autopilot

_TRIES = 3
#: A node or a simulator that this machine kept waiting longer has flown in no real time, s.
HELD_UP = 0.25
PAGE = Path(__file__).resolve().parent.parent / "docs" / "evidence" / "real_autopilots.md"


def main() -> None:
    """Fly; exit code 1 if anything was false, missed or late, 2 on a user's mistake."""
    chosen = _options().parse_args()
    every = stories.every()
    if chosen.list:
        # A reader that has enough (head) is no fault.
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
        for one in every.values():
            print(f"{one.name:16s} {one.text} ({', '.join(one.kinds)})")
        return
    if not chosen.autopilots and chosen.page and chosen.results:
        if not chosen.results.is_file():
            _refuse(f"sitl: --results {chosen.results}: no such file, so that there is no page")
        for kind in KINDS:
            _write_page(chosen.results, kind)
        return
    if not chosen.autopilots:
        _refuse(WHAT_TO_GIVE)
    try:
        autopilots = [recognise(Path(text)) for text in chosen.autopilots]
    except ChuteError as error:
        _refuse(str(error))
    if unknown := [name for name in chosen.stories if name not in every]:
        _refuse(f"sitl: no story is called {', '.join(unknown)}: see them with --list")
    if chosen.keep and chosen.keep.is_dir() and any(chosen.keep.iterdir()):
        _refuse(f"sitl: --keep {chosen.keep} is not empty: name a new folder for these records")
    take_down_when_ended("sitl")
    wrong = 0
    with _apart(), contextlib.ExitStack() as kept:
        folder = chosen.keep or Path(kept.enter_context(tempfile.TemporaryDirectory("sitl")))
        for autopilot in autopilots:
            picked = [
                one
                for name, one in every.items()
                if autopilot.kind in one.kinds and (not chosen.stories or name in chosen.stories)
            ]
            kept_in = chosen.results or folder / "results.json"
            flown = fly_all(autopilot, picked, chosen.runs, folder, kept_in)
            wrong += sum(bool(one.verdict.wrong) for one in flown)
            if chosen.page:
                _write_page(kept_in, autopilot.kind)
    if wrong:
        sys.exit(f"sitl: {wrong} runs were wrong")


def _write_page(kept_in: Path, kind: str) -> None:
    """The part of this autopilot, of all runs that are kept there."""
    if every_run := results.load(kept_in, kind):
        before = PAGE.read_text() if PAGE.exists() else ""
        PAGE.write_text(with_autopilot(before, every_run))


def fly_all(
    autopilot: Autopilot, picked: list[stories.Story], runs: int, folder: Path, kept_in: Path
) -> list[Flown]:
    """Each story so many times; stories with the same setup on one vehicle, if it lasts. kept_in:
    the file that each run is added to."""
    every = []
    with contextlib.closing(Hangar(autopilot, folder)) as hangar:
        for run in range(1, runs + 1):
            for story in picked:
                flown = fly_one(hangar, story, f"{story.name} {run}/{runs}")
                results.add(kept_in, flown)
                every.append(flown)
    return every


def fly_one(hangar: Hangar, story: stories.Story, what: str) -> Flown:
    """One run of a story; again if the machine was too slow: flights take place in real time."""
    for _ in range(_TRIES - 1):
        flown = _fly_once(hangar, story, what)
        timed = bool(flown.verdict.times)
        if story.restarts or flown.verdict.held_up < HELD_UP or not (timed or flown.verdict.wrong):
            return flown
        print(f"    the machine was held up for {flown.verdict.held_up:.1f} s: again", flush=True)
    flown = _fly_once(hangar, story, what)
    if not story.restarts and flown.verdict.held_up >= HELD_UP:
        flown.verdict.happened.append(f"the machine held it up for {flown.verdict.held_up:.1f} s")
    return flown


def _fly_once(hangar: Hangar, story: stories.Story, what: str) -> Flown:
    began = time.monotonic()
    verdict = Verdict()
    notes = (
        hangar.folder / f"{hangar.autopilot.kind}_{what.replace(' ', '_').replace('/', '_')}.txt"
    )
    try:
        flight = hangar.flight(story.setup)
        try:
            story.fly(flight)
        except ChuteError as error:
            flight.verdict.wrong.append(f"error: {error}")
            hangar.close()
        verdict = flight.end(notes)
        if story.spoils:
            hangar.close()
    except ChuteError as error:
        verdict.wrong.append(f"error: {error}")
        hangar.close()
    times = [f"{name} {took:.2f} s" for name, took in verdict.times.items()]
    print(
        f"{hangar.autopilot.kind} {hangar.version}  {what} ({time.monotonic() - began:.0f} s): "
        f"{'; '.join([*verdict.happened, *times])}: {'; '.join(verdict.wrong) or 'right'}",
        flush=True,
    )
    return Flown(hangar.autopilot.kind, hangar.version, story.name, story.text, verdict)


@contextlib.contextmanager
def _apart() -> Iterator[None]:
    """A ROS domain and a network of our own, so that nothing here reaches a real vehicle."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    with contextlib.ExitStack() as apart:
        if "ROS_DOMAIN_ID" not in os.environ:
            apart.enter_context(isolated_ros())
        if reason := enter_own_network():
            print(f"sitl: no network namespace of our own ({reason}): the simulator's own ports "
                  "are open to this machine's network", flush=True)  # fmt: skip
        yield


def _refuse(text: str) -> None:
    print(text, file=sys.stderr)
    sys.exit(2)


def _options() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser("sitl", description=__doc__)
    options.add_argument("autopilots", nargs="*", metavar="AUTOPILOT", help="simulator binary")
    options.add_argument("--stories", nargs="+", default=[], metavar="NAME", help="only these")
    options.add_argument(
        "--runs", type=positive, default=3, help="runs of each story (default: 3)"
    )
    options.add_argument("--list", action="store_true", help="list the stories")
    options.add_argument(
        "--page",
        action="store_true",
        help=f"write docs/evidence/{PAGE.name}, without AUTOPILOT of --results",
    )
    options.add_argument("--results", type=Path, metavar="FILE",
                         help="add the runs to this file; the page has all of them")  # fmt: skip
    options.add_argument(
        "--keep", type=Path, metavar="FOLDER", help="keep all records in this folder"
    )
    return options


if __name__ == "__main__":
    main()
