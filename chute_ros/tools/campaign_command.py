"""Flies many flights in virtual time with faults at every layer, and counts the wrong ones.

A wrong flight is saved as a scenario, as text: --replay SEED or FILE shows it step by step.
Ctrl-C ends the campaign: the flights until then are counted and written; --resume FILE continues.
--scheduler flies them on the workers of a Dask cluster: docs/guide/cluster.md.
--vehicle flies the failures of a described vehicle, and finds the height and the time that each
needs: docs/guide/minimum_height.md.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

from chute_ros.campaign import campaign, checkpoint
from chute_ros.campaign.judge import Count
from chute_ros.campaign.pool import flown_here
from chute_ros.campaign.rare import OfEach, rare
from chute_ros.campaign.scenario import Scenario, outlives
from chute_ros.campaign.scenario_text import scenario_of, text_of
from chute_ros.campaign.tapes import TapeFile, Tapes
from chute_ros.errors import CampaignError, ChuteError, RecordError
from chute_ros.interrupts import once_more
from chute_ros.ros.config_folder import config_folder
from chute_ros.ros.private_files import replace_text
from chute_ros.ros.ros_home import ros_home
from chute_ros.tools.arguments import positive
from chute_ros.tools.campaign_bodies import page_of_bodies
from chute_ros.tools.campaign_page import page, plan
from chute_ros.tools.campaign_picture import picture
from chute_ros.tools.campaign_vehicle import FLIGHTS, fly_described, refuse_unfit
from chute_ros.tools.machine import machine
from chute_ros.tools.page_file import MARKDOWN, SVG, require_output, write_page
from chute_ros.transport.regular_file import open_regular, read_regular_text

#: Where none are asked for.
_FLIGHTS = 1000
_TELL_EVERY = 5.0  # s
_KEEP_EVERY = 60.0  # s
#: So many of those that must not be are told; all are saved.
_MOST_TOLD = 20
#: Beside the page: delays, heights.
_PICTURES = (".svg", ".heights.svg")
_BROKEN = "the flights until then are reported, and --resume FILE continues from them"


class _Flyers(NamedTuple):
    """Who flies."""

    #: At the same time.
    number: int
    #: What the speed depends on.
    how: str
    #: The flights of seeds, in their order.
    flown: Callable[[Sequence[int]], Generator[campaign.FlightSummary, None, None]]


def main() -> None:
    """Fly; exit code 1 if a flight was wrong."""
    options = argparse.ArgumentParser("campaign", description=__doc__)
    options.add_argument(
        "--flights",
        type=positive,
        help=(
            f"number of flights (default: {_FLIGHTS}; with --vehicle of each failure: {FLIGHTS})"
        ),
    )
    options.add_argument("--seed", type=int, default=0, help="of the first flight (default: 0)")
    options.add_argument(
        "--each",
        type=positive,
        metavar=("N"),
        help=(
            "fly only the first N flights of each kind among the seeds (--flights): the rare "
            "kinds as often as the common"
        ),
    )
    where = options.add_mutually_exclusive_group()
    where.add_argument(
        "--jobs", type=positive, default=os.cpu_count() or 1, help="processes of this machine"
    )
    where.add_argument(
        "--scheduler",
        type=scheduler,
        metavar="tcp://HOST:PORT",
        help="fly on the workers of this Dask cluster",
    )
    options.add_argument(
        "--page",
        type=page_path(*_PICTURES),
        help="write the results to this page, with pictures beside it",
    )
    options.add_argument(
        "--failures",
        type=Path,
        default=ros_home() / "campaign_failures",
        help="folder for the wrong flights (default: %(default)s)",
    )
    options.add_argument(
        "--resume",
        type=writable,
        metavar="FILE",
        help="save the flights there each minute; continue from it if it exists",
    )
    options.add_argument(
        "--tapes",
        type=tapes,
        metavar="FILE",
        help="let half of the aircraft fly what other physics recorded (make tapes)",
    )
    options.add_argument(
        "--tapes-only", action="store_true", help="fly no flight but those on tapes"
    )
    options.add_argument(
        "--replay", type=scenario, metavar="SEED|FILE", help="show one flight step by step"
    )
    options.add_argument(
        "--plan",
        type=positive,
        metavar="N",
        help="print how long N flights take on how many cores, at the rate of this run",
    )
    options.add_argument(
        "--core-hour-price",
        type=price,
        metavar="PRICE",
        help="price of a core for an hour, in any currency, for the costs of --plan",
    )
    options.add_argument(
        "--vehicle",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="find the height and the time that each failure of these described vehicles needs",
    )
    options.add_argument(
        "--faults",
        type=positive,
        default=0,
        metavar="N",
        help="with --vehicle: fly each failure again with 1 to N faults around it",
    )
    chosen = options.parse_args()
    profiles = config_folder() / "profiles"
    refuse_unfit(options, chosen)
    if chosen.vehicle is not None:
        try:
            fly_described(options, chosen, profiles)
        except ChuteError as error:
            sys.exit(f"campaign: {error}")
        return
    chosen.flights = chosen.flights or _FLIGHTS
    if chosen.tapes_only and chosen.tapes is None:
        options.error("argument --tapes-only: name the file with --tapes")
    if chosen.tapes is not None and chosen.scheduler is not None:
        options.error("argument --tapes: the workers of a cluster have no such file: fly here")
    file = None if chosen.tapes is None else TapeFile(chosen.tapes, chosen.tapes_only)
    drawn = partial(campaign.drawn, profiles, tapes=file)
    if chosen.replay is not None:
        given = chosen.replay
        try:
            _replay(profiles, drawn(given) if isinstance(given, int) else given, file)
        except RecordError as error:
            options.error(f"argument --replay: {error}")
        return
    if chosen.each and chosen.resume:
        options.error("argument --each: a campaign of each kind cannot be interrupted (--resume)")
    seeds: Sequence[int] = range(chosen.seed, chosen.seed + chosen.flights)
    if chosen.each:
        seeds = rare(seeds, chosen.each)
    if chosen.tapes_only:
        # A rocket has none, nor has a profile of which no tape was recorded.
        seeds = [seed for seed in seeds if drawn(seed).tape is not None]
    if len(seeds) < chosen.flights:
        print(f"{len(seeds)} of {chosen.flights} seeds are flown", file=sys.stderr, flush=True)
    kept = _Kept(chosen.resume, chosen.seed, profiles, file)
    try:
        tally = kept.tally()
    except RecordError as error:
        options.error(f"argument --resume: {error}")
    progress = _CampaignProgress(len(seeds), chosen.failures, kept, drawn)
    before, took_before, broken = tally.flights, tally.took, ""
    with _flyers(chosen.scheduler, profiles, chosen.jobs, file) as flyers:
        try:
            campaign.run(flyers.flown(seeds[tally.flights :]), progress.look, tally)
        except CampaignError as error:
            broken = str(error)
    kept.keep(tally)
    for count in Count:
        print(f"{tally.counts[count]:8d}  {count.value}")
    for line in tally.wrong[:_MOST_TOLD]:
        print(f"  {_told(line)}")
    print(f"{tally.flights} of {len(seeds)} flights in {tally.took:.0f} s")
    if progress.unsaved:
        print(f"not saved (name another folder with --failures): {progress.unsaved}")
    elif tally.wrong:
        print(f"saved in {chosen.failures}; --replay FILE shows one step by step")
    unwritten = ""
    if chosen.page and tally.flights:
        of_each = OfEach(chosen.flights, chosen.each) if chosen.each else None
        flown_tapes = campaign.shipped(profiles, file).tapes
        try:
            if flown_tapes is None:
                _write(tally, chosen.page, chosen.seed, flyers.how, of_each)
            else:
                command = f"FLIGHTS={chosen.flights} SEED={chosen.seed}"
                told = page_of_bodies(tally, flown_tapes, command, flyers.how)
                write_page(chosen.page, told, MARKDOWN)
        except ChuteError as error:
            unwritten = str(error)
    flown = tally.flights - before
    if chosen.plan and flown:
        rate = flown / (tally.took - took_before) / flyers.number
        print(plan(chosen.plan, rate, flown, chosen.core_hour_price))
    if broken:
        sys.exit(f"campaign: {broken}; {_BROKEN}")
    if unwritten:
        sys.exit(f"campaign: {unwritten}")
    if tally.wrong:
        sys.exit(1)
    if tally.flights < len(seeds):
        # What was flown until then is told; now it ends as every tool does.
        raise KeyboardInterrupt


@contextmanager
def _flyers(
    scheduler: str | None, profiles: Path, jobs: int, tapes: TapeFile | None
) -> Iterator[_Flyers]:
    """On the cluster of a scheduler, or here. Exit code 2: there is none, or it differs."""
    if scheduler is None:
        how = f"{jobs} at a time on {machine()}"
        bundle = partial(campaign.fly_bundle, profiles, tapes=tapes)
        shared = campaign.shipped(profiles, tapes)
        yield _Flyers(jobs, how, lambda seeds: flown_here(bundle, shared, seeds, jobs))
        return
    try:
        # Here: no other campaign needs it.
        from chute_ros.tools.campaign_cluster import Cluster

        cluster = Cluster(scheduler)
    except ImportError as error:
        refused = (
            f"--scheduler needs {error.name}, which this Python cannot import: "
            "`python3 -m pip install -r requirements/extra.in` brings it"
        )
    except CampaignError as error:
        refused = str(error)
    else:
        with closing(cluster):
            how = f"{cluster.workers} workers of a Dask cluster: {cluster.machines}"
            yield _Flyers(cluster.workers, how, cluster.flown)
        return
    print(f"campaign: {refused}", file=sys.stderr)
    sys.exit(2)


def _told(line: campaign.FlightSummary) -> str:
    what = f"{line.vehicle}, {line.profile}, {line.failure}"
    return f"seed {line.seed}, {what}: {line.count.name}: {line.why}"


class _Kept:
    """What was flown so far, in a file; None: nowhere."""

    def __init__(
        self, path: Path | None, seed: int, profiles: Path, tapes: TapeFile | None = None
    ) -> None:
        self._path, self._seed = path, seed
        more = () if tapes is None else (tapes.path,)
        self._code = "" if path is None else checkpoint.code_that_flies(profiles, *more)
        self._due = time.monotonic() + _KEEP_EVERY

    def tally(self) -> campaign.Tally:
        """The flights of the last time; RecordError: they are not of this campaign."""
        if self._path is None or not self._path.exists():
            return campaign.Tally()
        try:
            with open_regular(self._path) as file:
                text = file.read().decode("utf-8", errors="replace")
        except OSError as error:
            raise RecordError(f"{self._path}: {error.strerror or error}") from None
        tally = checkpoint.tally_of(text, self._seed, self._code, str(self._path))
        print(f"continuing after {tally.flights} flights of {self._path}", file=sys.stderr)
        return tally

    def look(self, tally: campaign.Tally) -> None:
        """Keep it from time to time."""
        if time.monotonic() >= self._due:
            self.keep(tally)

    def keep(self, tally: campaign.Tally) -> None:
        """Now: whole, or as it was."""
        if self._path is None:
            return
        begun = time.monotonic()
        try:
            replace_text(self._path, checkpoint.text_of(tally, self._seed, self._code))
        except OSError as error:
            print(f"not saved: {error}; trying again", file=sys.stderr, flush=True)
        ended = time.monotonic()
        # Of millions of flights the file is large: a twentieth of the time at most goes to it.
        self._due = ended + max(_KEEP_EVERY, 19.0 * (ended - begun))


class _CampaignProgress:
    """A line each few seconds, on the terminal's second channel, and one for each flight that must
    not be, which is saved at once: others may take hours."""

    def __init__(
        self, flights: int, failures: Path, kept: _Kept, drawn: Callable[[int], Scenario]
    ) -> None:
        self._flights, self._failures, self._kept = flights, failures, kept
        self._drawn = drawn
        self._told_at = time.monotonic()
        self._wrong = 0
        #: Why a flight that must not be could not be saved; empty: all were.
        self.unsaved = ""

    def look(self, tally: campaign.Tally) -> None:
        """One more flight has been flown."""
        once_more()
        for line in tally.wrong[self._wrong :]:
            self._wrong += 1
            if self._wrong <= _MOST_TOLD:
                print(_told(line), file=sys.stderr, flush=True)
            self._save(line)
        self._kept.look(tally)
        if time.monotonic() - self._told_at < _TELL_EVERY:
            return
        self._told_at = time.monotonic()
        print(
            f"{tally.flights} of {self._flights} flights, {tally.a_minute:.0f} a minute, "
            f"{len(tally.wrong)} wrong",
            file=sys.stderr,
            flush=True,
        )

    def _save(self, line: campaign.FlightSummary) -> None:
        text = text_of(self._drawn(line.seed), f"{line.count.name}: {line.why}")
        try:
            self._failures.mkdir(parents=True, exist_ok=True)
            (self._failures / f"{line.seed}.json").write_text(text, encoding="utf-8")
        except OSError as error:
            self.unsaved = str(error)


def scheduler(text: str) -> str:
    """Its address: a client waits for ever for what is none."""
    try:
        parts = urlsplit(text)
        named = parts.scheme in ("tcp", "tls") and parts.hostname and parts.port
    except ValueError:
        named = None
    if not named or text != f"{parts.scheme}://{parts.netloc}":
        raise argparse.ArgumentTypeError(f"{text}: need tcp://HOST:PORT")
    return text


def price(text: str) -> float:
    """0 or more."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 <= number < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: need a number, 0 or more")
    return number


