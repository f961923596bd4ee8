"""A flight's report as one HTML page that needs nothing else: no script, no font, no picture.

Everything that came over a wire is escaped on its way in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from chute_ros.supervisor.record import CODEC
from chute_ros.tools.flight_story import Decided, FlightStory
from chute_ros.tools.recording import Recording, utc
from chute_ros.tools.release_orders import Release
from chute_ros.tools.report_parts import answer_of, cell, listing, number, section, table, words
from chute_ros.tools.report_release import calls_of, parachutes_of, release_of
from chute_ros.tools.state_rows import RuleTold
from chute_ros.tools.timeline import escaped
from chute_ros.tools.timeline_rows import OUTCOME_TONES
from chute_ros.tools.timeline_rows import STYLE as TIMELINE_STYLE

_STYLE = """
:root { color-scheme: light dark; --page:#f4f6f8; --card:#ffffff; --text:#1c2733; --dim:#5b6b7b;
  --edge:#dfe5ea; --good:#2f9e5b; --warn:#b97d0c; --bad:#cc3d3d; --quiet:#7c8a97;
  --plain:#2f74c0; --act:#8a4fc4; }
@media (prefers-color-scheme: dark) { :root { --page:#0b1015; --card:#11181f; --text:#e6edf3;
  --dim:#9fb0c0; --edge:#2b3742; --good:#46bd77; --warn:#dda03a; --bad:#f06a6a; --quiet:#8795a3;
  --plain:#5b9ee8; --act:#b184f0; } }
@media print { :root { --page:#fff; --card:#fff; --text:#000; --dim:#444; --edge:#ccc; }
  section { break-inside: avoid-page; } tr { break-inside: avoid; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--text);
  font: 14px/1.45 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 20px 16px 40px; }
h1 { font-size: 22px; margin: 4px 0 2px; } h2 { font-size: 16px; margin: 0 0 10px; }
p { margin: 4px 0; } .dim { color: var(--dim); }
section { background: var(--card); border: 1px solid var(--edge); border-radius: 8px;
  padding: 14px 16px; margin: 14px 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: 5px 10px 5px 0;
  border-bottom: 1px solid var(--edge); overflow-wrap: break-word; }
td.words { overflow-wrap: anywhere; min-width: 14em; }
th { color: var(--dim); font-weight: 600; font-size: 12px; }
td.number { font-variant-numeric: tabular-nums; white-space: nowrap; text-align: right; }
td.motion { white-space: nowrap; }
td.blank { width: 60%; height: 2.4em; }
td ul { margin: 0; padding-left: 16px; }
b.good { color: var(--good); } b.warn { color: var(--warn); } b.bad { color: var(--bad); }
b.quiet { color: var(--quiet); } b.plain { color: var(--plain); } b.act { color: var(--act); }
code { font: 12px/1.4 ui-monospace, "DejaVu Sans Mono", monospace; overflow-wrap: anywhere; }
summary { cursor: pointer; }
"""


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


def document(title: str, parts: Sequence[str]) -> str:
    """A whole page with these parts, which needs nothing else. title: plain."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escaped(title)}</title>\n<style>{_STYLE}{TIMELINE_STYLE}</style>\n</head>\n"
        f"<body>\n<main>\n{''.join(parts)}</main>\n</body>\n</html>\n"
    )


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
