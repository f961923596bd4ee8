"""Dumps, the flash, the FRAM, and restarts."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from chute_ros.conformance.clause import ASKS, Trial, Wait, failed, not_tried
from chute_ros.links.umbilical.conformance.bench import (
    BOOT,
    DUMP,
    EFFECT,
    LINE,
    TELEM,
    ReceivedLine,
    ReceivedLines,
    UmbilicalBench,
    mode_name,
)
from chute_ros.links.umbilical.conformance.document import (
    STORAGE,
    TELEMETRY,
    UmbilicalClause,
    of,
)
from chute_ros.links.umbilical.conformance.permits import REBOOT, WIPE
from chute_ros.links.umbilical.protocol.commands import KINDS
from chute_ros.links.umbilical.protocol.line_parser import FlashUsage, WipeEnded
from chute_ros.links.umbilical.protocol.modes import FlightMode

_DUMPS = "it sends what it stores, and no telemetry meanwhile"
_RESTARTS, _WIPES = "it restarts", "IT WIPES what it stores"
#: The first sign of a work comes within this, s; after this silence it has ended.
_BEGINS, _SILENCE, _WIPE_SILENCE = 5.0, 5.0, 60.0
#: A work is looked at no longer than this, s: a full flash takes some minutes.
_LONGEST = 1800.0
#: So long after its last line a work that telemetry followed is over, s; with telemetry between
#: its lines, it is looked at for so long.
_OVER, _MIXED = 1.0, 10.0
_SEQUENCE = re.compile(r"seq=([0-9]{1,9})")


def _worked(bench: UmbilicalBench, name: str, silence: float) -> Any:
    """All that comes (ReceivedLines) from a command on, until telemetry goes on or this silence,
    s; no lines: nothing came of it."""
    since, began = len(bench.heard), bench.now
    yield from bench.write(KINDS[name].command.token)

    def lines() -> list[ReceivedLine]:
        return [one for one in bench.heard[since:] if one.kind in (LINE, DUMP)]

    def over() -> bool:
        first, last = lines()[0].at, lines()[-1].at
        telemetry = [one.at for one in bench.heard[since:] if one.kind == TELEM]
        again = next((at for at in telemetry if at > first), math.inf)
        quiet = telemetry and telemetry[-1] > last and bench.now - last >= _OVER
        return bool(quiet) or bench.now - again >= _MIXED

    yield Wait(bench.now + _BEGINS, lines)
    if not lines():
        return ReceivedLines((), began, bench.now)
    while not over() and bench.now - bench.heard_at < silence and bench.now - began < _LONGEST:
        yield Wait(min(bench.heard_at + silence, bench.now + _OVER), over)
    return ReceivedLines(bench.heard[since:], began, bench.now)


def _dumped(bench: UmbilicalBench) -> Any:
    """All that comes of a dump of the flash, which is the same for all clauses."""
    if "dumped" not in bench.kept:
        bench.kept["dumped"] = yield from _worked(bench, "dump_flash", _SILENCE)
    return bench.look_at(bench.kept["dumped"].lines)


def _stored(lines: Sequence[ReceivedLine]) -> int:
    """Bytes that are neither telemetry nor log."""
    return sum(len(one.data) for one in lines if one.kind in (LINE, DUMP))


def _dump_flash(bench: UmbilicalBench) -> Trial:
    size = _stored((yield from _dumped(bench)))
    if not size:
        raise failed(f"nothing comes of <G> within {_BEGINS:g} s")
    return f"{size} bytes"


def _dump_within(bench: UmbilicalBench) -> Any:
    """What comes of <G>, and the places of the dump's first and last line in it."""
    lines = yield from _dumped(bench)
    places = [i for i, one in enumerate(lines) if one.kind in (LINE, DUMP)]
    if not places:
        raise not_tried("nothing comes of <G>")
    return lines, places[0], places[-1]


def _interrupts(bench: UmbilicalBench) -> Trial:
    lines, first, last = yield from _dump_within(bench)
    for one in lines[first:last]:
        if one.kind == TELEM:
            raise failed("$TELEM comes within the dump of the flash", [one.packet])
    return "no $TELEM within the dump"


def _resumes(bench: UmbilicalBench) -> Trial:
    lines, _, last = yield from _dump_within(bench)
    after = [one.at for one in lines[last:] if one.kind == TELEM]
    if not after:
        packets = [one.packet for one in lines[last:]]
        raise failed(f"no $TELEM within {_SILENCE:g} s after the dump of the flash", packets)
    return f"{after[0] - lines[last].at:.2f} s after the dump"


def _fram(bench: UmbilicalBench) -> Any:
    """What the FRAM holds, in words; empty: it does not say."""
    lines = (yield from _worked(bench, "dump_fram", _SILENCE)).lines
    return "\n".join(one.data.decode("utf-8", "replace") for one in lines if one.kind == LINE)


def _dump_fram(bench: UmbilicalBench) -> Trial:
    told = yield from _fram(bench)
    if not told:
        raise failed(f"nothing comes of <f> within {_BEGINS:g} s")
    yield from bench.record()
    return f"{told:.60}"


