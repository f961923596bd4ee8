"""Kind of one line of the umbilical: telemetry, a log line, progress, a snapshot, or unknown.

When the flight computer's queue overflows, the rest of a line is lost and the next one follows on
its heels: what is known is looked for at the end of a line, and what stands before it is a cut
line. Source: Umbilical Reference, section 3; the texts as the firmware sends them.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from chute_ros.links.umbilical.protocol.fields import may_be_record
from chute_ros.links.umbilical.protocol.stream import CUT_LINE
from chute_ros.protocol.events import Severity

UNKNOWN_LINE = "unknown line"


class Telemetry(NamedTuple):
    """A $TELEM line: its fields as text, not looked at yet."""

    body: str


@dataclass(frozen=True)
class LogLine:
    """A line of the flight computer's own log, which it sends in debug mode."""

    severity: Severity
    text: str


@dataclass(frozen=True)
class FlashUsage:
    """The answer to flash information, KB of 1024 bytes."""

    used: int
    total: int


@dataclass(frozen=True)
class WipeBegan:
    """The flash is being wiped; there is no telemetry meanwhile."""


@dataclass(frozen=True)
class WipeProgress:
    """So many sectors of so many are wiped."""

    done: int
    total: int


@dataclass(frozen=True)
class WipeEnded:
    """The wipe is over."""

    success: bool
    text: str


@dataclass(frozen=True)
class ArmingBlocked:
    """The flight computer does not arm, and says why."""

    text: str


@dataclass(frozen=True)
class MemoryText:
    """A snapshot or another line about the FRAM."""

    text: str


@dataclass(frozen=True)
class StrayMark:
    """The mark of a dump that is over or never began."""


Saying = (
    Telemetry
    | LogLine
    | FlashUsage
    | WipeBegan
    | WipeProgress
    | WipeEnded
    | ArmingBlocked
    | MemoryText
    | StrayMark
)

#: What a long work or an answer depends on.
_VITAL = (FlashUsage, WipeBegan, WipeProgress, WipeEnded, ArmingBlocked)
_LEVELS = {
    "ERROR": Severity.ERROR,
    "WARN": Severity.WARNING,
    "INFO": Severity.INFO,
    "DEBUG": Severity.INFO,
    "TRACE": Severity.INFO,
}
_LOG = re.compile(r"\[(ERROR|WARN|INFO|DEBUG|TRACE)\] (.*)$")
#: How a line that is known begins, and what it is. What fits first counts.
_KNOWN: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], Saying]], ...] = (
    (_LOG, lambda m: LogLine(_LEVELS[m[1]], m[2])),
    (re.compile(r"(?:SNAP seq=|Snapshot: |(?<! )FRAM).*$"), lambda m: MemoryText(m[0])),
    (
        re.compile(r"Flash: ([0-9]{1,9})/([0-9]{1,9}) KB used \([0-9.]+%\)$"),
        lambda m: FlashUsage(int(m[1]), int(m[2])),
    ),
    (re.compile(r"Wiping QSPI Flash\.\.\. Please wait\.$"), lambda m: WipeBegan()),
    (
        re.compile(r"Wipe progress: ([0-9]{1,9})/([0-9]{1,9}) sectors$"),
        lambda m: WipeProgress(int(m[1]), int(m[2])),
    ),
    (re.compile(r"Flash wiped successfully\.$"), lambda m: WipeEnded(True, m[0])),
    (re.compile(r"ERASE (?:FAILED|TIMEOUT)!$"), lambda m: WipeEnded(False, m[0])),
    (re.compile(r"Arming blocked: .*$"), lambda m: ArmingBlocked(m[0])),
    (re.compile(r"--- (?:BEGIN|END) FLASH (?:CSV|BINARY) DUMP ---$"), lambda m: StrayMark()),
)
_TELEM = b"$TELEM,"


def recognise(line: bytes) -> tuple[Saying | None, str]:
    """What a line says (None: nothing known), and the reason to count a part under, or empty."""
    start = line.rfind(_TELEM)
    if start < 0:
        return _known(_text(line))
    body = line[start + len(_TELEM) :]
    cut = CUT_LINE if start else ""
    if may_be_record(body):
        return Telemetry(body.decode()), cut
    # A cut record with another line on its heels is that line.
    said = _known(_text(body))[0]
    if said is not None:
        return said, CUT_LINE
    text = _text(line)
    if _LOG.match(text):
        return _known(text)  # it only speaks of telemetry
    return Telemetry(_text(body)), cut


def _text(line: bytes) -> str:
    return line.decode("utf-8", errors="replace")


def _known(text: str) -> tuple[Saying | None, str]:
    found = [
        (match.start(), number, make(match))
        for number, (pattern, make) in enumerate(_KNOWN)
        if (match := pattern.search(text))
    ]
    if not found:
        return None, UNKNOWN_LINE if text else ""
    # On the heels of a cut log line, what matters must not pass for its text; an echo of it in the
    # log follows the level directly.
    vital = [one for one in found if isinstance(one[2], _VITAL)]
    on_heels = [one for one in vital if not text[: one[0]].endswith("] ")]
    start, _, said = min(on_heels or found, key=lambda one: one[:2])
    return _printable(said), CUT_LINE if start else ""


def _printable(said: Saying) -> Saying:
    """Without control characters: it goes to a person's terminal."""
    if isinstance(said, LogLine):
        return LogLine(said.severity, printable(said.text))
    if isinstance(said, (ArmingBlocked, MemoryText)):
        return type(said)(printable(said.text))
    return said


def printable(text: str) -> str:
    """text with a mark in place of each character that is none to be seen."""
    return "".join(one if one.isprintable() else "\N{REPLACEMENT CHARACTER}" for one in text)
