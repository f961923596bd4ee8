"""Judges flights that were recorded without this suite: what would it have done?

Reads ArduPilot's .bin and .log, MAVLink telemetry (.tlog), PX4's .ulg, recordings of ROS (.bag,
.mcap, .db3, rosbag2 folders) with MAVROS or vehicle/state, and a rocket's flight as .csv. Each log
is heard by the real link and decided by the real core, in virtual time, with the shipped profile
of its kind of vehicle and one armed parachute.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from chute_ros.campaign.shipped import Shipped
from chute_ros.errors import ChuteError
from chute_ros.plain_text import plain
from chute_ros.ros.config_folder import config_folder
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.tools.judge_log import formats, known, table
from chute_ros.tools.judge_log.findings import LogVerdict, verdict_of
from chute_ros.tools.judge_log.flight_log import FlightLog, LogError, reason
from chute_ros.tools.judge_log.log_flight import JudgedLog, fly
from chute_ros.tools.judge_log.page import flight_section, page
from chute_ros.tools.judge_log.sweep import Tried, sweep
from chute_ros.tools.page_file import HTML, MARKDOWN, require_output, write_page
from chute_ros.tools.progress import Progress
from chute_ros.tools.recording_options import complain
from chute_ros.tools.state_rows import RuleTold

CLEAN, FIRED, UNREADABLE = 0, 1, 2
#: What carries one parachute on MAVLink.
_VEHICLE = "mavlink"
#: What was not known for a smaller share of the flight is on the page alone.
_TOLD = 0.05


def main() -> None:
    """Exit code 0: nothing would have been released, and no motor stopped in flight; 1: something
    would; 2: a file cannot be read, and nothing of the others would have been."""
    given = _options().parse_args()
    flights: list[tuple[LogVerdict, str]] = []
    unread: list[tuple[Path, LogError]] = []
    try:
        columns, read_here = dict(given.column), _read_here(given)
        require_output(given.page, HTML, read_here)
        if given.known:
            require_output(given.table, MARKDOWN, read_here)
            what_happened = known.known_of(given.known)
            known.require_all(given.files, what_happened)
        for path in given.files:
            try:
                log = formats.read(path, columns)
                one, verdict, tried = _judged(log, config_of(log, given.profile), given.sweep)
            except LogError as error:
                unread.append((path, error))
                complain("judge_log", error)
                continue
            _tell(verdict, one, tried)
            # What was seen of a flight takes a hundred times as much memory.
            flights.append((verdict, flight_section(len(flights), verdict, one, tried)))
        if flights:
            write_page(given.page, page(flights, unread), HTML, read_here)
            print(f"page: {plain(given.page)}")
        if given.known:
            verdicts = [verdict for verdict, _ in flights]
            told = known.page(verdicts, unread, what_happened)
            write_page(given.table, told, MARKDOWN, read_here)
            print(f"table: {plain(given.table)}")
    except ChuteError as error:
        complain("judge_log", error)
        sys.exit(UNREADABLE)
    sys.exit(
        FIRED if any(verdict.ended for verdict, _ in flights) else UNREADABLE if unread else CLEAN
    )


def _judged(
    log: FlightLog, config: SupervisorConfig, sweeps: bool
) -> tuple[JudgedLog, LogVerdict, list[Tried]]:
    """LogError: it cannot be flown. The other logs are judged all the same."""
    try:
        one = flown(log, config)
        return one, verdict_of(one), sweep(one) if sweeps else []
    except Exception as error:  # noqa: BLE001 - whatever the numbers of a log make of it
        raise LogError(f"{log.path}: it cannot be judged: {reason(error)}") from None


def _options() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(
        "judge_log", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("files", metavar="FILE", nargs="+", type=Path, help="logs")
    options.add_argument(
        "--profile",
        metavar="NAME|FILE",
        help="rules: multirotor, fixed_wing, rocket, or a file (default: by the log's vehicle)",
    )
    options.add_argument(
        "--page",
        type=Path,
        default=Path("judged.html"),
        metavar="HTML",
        help="the page to write (default: %(default)s)",
    )
    options.add_argument(
        "--sweep",
        action="store_true",
        help="also find which thresholds would have kept each flight clean",
    )
    options.add_argument(
        "--known",
        type=Path,
        metavar="TSV",
        help="what happened in these flights: compare, and write the table of --table",
    )
    options.add_argument(
        "--table",
        type=Path,
        default=Path("judged.md"),
        metavar="MD",
        help="with --known: the table to write (default: %(default)s)",
    )
    options.add_argument(
        "--column",
        action="append",
        default=[],
        type=_column,
        metavar="NAME=HEADING[*FACTOR]",
        help=f"a column of a .csv, in SI units once multiplied ({', '.join(table.COLUMNS)})",
    )
    return options


def _read_here(given: argparse.Namespace) -> list[Path]:
    """All that is read, which no page may go over."""
    others = [given.known] if given.known else []
    return [*given.files, *others, *([Path(given.profile)] if given.profile else [])]


def _column(text: str) -> tuple[str, table.Column]:
    try:
        return table.column(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def config_of(log: FlightLog, profile: str | None) -> SupervisorConfig:
    """The rules for this log. ChuteError: there is no such profile."""
    name = profile or log.profile
    folder = config_folder() / "profiles"
    if name.endswith((".yaml", ".yml")) or "/" in name:
        folder, name = Path(name).resolve().parent, Path(name).name
    try:
        return Shipped(folder).config(_VEHICLE, name, False, 0)
    except UnicodeDecodeError as error:
        raise ChuteError(f"--profile {profile}: no text: {error}") from None
    except OSError as error:
        files = (config_folder() / "profiles").glob("*.yaml")
        shipped = ", ".join(sorted(one.stem for one in files))
        why = error.strerror or error
        raise ChuteError(f"--profile {profile or name}: {why}; shipped are {shipped}") from None


def flown(log: FlightLog, config: SupervisorConfig) -> JudgedLog:
    """Fly all of it, and tell how far it is."""
    progress = Progress(f"judging {log.path.name}", max(1, round(log.duration)))
    return fly(log, config, log.duration, lambda at: progress.at(max(0, round(at))))


def _came(rule: RuleTold) -> str:
    """How near, and when; a rule that waits for nothing has no counter."""
    if not rule.hold:
        return f"{rule.name} fulfilled, {rule.fulfilled_at:.1f} s"
    return f"{rule.name} {rule.peak:.2f} of {rule.hold:g} s, {rule.peak_at:.1f} s"


def _tell(verdict: LogVerdict, one: JudgedLog, tried: Sequence[Tried]) -> None:
    log, span = one.log, "flight" if verdict.flew else "log"
    lines = [
        f"{log.path}: {log.format}, profile {one.config.profile.name}",
        f"  {log.duration:.0f} s, {verdict.flew:.0f} s in flight",
        f"  {verdict.words}",
    ]
    lines += [f"    {'; '.join(d.reasons)}" for _, d in one.fired]
    lines += [f"  nearest: {_came(near.told)}{near.short_of}" for near in verdict.moved[:3]]
    lines += [
        f"  not known: {u.name} for {100.0 * u.share:.0f} % of the {span} ({u.why})"
        for u in verdict.unknown
        if u.share >= _TOLD
    ]
    blind = [r for r in verdict.ratings if r.blind >= _TOLD]
    if blind:
        shares = ", ".join(f"{r.told.name} {100.0 * r.blind:.0f} %" for r in blind)
        lines.append(f"  rules blind for a share of the flight: {shares}")
    lines += [f"  note: {text}" for text in log.remarks]
    for t in tried:
        lines.append(f"  sweep: {t.rule}: {t.what} is {t.shipped:g}, {t.words}")
    print("\n".join(map(plain, lines)), flush=True)
