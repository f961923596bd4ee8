"""The verdict on logs as one HTML page that needs nothing else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from chute_ros.supervisor.machine import Stage
from chute_ros.tools.judge_log.findings import LogVerdict, Rating, Unknown, blocked, height_at
from chute_ros.tools.judge_log.flight_log import LogError
from chute_ros.tools.judge_log.log_flight import JudgedLog
from chute_ros.tools.judge_log.sweep import Tried
from chute_ros.tools.report_parts import cell, document, listing, number, section, table, words
from chute_ros.tools.state_rows import state_rows
from chute_ros.tools.timeline import close_up, draw, escaped
from chute_ros.tools.timeline_rows import ACTION_TONES, Curve, Mark, Marks, Row, Window

#: What of the vehicle is drawn: attribute of its state, label, unit, factor.
_CURVES = (
    ("height", "height", "m", 1.0),
    ("vertical_speed", "vertical speed", "m/s", 1.0),
    ("tilt", "tilt", "deg", 57.29577951308232),
    ("acceleration", "acceleration", "m/s^2", 1.0),
)
_LIMITS = (
    '<p class="dim">What the supervisor would have decided, had it flown along. What was recorded '
    "is no answer to its decisions: after the first release, or kill in flight, a log is judged "
    "no further.</p>\n"
)
#: So many of the points of a long flight are drawn.
_MOST_POINTS = 4000


def page(
    flights: Sequence[tuple[LogVerdict, str]], unread: Sequence[tuple[Path, LogError]]
) -> str:
    """The whole page. flights: each with its flight_section."""
    title = f"{len(flights)} recorded flights, judged"
    verdicts = [verdict for verdict, _ in flights]
    parts = [
        f"<h1>{escaped(title)}</h1>\n{_LIMITS}",
        section("Flights", _overview(verdicts, unread)),
        *(text for _, text in flights),
    ]
    return document(title, parts)


def _overview(verdicts: Sequence[LogVerdict], unread: Sequence[tuple[Path, LogError]]) -> str:
    rows: list[tuple[str, ...]] = []
    for place, one in enumerate(verdicts):
        tone = "act" if one.ended else "good" if one.flew else "quiet"
        rows.append(
            (
                cell(f'<a href="#flight{place}">{escaped(one.path.name)}</a>'),
                cell(escaped(one.format)),
                cell(escaped(one.profile)),
                number(f"{one.duration:.0f}"),
                number(f"{one.flew:.0f}"),
                words(f'<b class="{tone}">{escaped(one.words)}</b>'),
                cell(escaped(one.nearest)),
            )
        )
    for path, error in unread:
        said = words(f'<b class="bad">{escaped(error)}</b>')
        rows.append((cell(escaped(path.name)), *[cell("")] * 4, said, cell("")))
    heads = ("file", "format", "profile", "log, s", "in flight, s", "decided", "nearest rule")
    return table(heads, rows)


def flight_section(place: int, verdict: LogVerdict, one: JudgedLog, tried: Sequence[Tried]) -> str:
    """What is told of one flight; place: its number on the page, from 0."""
    inner = [
        f'<p>{escaped(one.log.path)}</p><p class="dim">{escaped(_about(one))}</p>',
        "".join(f'<p><b class="warn">{escaped(text)}</b></p>' for text in one.log.remarks),
        f'<div class="wide">{_timeline(one)}</div>',
        "<h3>Decisions</h3>",
        _decisions(one),
        "<h3>How near each rule came</h3>",
        _ratings(verdict.ratings),
        "<h3>What was not known</h3>",
        _unknown(one, verdict.unknown),
    ]
    if reasons := blocked(one):
        inner += ["<h3>Flight was blocked as it took off</h3>", listing(reasons)]
    if tried:
        inner += ["<h3>Thresholds that would have kept it clean</h3>", _tried(tried)]
    heading = f'<span id="flight{place}">{escaped(one.log.path.name)}</span>'
    title = f"<h2>{heading}: {escaped(verdict.words)}</h2>"
    return f"<section>\n{title}\n{''.join(inner)}\n</section>\n"


def _about(one: JudgedLog) -> str:
    begins = ", begins in flight" if one.begins_in_flight else ""
    judged = "" if one.ended >= one.log.duration - 0.1 else f", judged to {one.ended:.1f} s"
    return (
        f"{one.log.format}, MAV_TYPE {one.log.vehicle_type}, profile {one.config.profile.name}, "
        f"{one.log.duration:.1f} s{begins}{judged}"
    )


def _timeline(one: JudgedLog) -> str:
    marks = [
        Mark(at, str(count), f"{d.action.name}: {d.rule}", ACTION_TONES[d.action])
        for count, (at, d) in enumerate(one.decided, 1)
    ]
    step = max(1, len(one.vehicle) // _MOST_POINTS)
    curves = [
        Curve(label, unit, [(at, factor * getattr(v, name)) for at, v in one.vehicle[::step]])
        for name, label, unit, factor in _CURVES
    ]
    rows: list[Row] = [
        *state_rows(one.pictures),
        Marks("decisions", marks),
        *(c for c in curves if any(value == value for _, value in c.points)),
    ]
    begin = one.pictures[0][0] if one.pictures else 0.0
    windows = [Window("the log", begin, one.ended)]
    windows += close_up([at for at, _ in one.fired], one.ended)
    return draw(rows, windows, f"{one.log.path.name}, as the supervisor saw it")


def _decisions(one: JudgedLog) -> str:
    return table(
        ("no.", "time, s", "height, m", "decision", "rule", "reasons"),
        (
            (
                number(str(count)),
                number(f"{at:.2f}"),
                number(_height(one, at)),
                cell(f'<b class="{ACTION_TONES[d.action]}">{d.action.name}</b>'),
                cell(escaped(d.rule)),
                words(listing(d.reasons)),
            )
            for count, (at, d) in enumerate(one.decided, 1)
        ),
    )


def _height(one: JudgedLog, at: float) -> str:
    height = height_at(one, at)
    return f"{height:.1f}" if math.isfinite(height) else ""


def _ratings(ratings: Sequence[Rating]) -> str:
    heads = ("rule", "action", "highest counter, s", "of, s", "at, s", "blind, %")
    return table(
        (*heads, "nearest values", "conditions at the highest counter"),
        (
            (
                cell(escaped(r.told.name)),
                cell(escaped(r.told.action)),
                number(f"{r.told.peak:.2f}"),
                number(f"{r.told.hold:.2f}"),
                number(f"{r.told.peak_at:.1f}" if r.told.peak else ""),
                number(f"{100.0 * r.blind:.0f}"),
                words(listing(r.nearest)),
                words(listing(r.told.conditions) if r.told.peak else ""),
            )
            for r in ratings
        ),
    )


def _unknown(one: JudgedLog, unknown: Sequence[Unknown]) -> str:
    flew = any(p.state == Stage.IN_FLIGHT for _, p in one.pictures)
    never = "" if flew else '<p class="dim">it was never in flight: in the whole log</p>\n'
    return never + table(
        ("measurement", f"share of the {'flight' if flew else 'log'}, %", "reason, the newest"),
        (
            (cell(escaped(u.name)), number(f"{100.0 * u.share:.0f}"), words(escaped(u.why)))
            for u in unknown
        ),
    )


def _tried(tried: Sequence[Tried]) -> str:
    return table(
        ("rule", "threshold", "shipped", "further out"),
        (
            (
                cell(escaped(t.rule)),
                cell(escaped(t.what)),
                number(f"{t.shipped:g}"),
                words(escaped(t.words)),
            )
            for t in tried
        ),
    )