def _usage(bench: UmbilicalBench) -> Any:
    """What comes of flash information: the line (ReceivedLine); None: nothing."""
    yield from bench.write(KINDS["flash_info"].command.token)
    return (yield from bench.wait_for(LINE, EFFECT))


def _flash_info(bench: UmbilicalBench) -> Trial:
    line = yield from _usage(bench)
    if line is None:
        raise failed(f"nothing comes of <I> within {EFFECT:g} s")
    if isinstance(line.said, FlashUsage) and line.said.used > line.said.total:
        raise failed("more is used than there is", [line.packet])
    return f"{line.packet.text:.60}"


# -- what is lost by it -----------------------------------------------------------------------


def _restart(bench: UmbilicalBench) -> Trial:
    took = yield from bench.restart()
    if not took:
        raise failed("<R>: it does not restart")
    return (yield from _as_started(bench, took))


def _as_started(bench: UmbilicalBench, took: str) -> Trial:
    line = yield from bench.record()
    mode = line.values.get("flight_mode")
    if mode != FlightMode.STARTUP:
        raise failed(f"it restarts in {mode_name(mode)} (need Startup)", [line.packet])
    return f"it restarts after {took}, in Startup"


def _wipe_flash(bench: UmbilicalBench) -> Trial:
    before = _used((yield from _usage(bench)))
    lines = (yield from _worked(bench, "wipe_flash", _WIPE_SILENCE)).lines
    for one in lines:
        if isinstance(one.said, WipeEnded) and not one.said.success:
            raise failed(f"<W>: it says {one.packet.text}", [one.packet])
    line = yield from _usage(bench)
    after = _used(line)
    if math.isnan(before) or math.isnan(after):
        raise not_tried("it was sent, and <I> does not report how much of the flash is used")
    if after >= before > 0.0:
        raise failed(f"after <W> it says {line.packet.text}", [line.packet])
    return str(line.packet.text)


def _used(line: ReceivedLine | None) -> float:
    """KB of the flash in use by the answer to flash information; NaN: it does not say."""
    return line.said.used if line and isinstance(line.said, FlashUsage) else math.nan


def _is_reset(before: str, after: str) -> bool:
    """Whether the FRAM holds less than before, by what it says."""
    old, new = _SEQUENCE.search(before), _SEQUENCE.search(after)
    if old and new:
        return int(new[1]) < int(old[1])
    return before != after


def _filled(bench: UmbilicalBench) -> Trial:
    """What the FRAM says; it must hold something that can be seen to go."""
    told = yield from _fram(bench)
    if not _SEQUENCE.search(told):
        raise not_tried(f"its FRAM shows nothing that could go: {told or 'no line'}")
    return str(told)


def _reset_fram(bench: UmbilicalBench) -> Trial:
    before = yield from _filled(bench)
    yield from bench.write(KINDS["reset_fram"].command.token)
    after = yield from _fram(bench)
    if not _is_reset(before, after):
        raise failed(f"<F>: its FRAM still says {after:.60}")
    return f"{before:.20}, then {after:.30}"


def _wipe_and_reboot(bench: UmbilicalBench) -> Trial:
    before = yield from _fram(bench)
    line = yield from bench.record()
    began = bench.now
    yield from bench.write(KINDS["wipe_fram_and_reboot"].command.token)
    if (yield from bench.started_anew(line.values.get(BOOT, 0))) is None:
        raise failed("<X>: it does not restart")
    told = yield from _as_started(bench, f"{bench.now - began:.1f} s")
    after = yield from _fram(bench)
    if _SEQUENCE.search(before) and not _is_reset(before, after):
        raise failed(f"<X>: its FRAM still says {after:.60}")
    return told


_stores, _tells = of(STORAGE), of(TELEMETRY)
CLAUSES: tuple[UmbilicalClause, ...] = (
    _stores("flash-info", "<I> reports the flash", _flash_info, ASKS),
    _stores("dump-fram", "<f> dumps the FRAM", _dump_fram, _DUMPS),
    _stores("dump-flash", "<G> dumps the flash", _dump_flash, _DUMPS),
    _tells("dump-interrupts", "a dump of the flash interrupts $TELEM", _interrupts, _DUMPS),
    _tells("dump-resumes", "after the dump $TELEM goes on", _resumes, _DUMPS),
    _stores(
        "reboot", "<R> reboots it, into Startup", _restart, _RESTARTS, needs=REBOOT, restarts=True
    ),
)
#: What wipes comes after what fills.
WIPES: tuple[UmbilicalClause, ...] = (
    _stores("reset-fram", "<F> resets the FRAM", _reset_fram, _WIPES, needs=WIPE),
    _stores("wipe-flash", "<W> wipes the flash", _wipe_flash, _WIPES, needs=WIPE),
    _stores(
        "wipe-reboot",
        "<X> wipes the FRAM and reboots",
        _wipe_and_reboot,
        f"{_WIPES}, and restarts",
        needs=WIPE,
        restarts=True,
    ),
)
