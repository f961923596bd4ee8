"""A flight's report as one HTML page. What came over a wire is escaped on its way in."""

from __future__ import annotations

import math
from collections.abc import Sequence

from chute_ros.supervisor.record import CODEC
from chute_ros.tools.flight_story import Decided, FlightStory
from chute_ros.tools.recording import Recording, utc
from chute_ros.tools.release_orders import Release
from chute_ros.tools.report_parts import cell, document, listing, number, section, table, words
from chute_ros.tools.report_release import answer_of, calls_of, parachutes_of, release_of
from chute_ros.tools.state_rows import RuleTold
from chute_ros.tools.timeline import escaped
from chute_ros.tools.timeline_rows import OUTCOME_TONES


def page(
    title: str,
    recording: Recording,
    story: FlightStory,
    released: Sequence[Release],
    rules: Sequence[RuleTold],
    timeline: str,
) -> str:
    """The whole page. timeline: an <svg>."""
    parts = [
        _head(title, recording, story),
        section("Release", release_of(released, story)),
        section("Timeline", f'<div class="wide">{timeline}</div>'),
        section("Decisions", _decisions(story.decisions)),
        section("Requests and their answers", _requests(story)),
        section("Requests to device nodes", calls_of(story)),
        section("Parachutes", parachutes_of(story)),
        section("Alarms", _alarms(story)),
        section("Rules and their counters", _rules(rules)),
        section("Log of the supervisor", _log(story)),
        section("Settings", _settings(recording)),
    ]
    return document(title, parts)


def _head(title: str, recording: Recording, story: FlightStory) -> str:
    span = recording.seconds(recording.turns[-1].wall)
    vehicle = recording.namespace or "no namespace"
    about = (
        f"vehicle {vehicle}, from {utc(recording.start)} UTC, {span:.1f} s, "
        f"{len(recording.turns)} turns of the core"
    )
    counts = (
        f"{len(story.decisions)} decisions, {len(story.requests)} requests, "
        f"{len(story.calls)} calls of device nodes, {len(story.alarms)} alarms"
    )
    remarks = "".join(f'<p><b class="warn">{escaped(one)}</b></p>' for one in recording.remarks)
    return (
        f"<h1>{escaped(title)}</h1>\n"
        f'<p class="dim">{escaped(about)}</p>\n<p>{counts}</p>\n{remarks}\n'
    )


def _decisions(decisions: Sequence[Decided]) -> str:
    return table(
        ("no.", "time, s", "decision", "rule", "reasons", "to", "outcome"),
        (
            (
                number(str(count)),
                number(f"{one.at:.3f}"),
                cell(f'<b class="{one.tone}">{escaped(one.name)}</b>{_besides(one)}'),
                cell(escaped(one.decision.rule)),
                words(listing(one.decision.reasons)),
                cell(escaped(", ".join(one.decision.targets) or "nobody")),
                words(_outcomes(one)),
            )
            for count, one in enumerate(decisions, 1)
        ),
    )


def _besides(one: Decided) -> str:
    text = one.decision.named
    if one.decision.shadow:
        text += ", SHADOW: not sent"
    return f'<br><span class="dim">{escaped(text)}</span>'


def _outcomes(one: Decided) -> str:
    lines = [
        f"{escaped(report.link)} "
        f'<b class="{OUTCOME_TONES[report.outcome]}">{escaped(report.outcome.name)}</b> '
        f"after {after:.3f} s"
        + (f': <span class="dim">{escaped(report.detail)}</span>' if report.detail else "")
        for after, report in one.reports
    ]
    if one.again:
        lines.append(f'<span class="dim">resent {one.again} times</span>')
    return "<br>".join(lines) or '<span class="dim">no report</span>'


def _requests(story: FlightStory) -> str:
    return table(
        ("time, s", "request", "details", "answer"),
        (
            (
                number(f"{one.at:.3f}"),
                cell(escaped(one.what)),
                words(escaped(one.details)),
                words(answer_of(one)),
            )
            for one in story.requests
        ),
    )


def _alarms(story: FlightStory) -> str:
    return table(
        ("time, s", "alarm"),
        (
            (number(f"{at:.3f}"), words(f'<b class="bad">{escaped(text)}</b>'))
            for at, text in story.alarms
        ),
    )


def _rules(rules: Sequence[RuleTold]) -> str:
    heads = ("rule", "action", "highest counter, s", "of, s", "at, s", "fulfilled at, s")
    return table(
        (*heads, "acted on at, s", "conditions at the highest counter"),
        (
            (
                cell(escaped(one.name)),
                cell(escaped(one.action)),
                number(f"{one.peak:.2f}"),
                number(f"{one.hold:.2f}"),
                number(_moment(one.peak_at)),
                number(_moment(one.fulfilled_at)),
                number(_moment(one.latched_at)),
                words(_rule(one)),
            )
            for one in rules
        ),
    )


def _rule(rule: RuleTold) -> str:
    if not rule.alive:
        return '<span class="dim">never active in a state of this flight</span>'
    denied = f'<b class="warn">not acted on: {escaped(rule.denied)}</b>' if rule.denied else ""
    return listing(rule.conditions) + denied


def _log(story: FlightStory) -> str:
    lines = table(
        ("time, s", "line"),
        ((number(f"{at:.3f}"), words(escaped(say.text))) for at, say in story.said),
    )
    return f"<details><summary>{len(story.said)} lines</summary>{lines}</details>"


def _settings(recording: Recording) -> str:
    texts = dict.fromkeys(
        CODEC.to_json(one.config, whole=True) for one in recording.turns if one.config is not None
    )
    inner = "".join(f"<p><code>{escaped(text)}</code></p>" for text in texts)
    return f"<details><summary>as recorded</summary>{inner}</details>"


def _moment(at: float) -> str:
    return "never" if math.isnan(at) else f"{at:.3f}"
