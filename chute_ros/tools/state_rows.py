"""Rows of a timeline from the supervisor's own picture, as it was published on safety/state."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from chute_ros.model import Action, LinkState
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.timeline_rows import (
    ACTION_TONES,
    LINK_TONES,
    STAGE_TONES,
    Band,
    Level,
    Row,
    Segment,
)

#: Each with its time, s from the start.
States = list[tuple[float, Any]]
#: A picture that is older (s) says nothing any more: it comes each second at least.
_LASTS = 2.5


@dataclass
class RuleTold:
    """What was seen of a rule over the flight. Times in s from the start, NaN: never."""

    name: str
    action: str
    conditions: tuple[str, ...]
    hold: float
    peak: float = 0.0
    peak_at: float = math.nan
    fulfilled_at: float = math.nan
    latched_at: float = math.nan
    #: It lived in a state that the vehicle was in.
    alive: bool = False
    #: Why it was fulfilled and not acted on, the newest; empty: it was not, or was acted on.
    denied: str = ""


def state_rows(states: States) -> list[Row]:
    """Stage, mode, flight block, every link, and the counter of every rule that moved."""
    if not states:
        return []
    rows: list[Row] = [
        Band(
            "state", _segments((at, *_named(Stage, one.state, STAGE_TONES)) for at, one in states)
        ),
    ]
    if any(one.mode for _, one in states):
        rows.append(Band("mode", _segments((at, *_mode(one.mode)) for at, one in states)))
    rows.append(Band("flight", _segments((at, *_block(one)) for at, one in states)))
    links = dict.fromkeys(link for _, one in states for link in one.links)
    rows += [Band(link, _segments(_link(states, link))) for link in links]
    for rule in rules_of(states):
        shares = _shares(states, rule.name)
        if any(share > 0.0 for _, share in shares):  # the others are in the table only
            rows.append(Level(f"rule {rule.name}", shares))
    return rows


def rules_of(states: States) -> list[RuleTold]:
    """Every rule that was told of; none where the recording's messages do not have them."""
    found: dict[str, RuleTold] = {}
    for at, state in states:
        for rule in getattr(state, "rules", ()):
            told = found.get(rule.name)
            if told is None:
                action, _ = _named(Action, rule.action, ACTION_TONES)
                told = RuleTold(rule.name, action, tuple(rule.conditions), rule.hold)
                found[rule.name] = told
            told.alive = told.alive or rule.alive
            told.denied = rule.denied or told.denied
            if rule.level > told.peak:
                told.peak, told.peak_at = rule.level, at
                told.conditions = tuple(rule.conditions) or told.conditions
            if rule.fulfilled and math.isnan(told.fulfilled_at):
                told.fulfilled_at, told.conditions = at, tuple(rule.conditions)
            if rule.latched and math.isnan(told.latched_at):
                told.latched_at = at
    return list(found.values())


def _shares(states: States, name: str) -> list[tuple[float, float]]:
    """The counter of a rule as a share of what fulfils it."""
    shares = []
    for at, state in states:
        for rule in getattr(state, "rules", ()):
            if rule.name == name:
                full = 1.0 if rule.fulfilled else 0.0
                shares.append((at, rule.level / rule.hold if rule.hold > 0.0 else full))
    return shares


def _segments(told: Iterable[tuple[float, str, str]]) -> list[Segment]:
    """From (s, text, tone) of one picture after the other."""
    segments: list[Segment] = []
    last = -math.inf
    for at, text, tone in told:
        if segments:
            newest = segments[-1]
            end = min(at, last + _LASTS)
            segments[-1] = Segment(newest.start, end, newest.text, newest.tone)
            if end == at and newest.text == text:
                last = at
                continue
        segments.append(Segment(at, at, text, tone))
        last = at
    return segments


def _link(states: States, link: str) -> Iterable[tuple[float, str, str]]:
    for at, state in states:
        if link not in state.links:
            continue
        index = list(state.links).index(link)
        number, healthy = state.link_states[index], state.devices_healthy[index]
        if number == LinkState.OK and not healthy:
            yield at, "OK, DEVICE NOT HEALTHY", "warn"
        else:
            yield at, *_named(LinkState, number, LINK_TONES)


def _mode(number: int) -> tuple[str, str]:
    return _named(Mode, number, {})[0], "plain" if number == Mode.ACTIVE else "warn"


def _block(state: Any) -> tuple[str, str]:
    return ("BLOCKED", "warn") if state.flight_blocked else ("free", "good")


def _named(kind: Any, number: int, tones: Mapping[Any, str]) -> tuple[str, str]:
    """Its name and its tone; a number of another version than ours has neither."""
    if number not in {int(one) for one in kind}:
        return f"number {number}", "quiet"
    return kind(number).name, tones.get(kind(number), "quiet")
