"""All vehicles on one page, the worst first, each by its safety/summary."""

from __future__ import annotations

import math
from collections.abc import Iterable
from html import escape
from typing import Any
from urllib.parse import quote

from chute_ros.model import name_of
from chute_ros.supervisor.inputs import Mode
from chute_ros.tools.chute.hearing import ReceivedMessage, stamp_seconds
from chute_ros.tools.chute.status_text import state_tone, state_words
from chute_ros.tools.chute.view import is_unguarded, reason_in
from chute_ros.tools.chute.words import age_text, is_old
from chute_ros.tools.panel.tones import TONES

#: The states, the one first that a person must see first.
_WORST_FIRST = (
    "FAULT", "KILLING", "DEPLOYING", "DEPLOYED", "BLOCKED", "STARTUP", "IN_FLIGHT", "ARMED",
    "LANDED", "READY",
)  # fmt: skip
#: One that is silent, or has an alarm: after those in which something happens.
_UNSURE = _WORST_FIRST.index("DEPLOYED") + 0.5


#: Flies, and nobody would be saved: only what has failed already comes before.
_UNGUARDED = _WORST_FIRST.index("FAULT") + 0.5


def age_of(heard: ReceivedMessage | None, now: float) -> float:
    """Since a vehicle's supervisor said its summary, s; NaN: it never did. now: monotonic s."""
    if heard is None:
        return math.nan
    # The first one is latched, and may be hours old.
    latched = max(0.0, heard.wall - stamp_seconds(heard.message)) if heard.number == 1 else 0.0
    return now - heard.received + latched


def fleet(those: Iterable[tuple[str, ReceivedMessage | None]], now: float) -> str:
    """those: namespace and newest chute_msgs/SafetySummary of each vehicle. now: monotonic s."""
    told = [(name, heard.message if heard else None, age_of(heard, now)) for name, heard in those]
    told.sort(key=lambda one: (_rank(one[1], one[2]), one[0]))
    cards = "".join(_card(*one) for one in told)
    return (
        f'<div class="fleet">{cards}</div>' if cards else '<p class="none">No vehicle found.</p>'
    )


def link_to(namespace: str) -> str:
    """The address of a vehicle's page."""
    return f"/vehicle{quote(namespace)}"


def _rank(summary: Any, age: float) -> float:
    if summary is None or is_old(age):
        return _UNSURE
    if is_unguarded(summary.text):
        return _UNGUARDED
    names = _WORST_FIRST
    rank = names.index(summary.state_name) if summary.state_name in names else 0
    return min(float(rank), _UNSURE) if summary.alarms else float(rank)


def _card(namespace: str, summary: Any, age: float) -> str:
    old = is_old(age)
    if summary is None:
        word, tone, lines = "NOTHING RECEIVED", "quiet", list[str]()
    else:
        state, unguarded = summary.state_name, is_unguarded(summary.text)
        words = state_words(state, unguarded).replace("_", " ")
        word = "NOT KNOWN NOW" if old else words
        warns = bool(summary.alarms) or summary.mode != Mode.ACTIVE
        tone = "quiet" if old else state_tone(state, unguarded, warns, bool(summary.armed))
        lines = list(_lines(summary, age))
    told = "".join(f"<div>{escape(line)}</div>" for line in lines)
    return (
        f'<a class="card vehicle{" old" if old else ""}" href="{link_to(namespace)}">'
        f"<h2>{escape(namespace)}</h2>"
        f'<div class="banner tone-{tone}"><span class="sign" aria-hidden="true">'
        f"{TONES[tone].sign}</span> {escape(word)}</div>{told}</a>"
    )


def _lines(summary: Any, age: float) -> Iterable[str]:
    if is_old(age):
        yield f"it was {summary.state_name}"
    if why := reason_in(summary.text, summary.state_name):
        yield why
    if (mode := name_of(Mode, summary.mode)) != Mode.ACTIVE.name:
        yield f"mode {mode}"
    if summary.alarms:
        yield f"alarms: {summary.alarms}"
    yield f"links OK: {summary.links_ok} of {summary.links}"
    for name, those in (("armed", summary.armed), ("released", summary.released)):
        if those:
            yield f"{name}: {', '.join(those)}"
    yield f"last word: {age_text(age)}"