def writable(text: str) -> Path:
    """Said before the flights, not after them."""
    path = Path(text)
    if not os.access(path.parent, os.W_OK) or path.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: no file can be written there")
    return path


def page_path(*pictures: str) -> Callable[[str], Path]:
    """The same, of a page with pictures beside it, each with such a suffix, which go over nothing
    else."""

    def path_of(text: str) -> Path:
        path = Path(text)
        try:
            require_output(path, MARKDOWN)
            for suffix in pictures:
                require_output(path.with_suffix(suffix), SVG)
        except ChuteError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
        return path

    return path_of


def scenario(text: str) -> int | Scenario:
    """A seed, or what is in a file that was saved."""
    if text.removeprefix("-").isdecimal():
        return int(text)
    try:
        return scenario_of(read_regular_text(Path(text)), text)[0]
    except (OSError, UnicodeDecodeError) as error:
        raise argparse.ArgumentTypeError(f"{text}: need a seed, or a file: {error}") from None
    except RecordError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def tapes(text: str) -> Path:
    """A file of them."""
    try:
        Tapes(TapeFile(Path(text)))
    except RecordError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return Path(text)


def _write(tally: campaign.Tally, path: Path, seed: int, how: str, of_each: OfEach | None) -> None:
    drawn = dict(zip(("delays", "heights"), map(path.with_suffix, _PICTURES), strict=True))
    write_page(drawn["delays"], picture(tally.lines, "release_delay"), SVG)
    write_page(drawn["heights"], picture(tally.lines, "height_lost"), SVG)
    names = {what: one.name for what, one in drawn.items()}
    write_page(path, page(tally, seed, how, names, of_each), MARKDOWN)


