"""The ground's end of an umbilical: sends commands, and remembers all lines that come."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any

from chute_ros.conformance.bench import ReceivedPacket, RecordingBench, first_of
from chute_ros.conformance.clause import Packet, Risk, Trial, Wait, failed
from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.conformance.permits import check_options, risk_of
from chute_ros.links.umbilical.protocol.commands import KINDS, set_target
from chute_ros.links.umbilical.protocol.fields import Value, convert, problem_of
from chute_ros.links.umbilical.protocol.layouts import Layout, Problem
from chute_ros.links.umbilical.protocol.line_parser import (
    FlashUsage,
    LogLine,
    Saying,
    Telemetry,
    recognise,
)
from chute_ros.links.umbilical.protocol.modes import FlightMode
from chute_ros.links.umbilical.protocol.scheduler import HEARTBEAT
from chute_ros.links.umbilical.protocol.stream import DumpBytes, DumpEnded, Line, StreamReader

TELEM, LOG, LINE, DUMP = "$TELEM", "log line", "line", "dump"
#: Of our own heartbeats; between two writes, as the receiver sleeps for 0.1 s after each; s.
_BEAT, SPACING = 1.0, 0.12
#: The port's buffer holds bytes from before it was opened for so long, s.
_STALE = 0.3
_FOUND_WITHIN = 10.0
#: Telemetry comes at least this often, s: the fill station takes a longer pause for a lost link.
PAUSE = 3.0
#: A command shows within this, s. Nothing is acknowledged: one that may be given again is sent so
#: often.
EFFECT, TRIES = 1.5, 3
#: After a command without effect all that it could do is seen within this, s.
SETTLES = 0.7
_RESTARTS_WITHIN = 10.0
BOOT = "ms_since_boot_cfc"
VALVES = ("mav_open", "sv_open")
#: What commands move.
MOVED = (
    *("flight_mode", *VALVES, "ssa_drogue_deployed", "ssa_main_deployed"),
    *("cmd_n1", "cmd_n2", "cmd_n3", "cmd_n4", "cmd_a1", "cmd_a2", "cmd_a3"),
)
#: A 32-bit float of a longitude is exact to 8e-6 degrees.
_TOLERANCE = 2e-5


@dataclass(frozen=True)
class ReceivedLine(ReceivedPacket):
    """A line, or a part of a dump. said: what a line says that is known. For $TELEM: whole: it
    stands alone in its line; texts: its fields; values: those that are of their type, by name;
    problems: why the others are not."""

    data: bytes
    said: Saying | None = None
    whole: bool = True
    texts: Sequence[str] = ()
    values: Mapping[str, Value] = field(default_factory=dict)
    problems: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class ReceivedLines:
    """All that came in a while. began, ended: monotonic s."""

    lines: Sequence[ReceivedLine]
    began: float
    ended: float

    @property
    def telemetry(self) -> list[ReceivedLine]:
        """The $TELEM lines."""
        return [one for one in self.lines if one.kind == TELEM]

    @property
    def longest_pause(self) -> float:
        """Without a $TELEM line, s."""
        times = [self.began, *(one.at for one in self.telemetry), self.ended]
        return max(later - earlier for earlier, later in pairwise(times))


class UmbilicalBench(RecordingBench[ReceivedLine]):
    """layout: of $TELEM. risk, options: what the person allows; nothing beyond is ever sent. soak:
    how long the device is watched in the end, s."""

    def __init__(
        self,
        layout: Layout,
        risk: Risk = Risk.NONE,
        options: Collection[str] = (),
        soak: float = 0.0,
    ) -> None:
        super().__init__(risk)
        self.layout, self.soak, self.beats = layout, soak, True
        #: What one clause has watched and others look at as well.
        self.kept: dict[str, ReceivedLines] = {}
        #: Bytes that end a line besides its newline.
        self.returns: list[Packet] = []
        self._options = options
        self._reader = StreamReader(self._is_telemetry, Counter())
        self._is_found = self._began_within_line = False
        self._target_before: tuple[Value, ...] | None = None
        self._next_beat = self._free_at = -math.inf
        self._output: list[bytes] = []

    # -- as the session wants it ------------------------------------------------------------------

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        self.at(now)
        if now < self._began + _STALE:
            self._began_within_line = True
            return
        self.heard_at = now
        if b"\r" in data and not self._reader.dumping:
            self.returns.append(self.noted(False, "", "carriage return", "", data))
        for item in self._reader.feed(data):
            if isinstance(item, Line):
                self._line(item.data)
            elif isinstance(item, DumpBytes):
                self._keep(DUMP, f"{len(item.data)} bytes", item.data)
            else:
                self._keep(DUMP, "ends" if isinstance(item, DumpEnded) else "begins", b"")

    def stream_ended(self, stream: Hashable) -> None:
        self._reader = StreamReader(self._is_telemetry, Counter())
        self._began_within_line = True

    def update(self, now: float) -> None:
        self.at(now)
        if self.beats and now >= self._next_beat and now >= self._free_at:
            self._next_beat = now + _BEAT
            self._write(HEARTBEAT.token)

    def next_deadline(self) -> float:
        return max(self._next_beat, self._free_at) if self.beats else math.inf

    def take_output(self) -> list[bytes]:
        output, self._output = self._output, []
        return output

    # -- what came --------------------------------------------------------------------------------

    def _is_telemetry(self, body: bytes) -> bool:
        return body.count(b",") + 1 == self.layout.count

    def _line(self, data: bytes) -> None:
        if self._began_within_line:
            self._began_within_line = False
            return
        said = recognise(data)[0]
        if not isinstance(said, Telemetry):
            kind = LOG if isinstance(said, LogLine) else LINE
            self._keep(kind, data.decode("utf-8", "replace"), data, said=said)
            return
        texts = said.body.split(",")
        values, problems = self._fields(said.body, texts)
        whole = data.startswith(b"$TELEM,")
        fields = {"whole": whole, "texts": texts, "values": values, "problems": problems}
        self._keep(TELEM, said.body, data, said=said, **fields)
        if BOOT in values:
            self.device_is_up(values[BOOT], 2.0**32)

    def _fields(self, body: str, texts: list[str]) -> tuple[dict[str, Value], dict[str, str]]:
        decoded = self.layout.decode(body)
        if not isinstance(decoded, Problem):
            return dict(zip(self.layout.index, decoded, strict=True)), {}
        if len(texts) != self.layout.count:
            return {}, {}
        values, problems = {}, {}
        for one, text in zip(self.layout.fields, texts, strict=True):
            if wrong := problem_of(one.kind, text):
                problems[one.name] = f"{one.name} is {text!r:.60}: {wrong} (need {one.kind.name})"
            else:
                values[one.name] = convert(one.kind, text)
        return values, problems

    def _keep(self, kind: str, text: str, data: bytes, **more: object) -> None:
        packet = self.noted(False, "device", kind, text, data)
        self.heard.append(ReceivedLine(self.now, kind, packet, data, **more))  # type: ignore[arg-type]

    # -- what is sent -----------------------------------------------------------------------------

    def write(self, data: bytes) -> Trial:
        """Write these bytes at once, as soon as the write before is long enough ago."""
        check_options(data, self.allowed, self._options)
        self.takes(risk_of(data), repr(data))
        while self.now < self._free_at:
            yield Wait(self._free_at)
        self._write(data)
        return ""

    def _write(self, data: bytes) -> None:
        self._free_at = self.now + SPACING
        self.noted(True, "us", "write", text_of(data), data)
        self._output.append(data)

    def order(self, name: str, shows: Callable[[ReceivedLine], bool]) -> Trial:
        """Give a command by its name; the text is empty if no telemetry shows its effect."""
        kind = KINDS[name]
        tries = 1 if kind.once else TRIES
        return (yield from self.repeated(kind.command.token, shows, tries))

    def repeated(
        self, data: bytes, shows: Callable[[ReceivedLine], bool], tries: int = TRIES
    ) -> Trial:
        """The same for bytes that are written so often until the effect shows."""
        began = self.now
        for _ in range(tries):
            yield from self.write(data)
            if (yield from self.wait_for(TELEM, EFFECT, shows)) is not None:
                return f"{self.now - began:.2f} s"
        return ""

    def aim(self, values: tuple[float, ...]) -> Trial:
        """Set the target; the text is empty if telemetry does not show it."""
        if self._target_before is None:
            self._target_before = yield from self.target()
        token = set_target(self.layout, values).command.token
        return (yield from self.repeated(token, lambda one: self.aims(one, values)))

    # -- steps of trials --------------------------------------------------------------------------

    def find(self) -> Trial:
        """What sends $TELEM, by its layout."""
        yield Wait(
            self.now + _FOUND_WITHIN, first_of(self.heard, 0, lambda one: one.kind == TELEM)
        )
        lines = [one for one in self.heard if one.kind == TELEM]
        if not lines:
            count = sum(len(one.raw) for one in self.traffic if not one.sent)
            raise failed(
                f"no $TELEM line is received within {_FOUND_WITHIN:g} s ({count} bytes were): "
                "check the port, and that no other program reads it"
            )
        self._is_found = True
        return f"flight computer ({self.layout.name})"

    def identity(self) -> Mapping[str, str]:
        """A flight computer tells no name: its flight mode as it was found, and its flash."""
        modes = (one.values["flight_mode"] for one in self.heard if "flight_mode" in one.values)
        told = {"found in": mode_name(next(modes, None))} if self._is_found else {}
        used = [one.said for one in self.heard if isinstance(one.said, FlashUsage)]
        if used:
            told["flash"] = f"{used[0].used} of {used[0].total} KB used"
        return told

    def leave(self) -> Trial:
        """Key disarmed, valves closed, not in flight, the target as it was."""
        if not self._is_found:
            return "nothing was sent"
        left = []
        if self.done is not Risk.NONE:
            yield from self._make_safe(self.done is Risk.FIRES)
            left = yield from self._left()
        if self._target_before is not None and not (yield from self._aim_back()):
            left.append("its target is not set back")
        if left:
            raise failed(f"the device: {'; '.join(left)}")
        return "as it was"

    def _make_safe(self, may_have_fired: bool) -> Trial:
        yield from self.order("key_disarm", lambda one: one.values.get("flight_mode") == 0)
        if may_have_fired or self._open_valves():
            yield from self.order("safe", closed)
            for valve in self._open_valves():
                name = valve.removesuffix("_open")
                yield from self.order(f"close_{name}", partial(closed, valves=(valve,)))
        if may_have_fired and self.last("flight_mode") != 0:
            yield from self.restart()
        return ""

    def _left(self) -> Any:
        """What is not as it must be, in words."""
        if (yield from self.wait_for(TELEM, PAUSE, lambda one: bool(one.values))) is None:
            return ["it may be LEFT ARMED, and its valves open: no telemetry shows it"]
        mode = self.last("flight_mode")
        left = [f"{one} is LEFT OPEN" for one in self._open_valves()]
        if mode == FlightMode.STANDBY:
            left.append("it is LEFT ARMED: flight mode Standby")
        elif mode != FlightMode.STARTUP:
            left.append(f"it is LEFT IN {mode_name(mode)}: restart it")
        return left

    def _aim_back(self) -> Any:
        assert self._target_before is not None
        try:
            token = set_target(self.layout, self._target_before).command.token
        except ParameterError:
            return True  # it had none
        back = partial(self.aims, values=self._target_before)
        return bool((yield from self.repeated(token, back)))

    def _open_valves(self) -> list[str]:
        return [name for name in VALVES if self.last(name)]

    def last(self, name: str) -> Value | None:
        """The newest value of a field; None: there is none."""
        lines = (one for one in reversed(self.heard) if name in one.values)
        return next((one.values[name] for one in lines), None)

    def record(self) -> Any:
        """The next $TELEM line (ReceivedLine) that has its fields."""
        line = yield from self.wait_for(TELEM, PAUSE, lambda one: bool(one.values))
        if line is None:
            raise failed(f"no $TELEM line of {self.layout.count} fields within {PAUSE:g} s")
        return line

    def target(self) -> Any:
        """The target that telemetry shows; a field that is no number is NaN."""
        line = yield from self.record()
        return tuple(line.values.get(name, math.nan) for name in self.layout.target_fields)

    def aims(self, line: ReceivedLine, values: tuple[Value, ...]) -> bool:
        """Whether a $TELEM line shows this target."""
        names = self.layout.target_fields
        return all(
            math.isclose(line.values.get(name, math.nan), value, rel_tol=0.0, abs_tol=_TOLERANCE)
            for name, value in zip(names, values, strict=True)
        )

    def watch_as(self, name: str, seconds: float) -> Trial:
        """Look on for so long, for all clauses that look at what is kept under this name."""
        began = self.now
        yield from self.watch(seconds)
        self.kept[name] = ReceivedLines(self.watched, began, self.now)
        return ""

    def nothing(self, *writes: bytes) -> Trial:
        """Write each of these bytes, which must do nothing."""
        for data in writes:
            before = yield from self.record()
            since = len(self.heard)
            yield from self.write(data)
            yield from self.watch_on(SETTLES)
            self.unchanged(before, since, f"after {text_of(data)}")
        yield from self.record()
        return f"{len(writes)} of them do nothing"

    def unchanged(
        self, before: ReceivedLine, since: int, when: str, besides: Collection[str] = ()
    ) -> None:
        """Nothing that commands move is otherwise from this place of heard on than in a $TELEM
        line, besides these fields; and it did not start anew."""
        names = [one for one in (*MOVED, *self.layout.target_fields) if one not in besides]
        for one in self.heard[since:]:
            for name in names:
                was, now = before.values.get(name), one.values.get(name)
                if None not in (was, now) and str(was) != str(now):
                    raise failed(f"{when} {name} went from {was} to {now}", [one.packet])
            if one.values.get(BOOT, math.inf) < before.values.get(BOOT, -math.inf):
                raise failed(f"{when} it restarted", [one.packet])

    def restart(self) -> Trial:
        """Restart it; the text is empty if it does not begin anew."""
        boot, began = self.last(BOOT), self.now
        yield from self.write(KINDS["reboot"].command.token)
        line = yield from self.started_anew(math.inf if boot is None else boot)
        return "" if line is None else f"{self.now - began:.1f} s"

    def started_anew(self, boot: Value) -> Any:
        """The first $TELEM line (ReceivedLine) whose time since boot, ms, is less than this; None:
        none comes."""
        return (
            yield from self.wait_for(
                TELEM, _RESTARTS_WITHIN, lambda one: one.values.get(BOOT, math.inf) < boot
            )
        )


def text_of(data: bytes) -> str:
    """Bytes as a person reads them, not too many of them."""
    text = repr(data)[2:-1]
    return text if len(text) <= 60 else f"{text[:40]}... ({len(data)} bytes)"


def closed(line: ReceivedLine, valves: Sequence[str] = VALVES) -> bool:
    """Whether a $TELEM line shows these valves closed."""
    return all(line.values.get(valve) == 0 for valve in valves)


def mode_name(mode: Value | None) -> str:
    """A flight mode by its name."""
    if mode is None:
        return "no flight mode"
    known = mode in FlightMode._value2member_map_
    return FlightMode(int(mode)).label if known else f"flight mode {mode}"
