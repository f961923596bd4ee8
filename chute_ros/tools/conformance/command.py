"""Tries a device on the bench against each clause of its document.

conformance DEVICE [--connection ...] [--arm] [--fire] [--html FILE] [--junit FILE] [--mcap FILE]

Nothing is armed without --arm, and nothing is fired without --fire; each is asked for again. Exit
code 0: no clause failed; 1: one did; 2: a mistake in the command line; 3: the run is not whole (no
device, aborted, a device that fell silent or could not be left disarmed); 74: standard output
cannot be written; 141: nobody reads on.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import platform
import queue
import signal
import socket
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, TextIO

from chute_ros.conformance.clause import ASKS, READS, SOAK, Clause, Result, Risk, Verdict
from chute_ros.conformance.kit import Kit
from chute_ros.conformance.session import Allowed, Bench, DeviceFound, Ended, Session, Trying
from chute_ros.errors import ChuteError
from chute_ros.interrupts import at_ctrl_c
from chute_ros.links.api import LinkKind, load
from chute_ros.links.registered import links
from chute_ros.plain_text import plain
from chute_ros.ros.own_version import own_version
from chute_ros.sim.command_line import real
from chute_ros.tools.conformance.page import page
from chute_ros.tools.conformance.report import ConformanceReport
from chute_ros.tools.conformance.traffic import MCAP, recording
from chute_ros.tools.page_file import (
    HTML,
    JUNIT,
    require_output,
    write_output,
    write_page,
)
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.wire_events import LoopFault, WireChange, WireTrouble

#: What ends a process besides a Ctrl-C: somebody, or a terminal that is closed.
_ENDS = {signal.SIGTERM: "SIGTERM", signal.SIGHUP: "the end of its terminal"}
_UNREAD = "nobody reads what it reports"
DONE, FAILED, MISTAKE, NOT_WHOLE = 0, 1, 2, 3
#: After a Ctrl-C the device is disarmed, which takes this long at most, s.
_ENDS_WITHIN = 40.0
_MARKS = {
    Verdict.PASSED: "passed",
    Verdict.FAILED: "FAILED",
    Verdict.NOT_SUPPORTED: "not supported",
    Verdict.NOT_TRIED: "not tried",
}
#: What is typed again, and what it allows.
_WORDS = {Risk.ARMS: "ARM", Risk.FIRES: "FIRE"}


def main() -> None:
    """Run the kit of the device that is named."""
    kinds = {one.device: one for one in links().values() if one.kit}
    device = _device(kinds)
    try:
        kit: Kit = load(kinds[device].kit)
        arguments = sys.argv[1:]
        arguments.remove(device)
        chosen = _options(kinds, device, kit).parse_args(arguments)
        if chosen.list:
            _list(kit)
            return
        sys.exit(_run(device, kit, chosen))
    except ChuteError as error:
        print(f"conformance: {plain(error)}", file=sys.stderr)
        sys.exit(MISTAKE)


def _device(kinds: Mapping[str, LinkKind]) -> str:
    """The device that the command line names: options of its own follow."""
    named = next((one for one in sys.argv[1:] if not one.startswith("-")), "")
    if named not in kinds:
        names = ", ".join(kinds)
        if not named and {"-h", "--help"} & {*sys.argv}:
            options = "`conformance DEVICE --help` has its options"
            print(f"{__doc__}\nDEVICE is one of {names}; {options}")
            sys.exit(DONE)
        text = f"no kit is called {named!r}" if named else "no device is named"
        print(f"{__doc__}\nconformance: {text}: need one of {names}", file=sys.stderr)
        sys.exit(MISTAKE)
    return named


def _options(kinds: Mapping[str, LinkKind], device: str, kit: Kit) -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(
        f"conformance {device}",
        description=f"{kinds[device].description}: {kit.document}",
    )
    options.add_argument(
        "--connection",
        default=kit.default_connection,
        metavar="WIRE",
        help=f"{kit.forms} (default: {kit.default_connection})",
    )
    options.add_argument("--arm", action="store_true", help="try what arms the device")
    options.add_argument("--fire", action="store_true", help="try what fires it, and what arms it")
    options.add_argument(
        "--only", nargs="+", default=[], metavar="CLAUSE", help="these clauses alone (--list)"
    )
    options.add_argument(
        "--soak",
        type=real("seconds", 1.0, 1e6),
        metavar="SECONDS",
        help="watch the device for so long in the end",
    )
    options.add_argument("--html", type=Path, metavar="FILE", help="write the report for people")
    options.add_argument("--junit", type=Path, metavar="FILE", help="write it as JUnit")
    options.add_argument("--mcap", type=Path, metavar="FILE", help="write all traffic")
    options.add_argument("--list", action="store_true", help="list the clauses")
    kit.add_options(options)
    return options


def _list(kit: Kit) -> None:
    for one in kit.clauses:
        takes = " ".join(filter(None, (one.needs, one.risk.option)))
        print(f"{one.name:20s} {one.text}" + (f" ({takes})" if takes else ""))


def _run(device: str, kit: Kit, chosen: argparse.Namespace) -> int:
    clauses = _clauses(kit, chosen.only)
    risk = Risk.FIRES if chosen.fire else Risk.ARMS if chosen.arm else Risk.NONE
    bench, wire = kit.bench(chosen, risk), kit.wire(chosen)
    given = {f"--{name.replace('_', '-')}" for name, value in vars(chosen).items() if value}
    # A long run must not end with a report that cannot be written.
    for path, kind in ((chosen.html, HTML), (chosen.junit, JUNIT), (chosen.mcap, MCAP)):
        if path is not None:
            require_output(path, kind)
    if chosen.junit:
        _require("--junit", "junitparser")
    if chosen.mcap:
        _require("--mcap", "mcap")
    if risk is not Risk.NONE:
        _ask(kit, risk)
    session, events = Session(bench, clauses, Allowed(risk, given)), queue.SimpleQueue[Any]()
    # They come like any other event: in the middle of a line one would leave the device armed, and
    # after the last clause its report half written.
    with at_ctrl_c(lambda number, _: events.put(signal.Signals(number)), _ENDS):
        began = time.time_ns()
        other = [one.name for one in clauses if one.without in given]
        results, found, problem = _tried(session, wire, events, other)
        begun = datetime.fromtimestamp(began / 1e9, timezone.utc)
        about = {
            "device": found or "not found",
            **bench.identity(),
            "connection": chosen.connection,
            "allowed": risk.name,
            "kit": f"chute_ros {own_version()}",
            "begun": begun.isoformat(timespec="seconds"),
            "computer": f"{socket.gethostname()}, Python {platform.python_version()}",
        }
        about, whom = {name: plain(text) for name, text in about.items()}, f"{device} {found}"
        report = ConformanceReport(
            kit.document, whom.strip(), about, results, problem, bench.traffic, began
        )
        _say(report.summary)
        if problem:
            _say(f"conformance: {plain(problem)}", sys.stderr)
        _write(chosen, report)
    return NOT_WHOLE if problem else FAILED if report.of(Verdict.FAILED) else DONE


def _clauses(kit: Kit, only: Sequence[str]) -> list[Clause[Any]]:
    names = [one.name for one in kit.clauses]
    if unknown := [one for one in only if one not in names]:
        raise ChuteError(f"--only {' '.join(unknown)}: no such clause; --list has all")
    return [one for one in kit.clauses if not only or one.name in only]


def _require(option: str, package: str) -> None:
    """ChuteError: the package that only this option needs is not installed, as on few machines."""
    if importlib.util.find_spec(package) is None:
        raise ChuteError(
            f"{option}: {package} is not installed: `python3 -m pip install {package}` brings it"
        )


def _junit(report: ConformanceReport) -> str:
    # Here: few machines have what only this needs.
    from chute_ros.tools.conformance.junit import junit

    return junit(report)


def _ask(kit: Kit, risk: Risk) -> None:
    """The word, typed again; another one sends nothing."""
    word = _WORDS[risk]
    may = "FIRE" if risk is Risk.FIRES else "be ARMED"
    if not _say(f"The device may {may}: {kit.fires}.\nType {word} to go on: ", end=""):
        raise ChuteError(f"{_UNREAD}: nothing was sent")
    if sys.stdin.readline().strip() != word:
        raise ChuteError(f"{word} was not typed: nothing was sent")


def _tried(
    session: Session[Bench], wire: Any, events: queue.SimpleQueue[Any], other: Sequence[str]
) -> tuple[list[Result], str, str]:
    """(results, who was found, why it is not whole). other: clauses of another kind of device,
    which are counted and not told one by one."""

    def deliver(many: list[Any]) -> None:
        for one in many:
            events.put(one)

    loop = WireLoop(session, wire, deliver)
    results: list[Result] = []
    found, problem = "", ""
    ends_at = float("inf")

    def abort(why: str) -> None:
        nonlocal ends_at
        ends_at = min(ends_at, time.monotonic() + _ENDS_WITHIN)
        loop.call(lambda link, now: link.abort(why, now))

    loop.start()
    try:
        while time.monotonic() < ends_at:
            event = _next(events)
            if isinstance(event, Ended):
                return results, found, event.problem
            if isinstance(event, DeviceFound):
                found = plain(event.text)
            elif isinstance(event, Result):
                results.append(event)
            elif isinstance(event, signal.Signals):
                abort(f"aborted by {_ENDS.get(event, 'Ctrl-C')}")
            elif isinstance(event, LoopFault):
                problem = f"a mistake of the kit: {event.text}"
                abort(problem)
            elif isinstance(event, WireChange) and not event.is_open:
                abort(event.text)
            elif isinstance(event, WireTrouble) and event.text:
                _say(f"conformance: {plain(event.text)}", sys.stderr)
            if (line := line_of(event, other)) and not _say(line):
                abort(_UNREAD)
    finally:
        loop.stop()
    return results, found, problem or "the device was NOT left disarmed: no answer in time"


def _say(text: str, stream: TextIO | None = None, end: str = "\n") -> bool:
    """Whether it could be told: who reads may have gone, and what is tried is left as it should be
    all the same."""
    stream = stream or sys.stdout
    try:
        print(text, file=stream, end=end, flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        return False
    return True


def _next(events: queue.SimpleQueue[Any]) -> Any:
    """The next event; None: a while passed without one."""
    try:
        return events.get(timeout=0.5)
    except queue.Empty:
        return None


def line_of(event: Any, other: Sequence[str]) -> str:
    """What is told of it; empty: nothing."""
    if isinstance(event, DeviceFound):
        left_out = f"\n  not tried      {len(other)} clauses that are of another kind of device"
        return f"found {plain(event.text)}{left_out if other else ''}"
    if isinstance(event, Trying) and _is_told(event.clause):
        return f"  [{event.number}/{event.of}] {event.clause.name}: {event.clause.does}"
    if isinstance(event, Result) and event.clause.name not in other:
        name, why = event.clause.name, plain(event.why)
        return f"  {_MARKS[event.verdict]:14s} {name:20s} {why}"
    return ""


def _is_told(clause: Clause[Any]) -> bool:
    """Before it is tried: the device may do something, or nothing is told for long."""
    return clause.does not in (READS, ASKS) or SOAK in clause.needs


def _write(chosen: argparse.Namespace, report: ConformanceReport) -> None:
    writers: list[tuple[Path | None, Callable[[Path], object]]] = [
        (chosen.html, lambda path: write_page(path, page(report), HTML)),
        (chosen.junit, lambda path: write_page(path, _junit(report), JUNIT)),
        (chosen.mcap, lambda path: write_output(path, recording(report), MCAP)),
    ]
    for path, write in writers:
        if path is not None:
            write(path)
            _say(str(path))