def _replay(profiles: Path, scenario: Scenario, tapes: TapeFile | None) -> None:
    """What was drawn, what happened, what it is counted as."""
    flown, judged = campaign.fly_here(profiles, scenario, tapes)
    print("\n".join(text_of(scenario, "").splitlines()[3:-1]))
    up, truth, person, flies = flown.up, flown.truth, scenario.person, scenario.manoeuvre
    lines = [(at, f"said: {text}") for at, text in flown.said]
    for at, one in flown.decided:
        what = f"{one.named}: {one.action.name} by {one.rule!r}"
        lines.append((at, f"{what}: {'; '.join(one.reasons)}"))
    lines += [(act.at, f"{act.node} acts on {act.decision.action.name}") for act in flown.acted]
    for at, what in (
        (up, "is up"),
        (up + scenario.failure_at, _failure(scenario)),
        (up + person.at if person else math.nan, f"a person wants: {person and person.does}"),
        (up + flies.begin if flies else math.nan, f"begins to fly: {flies and flies.kind}"),
        (truth.at, "ONLY A PARACHUTE HELPS"),
        (truth.latest, "the last moment for its release"),
        (flown.released, "RELEASED"),
        (flown.another.at, "ITS CANOPY DOES NOT CARRY"),
        (flown.released_another, "ANOTHER RELEASED"),
        (flown.landed, f"lands at {flown.landing_speed:.1f} m/s"),
    ):
        if not math.isnan(at):
            lines.append((at, what))
    begin = 0.0 if math.isnan(up) else up
    for at, text in sorted(lines, key=lambda line: line[0]):
        print(f"  {at - begin:8.3f} s  {text}")
    print(f"  {judged.count.value}{': ' if judged.why else ''}{judged.why}")


def _failure(scenario: Scenario) -> str:
    """What fails, and who tells of the vehicle without its autopilot."""
    if scenario.tape is not None:
        return f"{scenario.tape.name}: {scenario.tape.failed}"
    if not outlives(scenario):
        return scenario.failure.value
    return f"{scenario.failure.value}, outlived by: {', '.join(scenario.second_sources)}"
