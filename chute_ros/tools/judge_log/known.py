"""A table of logs whose flights are known, as a page: what happened, what was decided, and whether
that is right."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from chute_ros.errors import ChuteError
from chute_ros.plain_text import plain
from chute_ros.tools.judge_log.findings import LogVerdict
from chute_ros.tools.judge_log.flight_log import LogError
from chute_ros.tools.pages import table
from chute_ros.transport.regular_file import read_regular_text

#: What a flight asks for: nothing that ends it; the motors stopped or the parachute released from
#: a moment on, at the latest at another; either, but nothing before that moment.
FLIES, ENDS, EITHER = "flies", "ends", "either"
_ABOUT = """Flights of others, from public repositories, judged as they were recorded by
[judge_log](../guide/judge_log.md): what the shipped profiles would have decided. What happened is
told from the logs themselves and by who published them. An end is right from the moment on at
which the vehicle was out of control. Below 10 m a parachute does not help: there the motors are
stopped alone.
"""
_FIELDS = ("file", "source", "real", "what_happened", "right", "from", "until")


@dataclass(frozen=True)
class Known:
    """One log. real: flown, not simulated; begin and end: s of the log, of what must end it."""

    file: str
    source: str
    real: bool
    what_happened: str
    right: str
    begin: float = 0.0
    end: float = 0.0


def known_of(path: Path) -> dict[str, Known]:
    """File name -> what is known of it. path: tab-separated, its first line the names of
    _FIELDS. ChuteError, in words: it is none."""
    try:
        text = io.StringIO(read_regular_text(path), newline="")
        rows = list(csv.DictReader(text, delimiter="\t"))
        if not rows or set(rows[0]) != set(_FIELDS):
            raise ChuteError(f"{path}: need the columns {', '.join(_FIELDS)}, parted by tabs")
        found = [_known(row) for row in rows]
    except OSError as error:
        raise ChuteError(f"{path}: {error.strerror or error}") from None
    except (ValueError, TypeError, UnicodeDecodeError) as error:
        raise ChuteError(f"{path}: {error}") from None
    return {one.file: one for one in found}


def require_all(files: Sequence[Path], known: Mapping[str, Known]) -> None:
    """ChuteError: of one of them nothing is known."""
    missing = [path.name for path in files if path.name not in known]
    if missing:
        raise ChuteError(f"--known has no line for {', '.join(missing)}")


def _known(row: dict[str, str]) -> Known:
    if row["right"] not in (FLIES, ENDS, EITHER):
        needed = f"need {FLIES}, {ENDS} or {EITHER}"
        raise ValueError(f"{row['file']}: right is {row['right']!r}: {needed}")
    times = [float(row[name] or 0.0) for name in ("from", "until")]
    real = row["real"] == "yes"
    return Known(row["file"], row["source"], real, row["what_happened"], row["right"], *times)


def mistake(known: Known, verdict: LogVerdict) -> str:
    """What was decided wrongly, in words; empty: nothing."""
    at = verdict.first
    if known.right == FLIES and verdict.ended:
        return f"ended at {at:.1f} s, and nothing asked for it"
    if known.right == ENDS and not verdict.ended:
        return "not ended"
    if at < known.begin:
        return f"ended at {at:.1f} s, before anything failed ({known.begin:g} s)"
    if known.right == ENDS and at > known.end:
        return f"ended at {at:.1f} s, later than {known.end:g} s"
    return ""


def page(
    verdicts: Sequence[LogVerdict],
    unread: Sequence[tuple[Path, LogError]],
    known: dict[str, Known],
) -> str:
    """The page. known: of each log that was read, at least."""
    rows = [(known[one.path.name], one) for one in verdicts]
    wrong = sum(bool(mistake(what, one)) for what, one in rows)
    real = sum(what.real for what, _ in rows)
    ended = sum(one.ended for _, one in rows)
    hours = sum(one.flew for _, one in rows) / 3600.0
    lines = [
        "# Recorded flights",
        "",
        _ABOUT,
        (
            f"{len(rows)} logs, {real} of them of real vehicles, {hours:.1f} hours in flight; "
            f"{ended} were ended, {wrong} wrongly. What cannot be read is listed below the table."
        ),
        "",
        table(
            ("log", "what happened", "in flight, s", "decided", "as it should be"),
            [_row(what, one) for what, one in rows],
        ),
    ]
    if unread:
        lines += ["", "## Not read", ""]
        lines += [f"- {_cell(path.name)}: {_cell(_why(path, error))}" for path, error in unread]
    sources = [what for what, _ in rows]
    sources += [known[path.name] for path, _ in unread if path.name in known]
    lines += ["", "## Sources", ""]
    lines += [f"- {_cell(what.file)}: {_cell(what.source)}" for what in sources]
    return "\n".join(lines) + "\n"


def _row(known: Known, one: LogVerdict) -> Sequence[str]:
    height = one.release_height
    where = "" if math.isnan(height) else f", released at {height:.0f} m"
    simulated = "" if known.real else " (simulated)"
    return (
        _cell(known.file),
        _cell(known.what_happened + simulated),
        f"{one.flew:.0f}",
        _cell(one.words + where),
        _cell(mistake(known, one) or "yes"),
    )


def _why(path: Path, error: LogError) -> str:
    return str(error).removeprefix(f"{path}: ")


def _cell(text: str) -> str:
    return plain(text).replace("|", "/").replace("<", "&lt;")
