"""Flies the flights of the fault campaign with this product, with ArduPilot's and PX4's own checks
and with a plain threshold, and counts all of them by the same judge.

Ctrl-C ends it: the flights until then are compared and written.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from functools import partial
from pathlib import Path

from chute_ros.campaign.comparison import Compared, compare, shipped
from chute_ros.campaign.guards import GUARDS
from chute_ros.campaign.judge import Count
from chute_ros.campaign.pool import flown_here
from chute_ros.errors import CampaignError, ChuteError
from chute_ros.interrupts import once_more
from chute_ros.ros.config_folder import config_folder
from chute_ros.tools.arguments import positive
from chute_ros.tools.campaign_command import page_path
from chute_ros.tools.compare_page import Run, page
from chute_ros.tools.compare_picture import curves, delays
from chute_ros.tools.machine import machine
from chute_ros.tools.page_file import MARKDOWN, SVG, write_page

_TELL_EVERY = 5.0  # s
#: Beside the page: curves, delays.
_PICTURES = (".svg", ".delays.svg")


def main() -> None:
    """Fly; exit code 1 if a flight was broken."""
    options = argparse.ArgumentParser("compare", description=__doc__)
    options.add_argument(
        "--flights", type=positive, default=200, help="number of flights (default: 200)"
    )
    options.add_argument("--seed", type=int, default=0, help="of the first flight (default: 0)")
    options.add_argument("--jobs", type=positive, default=os.cpu_count() or 1, help="processes")
    options.add_argument(
        "--page",
        type=page_path(*_PICTURES),
        help="write the results to this page, with pictures beside it",
    )
    chosen = options.parse_args()
    begun, lines, seeds, ended = time.monotonic(), [], 0, ""
    progress = _ComparisonProgress(chosen.flights)
    profiles = config_folder() / "profiles"
    numbers = range(chosen.seed, chosen.seed + chosen.flights)
    try:
        bundle, shared = partial(compare, profiles), shipped(profiles, 1.0)
        for flight in flown_here(bundle, shared, numbers, chosen.jobs):
            seeds += 1
            lines += flight
            progress.look(seeds)
    except KeyboardInterrupt:
        ended = "interrupted"
    except CampaignError as error:
        ended = f"compare: {error}"
    took = time.monotonic() - begun
    _tell(lines)
    print(f"{seeds} of {chosen.flights} seeds in {took:.0f} s")
    if chosen.page and lines:
        how = f"{chosen.jobs} at a time on {machine()}"
        try:
            _write(chosen.page, Run(seeds, chosen.seed, took, how), lines)
        except ChuteError as error:
            ended = ended or f"compare: {error}"
    elif chosen.page:
        print(f"{chosen.page} is not written: none of these flights is one of an aircraft")
    if any(line.count is Count.BROKEN for line in lines):
        sys.exit(1)
    if ended == "interrupted":
        raise KeyboardInterrupt
    if ended:
        sys.exit(ended)


class _ComparisonProgress:
    """A line each few seconds, on the terminal's second channel."""

    def __init__(self, flights: int) -> None:
        self._flights = flights
        self._begun = self._told_at = time.monotonic()

    def look(self, seeds: int) -> None:
        """One more seed has been flown with every guard."""
        once_more()
        now = time.monotonic()
        if now - self._told_at < _TELL_EVERY:
            return
        self._told_at = now
        a_minute = seeds / (now - self._begun) * 60.0
        text = f"{seeds} of {self._flights} flights, {a_minute:.0f} a minute, with every guard"
        print(text, file=sys.stderr, flush=True)


def _tell(lines: list[Compared]) -> None:
    """The counts of each guard."""
    counts = Counter((line.guard, line.count) for line in lines if line.factor == 1.0)
    for guard in GUARDS:
        told = ((counts[guard.name, one], one.name) for one in Count)
        text = ", ".join(f"{number} {name}" for number, name in told if number)
        print(f"{guard.name:20}  {text or 'no flight'}")


def _write(path: Path, run: Run, lines: list[Compared]) -> None:
    drawn = [path.with_suffix(suffix) for suffix in _PICTURES]
    for one, draw in zip(drawn, (curves, delays), strict=True):
        write_page(one, draw(lines), SVG)
    write_page(path, page(lines, run, [one.name for one in drawn]), MARKDOWN)
