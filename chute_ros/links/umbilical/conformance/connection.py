"""Heartbeats, what is no command, the target of BLiMS, and a long watch."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from chute_ros.conformance.clause import READS, SOAK, Risk, Trial, failed, not_tried
from chute_ros.links.umbilical.conformance.bench import (
    LOG,
    PAUSE,
    SETTLES,
    TELEM,
    ReceivedLine,
    UmbilicalBench,
)
from chute_ros.links.umbilical.conformance.document import (
    BLIMS,
    COMMANDS,
    CONNECTION,
    TELEMETRY,
    UmbilicalClause,
    of,
)
from chute_ros.links.umbilical.protocol.commands import set_target
from chute_ros.links.umbilical.protocol.scheduler import HEARTBEAT

#: HEARTBEAT_TIMEOUT_MS is typically this, s; "typically" leaves so much; none is sent for so long.
_TIMEOUT, _TYPICALLY, _UNHEARD = 15.0, 1.5, 18.0
_CONNECTION = re.compile(r"umbilical .*?\b(dis)?connected", re.IGNORECASE)
#: The example of the document, and another place: as many of them as the firmware takes.
_BEATS = 5
_HERE, _THERE = (42.441913, -76.4878), (-56.5, 78.65)
_AIMS = "its target is changed, and set back in the end if it had one"
_MUST_NOT = "it must do nothing"
#: What no firmware moves because no <H> comes; some open the SV then.
_NOT_BY_SILENCE = ("mav_open", "ssa_drogue_deployed", "ssa_main_deployed")
_UNHEARD_DOES = "no <H> is sent for 18 s: some firmware opens the SV then, to vent the tank"
_HARMLESS = tuple(f"<{one}>".encode() for one in ("Q", "Z", "QQ", "", "?"))
#: No command is in any of them, whatever a device takes for a bracket or a letter.
_NOISE = (b">>;", bytes([0, 255, 27, 7, 8, 255, 0, 254]), bytes(range(128, 192)) * 2)
_LONG = b"<" + b"Q" * 600 + b">"


def _place(bench: UmbilicalBench, point: tuple[float, float]) -> tuple[float, ...]:
    return point * (bench.layout.target_floats // 2)


def _token(bench: UmbilicalBench, point: tuple[float, float]) -> bytes:
    return set_target(bench.layout, _place(bench, point)).command.token


def _shows_targets(bench: UmbilicalBench) -> None:
    if not bench.layout.target_fields:
        raise not_tried(f"{bench.layout.name} shows no target")


def _aimed(bench: UmbilicalBench) -> Trial:
    """It is aimed here: a place that can be seen to change."""
    _shows_targets(bench)
    if not (yield from bench.aim(_place(bench, _HERE))):
        raise not_tried("it takes no target, by which it could be seen")
    return ""


def _still_takes(bench: UmbilicalBench, after: str) -> Trial:
    """The next command is carried out."""
    took = yield from bench.aim(_place(bench, _THERE))
    if not took:
        raise failed(f"after {after} a command is not carried out, 3 times")
    return f"the next command is carried out after {took}"


# -- heartbeats -----------------------------------------------------------------------------------


def _heartbeat(bench: UmbilicalBench) -> Trial:
    before = yield from bench.record()
    since = len(bench.heard)
    for _ in range(_BEATS):
        yield from bench.write(HEARTBEAT.token)
    yield from bench.watch_on(SETTLES)
    bench.unchanged(before, since, f"after {_BEATS} <H> in a row")
    return "nothing else changes"


def _unheard(bench: UmbilicalBench) -> Any:
    """A while (ReceivedLines), after a last heartbeat, in which none is sent."""
    if "unheard" not in bench.kept:
        bench.takes(Risk.ARMS, "a while without <H>")
        yield from bench.write(HEARTBEAT.token)
        bench.beats = False
        try:
            yield from bench.watch_as("unheard", _UNHEARD)
        finally:
            bench.beats = True
        yield from bench.watch_on(SETTLES)
    bench.look_at(bench.kept["unheard"].lines)
    return bench.kept["unheard"]


def _timeout(bench: UmbilicalBench) -> Trial:
    watch = yield from _unheard(bench)
    for one in bench.heard:
        if one.at < watch.began and _connected(one) is False:
            raise failed("it counts as lost while <H> comes each second", [one.packet])
    lost = [one for one in watch.lines if _connected(one) is False]
    if not lost:
        if any(_connected(one) for one in bench.heard):
            raise failed(f"it counts as connected {_UNHEARD:g} s after the last <H>")
        raise not_tried(
            "no field of $TELEM and no line of its log reports whether it is connected"
        )
    after = lost[0].at - watch.began
    told = f"it counts as lost {after:.1f} s after the last <H>"
    if abs(after - _TIMEOUT) > _TYPICALLY:
        raise failed(f"{told} (typically 15)", [lost[0].packet])
    return told


def _connected(line: ReceivedLine) -> bool | None:
    """What a line of its log says of the connection; None: nothing."""
    found = _CONNECTION.search(line.data.decode("latin-1")) if line.kind == LOG else None
    return None if found is None else not found[1]


def _goes_on(bench: UmbilicalBench) -> Trial:
    watch = yield from _unheard(bench)
    longest = watch.longest_pause
    if longest > PAUSE:
        text = f"without <H> it pauses for {longest:.1f} s (need at most {PAUSE:g})"
        raise failed(text, [one.packet for one in watch.lines])
    for earlier, later in pairwise(one for one in watch.lines if one.kind == TELEM):
        for name in _NOT_BY_SILENCE:
            was, now = earlier.values.get(name), later.values.get(name)
            if None not in (was, now) and was != now:
                both = [earlier.packet, later.packet]
                raise failed(f"without <H> {name} went from {was} to {now}", both)
    return f"the longest pause {longest:.2f} s"


# -- what is no command -------------------------------------------------------------------------


def _unknown(bench: UmbilicalBench) -> Trial:
    return (yield from bench.nothing(*_HARMLESS))


def _brackets(bench: UmbilicalBench) -> Trial:
    yield from _aimed(bench)
    inner = _token(bench, _THERE)[1:-1]
    wrong = (b"%b", b"(%b)", b"[%b]", b"{%b}", b">%b<")
    return (yield from bench.nothing(*(one % inner for one in wrong)))


def _half(bench: UmbilicalBench) -> Trial:
    yield from _aimed(bench)
    yield from bench.nothing(_token(bench, _THERE)[:-5])
    return (yield from _still_takes(bench, "half a command"))


def _split(bench: UmbilicalBench) -> Trial:
    yield from _aimed(bench)
    first, comma, rest = _token(bench, _THERE).rpartition(b",")
    return (yield from _only(bench, "in two writes", (first, comma + rest)))


def _joined(bench: UmbilicalBench) -> Trial:
    yield from _aimed(bench)
    both = _token(bench, _HERE) + _token(bench, _THERE)
    return (yield from _only(bench, "with another in one write", (both,)))


def _only(bench: UmbilicalBench, how: str, writes: Sequence[bytes]) -> Trial:
    """It may take a command that comes so, or leave it; but nothing else, and the next one."""
    before = yield from bench.record()
    since = len(bench.heard)
    for data in writes:
        yield from bench.write(data)
    yield from bench.watch_on(SETTLES)
    after = yield from bench.record()
    bench.unchanged(before, since, f"after a command {how}", bench.layout.target_fields)
    taken = bench.aims(after, _place(bench, _THERE))
    if not taken and not bench.aims(after, _place(bench, _HERE)):
        target = yield from bench.target()
        raise failed(f"after a command {how} its target is {target}", [after.packet])
    yield from bench.aim(_place(bench, _HERE))
    told = yield from _still_takes(bench, f"a command {how}")
    return f"{'carried out' if taken else 'not carried out'}; {told}"


def _noise(bench: UmbilicalBench) -> Trial:
    yield from _aimed(bench)
    yield from bench.nothing(*_NOISE)
    return (yield from _still_takes(bench, "bytes that are no text"))


def _long(bench: UmbilicalBench) -> Trial:
    yield from _aimed(bench)
    yield from bench.nothing(_LONG)
    return (yield from _still_takes(bench, f"a token of {len(_LONG)} bytes"))


# -- the target -----------------------------------------------------------------------------------


def _target(bench: UmbilicalBench) -> Trial:
    _shows_targets(bench)
    took = ""
    for point in (_HERE, _THERE):
        took = yield from bench.aim(_place(bench, point))
        if not took:
            told = yield from bench.target()
            raise failed(f"{_token(bench, point).decode()}: telemetry shows {told}")
    return f"shown after {took}"


def _no_place(bench: UmbilicalBench) -> Trial:
    yield from _aimed(bench)
    for latitude, longitude in ((95.5, 70.5), (-95.5, 70.5), (50.5, 195.5), (50.5, -195.5)):
        numbers = [latitude, longitude] * (bench.layout.target_floats // 2)
        yield from bench.nothing(b"<T,%b>" % ",".join(map(str, numbers)).encode())
    return "the target stays"


def _no_target(bench: UmbilicalBench) -> Trial:
    yield from _aimed(bench)
    more = ",".join(["50.5"] * (bench.layout.target_floats + 1))
    wrong = ("T", "T,", "T,,", "T,50.5", f"T,{more}", "T,?,?", "T,50.5,", "T;50.5;70.5")
    return (yield from bench.nothing(*(f"<{one}>".encode() for one in wrong)))


# -- over hours -----------------------------------------------------------------------------------


def _soak(bench: UmbilicalBench) -> Trial:
    before = yield from bench.record()
    since = len(bench.heard)
    yield from bench.watch_as("soak", bench.soak)
    longest = bench.kept["soak"].longest_pause
    if longest > PAUSE:
        raise failed(f"$TELEM paused for {longest:.1f} s")
    bench.unchanged(before, since, "without a command")
    return f"{bench.soak:g} s"


_beats, _takes, _aim = of(CONNECTION), of(COMMANDS), of(BLIMS)
CLAUSES: tuple[UmbilicalClause, ...] = (
    _beats("heartbeat", "<H> keeps the connection, and does nothing else", _heartbeat, _MUST_NOT),
    _beats(
        "heartbeat-timeout",
        "without <H> for typically 15 s the connection counts as lost, not before",
        _timeout,
        _UNHEARD_DOES,
        Risk.ARMS,
    ),
    _beats(
        "unconnected",
        "the umbilical runs independently: without <H> telemetry goes on",
        _goes_on,
        _UNHEARD_DOES,
        Risk.ARMS,
    ),
    _aim("target", "<T,lat,lon> sets the target, which telemetry shows", _target, _AIMS),
    _aim("target-range", "what is no latitude or longitude sets no target", _no_place, _AIMS),
    _aim("target-form", "another count or form of numbers sets no target", _no_target, _AIMS),
    _takes("unknown", "a command that is none does nothing", _unknown, _MUST_NOT),
    _takes("brackets", "a command without its angle brackets does nothing", _brackets, _AIMS),
    _takes("half", "half a command does nothing, and the next is carried out", _half, _AIMS),
    _takes("split", "a command in two writes is carried out whole, or not", _split, _AIMS),
    _takes("joined", "two commands in one write do nothing but what they say", _joined, _AIMS),
    _takes("noise", "bytes that are no text do no harm", _noise, _AIMS),
    _takes("long-token", "a token without end does no harm", _long, _AIMS),
)
AT_LAST: tuple[UmbilicalClause, ...] = (
    of(TELEMETRY)(
        "soak",
        "$TELEM goes on without a pause, a restart or a change that nobody asked for",
        _soak,
        READS,
        Risk.NONE,
        SOAK,
    ),
)
