"""The sections of a report about the parachutes: their releases, what was asked of their nodes,
and what they reported last."""

from __future__ import annotations

import math
from collections.abc import Sequence

from chute_ros.model import ParachuteStatus
from chute_ros.tools.flight_story import Asked, FlightStory
from chute_ros.tools.release_orders import Fate, MotionThen, Release, trigger_of
from chute_ros.tools.report_parts import cell, listing, number, table, words
from chute_ros.tools.timeline import escaped

#: A measurement that is older (s) is not that of the moment.
_FRESH = 2.0
_NO_CALLS = "Requests to device nodes are not in this recording: it has no topic safety/person."


def release_of(released: Sequence[Release], story: FlightStory) -> str:
    """What was released and what was not, in short; then each with all that is known of it."""
    calls = "" if story.has_calls else f'<p><b class="warn">{_NO_CALLS}</b></p>'
    if not released:
        asked = ", no call of a device node that orders one" if story.has_calls else ""
        return (
            "<p>Nothing was released: no decision to deploy, no request to deploy"
            f"{asked}, and no parachute that turned to deployed.</p>{calls}"
        )
    by_fate = {fate: [one for one in released if one.fate is fate] for fate in Fate}
    told = "".join(
        f"<p><b>{fate.value}:</b> {escaped(_in_short(those) or 'nothing')}</p>"
        for fate, those in by_fate.items()
        if those or fate is Fate.RELEASED
    )
    tables = "".join(
        f"<h3>{fate.value}</h3>{_orders(those)}" for fate, those in by_fate.items() if those
    )
    return told + calls + tables


def _in_short(those: Sequence[Release]) -> str:
    return ", ".join(f"{one.parachute} ({one.at:.3f} s)" for one in those)


def _orders(those: Sequence[Release]) -> str:
    heads = (
        "time, s",
        "parachute",
        "by whose order",
        "height, vertical speed",
        "what was reported",
    )
    return table(
        (*heads, "what did not come"),
        (
            (
                number(f"{one.at:.3f}"),
                cell(escaped(one.parachute)),
                words(escaped(one.order) + listing(one.reasons)),
                f'<td class="motion">{_motion(one.motion)}</td>',
                words(_steps(one)),
                words(_missing(one)),
            )
            for one in those
        ),
    )


def answer_of(asked: Asked) -> str:
    """The answer to a request."""
    if asked.answer is None:
        return '<span class="dim">no answer</span>'
    after, finish = asked.answer
    tone, word = ("good", "success") if finish.success else ("bad", "no success")
    accepted = ", accepted" if finish.accepted else ""
    told = f'<b class="{tone}">{word}</b>{accepted} after {after:.3f} s: '
    return told + escaped(finish.message)


def calls_of(story: FlightStory) -> str:
    """What was asked of device nodes by their services."""
    if not story.has_calls:
        return f'<p class="dim">{_NO_CALLS}</p>'
    return table(
        ("time, s", "node", "service", "request", "answer"),
        (
            (
                number(f"{one.at:.3f}"),
                cell(escaped(one.link)),
                cell(escaped(one.what)),
                words(escaped(one.details)),
                words(answer_of(one)),
            )
            for one in story.calls
        ),
    )


def parachutes_of(story: FlightStory) -> str:
    """The newest status of each parachute."""
    heads = ("parachute", "reported at, s", "link", "state", "armed", "deployed")
    return table(
        (*heads, "supply, V", "faults"),
        (
            (
                cell(escaped(f"{one.link} {one.status.device}")),
                number(f"{at:.3f}"),
                cell(one.status.link_state.name),
                cell(one.status.state.name),
                cell("armed" if one.status.armed else "no, or not known"),
                cell(_deployed(one.status)),
                number(_volts(one.status.backup_voltage)),
                words(listing(one.status.faults) or "none"),
            )
            for at, one in story.parachutes
        ),
    )


def _deployed(status: ParachuteStatus) -> str:
    if not status.deployed:
        return "no, or not known"
    return f'<b class="act">deployed</b>, {trigger_of(status)}'


def _motion(motion: MotionThen) -> str:
    height = _measured("height", motion.height, motion.height_age, "m")
    speed = _measured("speed", motion.vertical_speed, motion.vertical_speed_age, "m/s")
    return f"{height}<br>{speed}"


def _measured(name: str, value: float, age: float, unit: str) -> str:
    if math.isnan(value) or math.isnan(age):
        return f"{name} not known"
    if age > _FRESH:
        return f"{name} not known<br>({value:.1f} {unit} {age:.1f} s before)"
    return f"{round(value, 1) + 0.0:.1f} {unit}"  # no -0.0


def _steps(release: Release) -> str:
    lines = []
    for step in release.steps:
        detail = f': <span class="dim">{escaped(step.detail)}</span>' if step.detail else ""
        lines.append(
            f'{escaped(step.who)} <b class="{step.tone}">{escaped(step.what)}</b> '
            f"after {step.after:.3f} s{detail}"
        )
    return "<br>".join(lines) or '<span class="dim">nothing</span>'


def _missing(release: Release) -> str:
    lines = (f'<b class="bad">{escaped(one)}</b>' for one in release.missing)
    return "<br>".join(lines) or '<span class="dim">nothing</span>'


def _volts(value: float) -> str:
    return "not known" if math.isnan(value) else f"{value:.1f}"
