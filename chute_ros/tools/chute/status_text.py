"""A vehicle's picture as lines of text, each with a tone for a screen that has colours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from chute_ros.model import LinkState
from chute_ros.plain_text import span_text
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.state_text import UNGUARDED
from chute_ros.tools.chute.view import (
    DecisionView,
    LinkView,
    ParachuteView,
    RuleView,
    VehiclePicture,
    VehicleView,
)
from chute_ros.tools.chute.words import age_text, is_old, value_text
from chute_ros.tools.timeline_rows import ACTION_TONES, LINK_TONES, STAGE_TONES

#: Name of a state of the vehicle, or of a link -> its tone (timeline_rows.py).
STAGE_TONE = {stage.name: tone for stage, tone in STAGE_TONES.items()}
LINK_TONE = {state.name: tone for state, tone in LINK_TONES.items()}
_OF_ACTION = {action.name: tone for action, tone in ACTION_TONES.items()}
#: Columns of the name at the beginning of a line.
_NAME = 19


@dataclass(frozen=True)
class Line:
    """One line. tone: as in timeline_rows.py; "head" for a headline."""

    text: str
    tone: str = "plain"


def headline(picture: VehiclePicture) -> Line:
    """The state first; what is old is not shown as the state."""
    if is_old(picture.age):
        text = f"NOT KNOWN NOW (was {picture.state}, last word {span_text(picture.age)} ago)"
        return Line(text, "quiet")
    tone = state_tone(picture.state, picture.unguarded, bool(picture.alarms))
    return Line(state_words(picture.state, picture.unguarded), tone)


def state_words(state: str, unguarded: bool) -> str:
    """What is shown in large."""
    return f"{state}, {UNGUARDED}" if unguarded else state


def state_tone(state: str, unguarded: bool, alarms: bool) -> str:
    """No state is shown as if all were well while something warns."""
    tone = STAGE_TONE.get(state, "quiet")
    if unguarded:
        return "bad"
    return "warn" if alarms and tone in ("good", "plain", "quiet") else tone


def status_lines(picture: VehiclePicture) -> list[Line]:
    """Everything but the decisions: for `chute status`, with the state first."""
    return [headline(picture), *body_lines(picture), _newest(picture)]


def body_lines(picture: VehiclePicture) -> list[Line]:
    """Why, links, parachutes, vehicle, and the rules that count."""
    return [
        *_why(picture),
        Line("links", "head"),
        *(_link(one) for one in picture.links),
        *([] if picture.links else [Line("  none required")]),
        Line("parachutes", "head"),
        *(line for one in picture.parachutes for line in _parachute(one)),
        *([] if picture.parachutes else [Line("  never received", "warn")]),
        *_vehicle(picture.vehicle),
        *_rules(picture.rules),
    ]


def decision_lines(decisions: Sequence[DecisionView]) -> list[Line]:
    """The newest first."""
    lines = [Line("decisions received here", "head")]
    for one in reversed(decisions):
        shadow = " in SHADOW, not sent" if one.shadow else ""
        text = f"  {one.action}{shadow} by rule '{one.rule}', {span_text(one.age)} ago"
        lines.append(Line(text, _OF_ACTION.get(one.action, "plain")))
        lines += [Line(f"      {reason}") for reason in one.reasons]
        lines += [Line(f"      -> {outcome}") for outcome in one.outcomes]
    return lines if decisions else [*lines, Line("  none")]


def order_lines(namespace: str, picture: VehiclePicture | None, does: str) -> list[str]:
    """What a person should see before a parachute is released or motors are stopped."""
    if picture is None:
        return [f"{namespace}: NOT KNOWN, no supervisor is received", f"this {does}"]
    lines = [f"{namespace}: {headline(picture).text}"]
    if picture.why:
        lines.append(_named("why", picture.why))
    lines += [line.text for line in _vehicle(picture.vehicle)]
    lines += [line.text for one in picture.parachutes for line in _parachute(one)]
    return [*lines, f"this {does}"]


def _why(picture: VehiclePicture) -> Iterator[Line]:
    vehicle = f"{picture.namespace}, supervisor {picture.supervisor}, {age_text(picture.age)}"
    yield Line(_named("vehicle", vehicle), "quiet" if is_old(picture.age) else "plain")
    yield Line(
        _named("mode", picture.mode), "plain" if picture.mode == Mode.ACTIVE.name else "bad"
    )
    listed = picture.flight_blocked and picture.why == "; ".join(picture.block_reasons)
    if picture.why and not listed:
        yield Line(_named("why", picture.why), headline(picture).tone)
    flight = "BLOCKED" if picture.flight_blocked else "not blocked"
    yield Line(_named("flight", flight), "warn" if picture.flight_blocked else "plain")
    for reason in picture.block_reasons:
        yield Line(_named("", reason), "warn")
    for device in picture.device_blocks:
        yield Line(_named("", f"blocked by device {device}"), "warn")
    for alarm in picture.other_alarms:
        yield Line(_named("ALARM", alarm), "bad")
    if picture.state == "IN_FLIGHT":
        # On the ground a measurement that does not move is none, and that is no news.
        for one in picture.unusable:
            yield Line(_named("cannot be used", one), "warn")
        if picture.never_given:
            yield Line(_named("not measured", ", ".join(picture.never_given)), "plain")


def _link(one: LinkView) -> Line:
    healthy = "device healthy" if one.device_healthy else "device NOT healthy"
    text = f"{one.state}, {healthy}, {age_text(one.age)}"
    if one.reasons:
        text += f": {'; '.join(one.reasons)}"
    tone = LINK_TONE.get(one.state, "warn")
    if one.state == LinkState.OK.name and not one.device_healthy:
        tone = "warn"
    return Line(_named(one.name, text), tone)


def _parachute(one: ParachuteView) -> Iterator[Line]:
    parts = [
        one.state,
        "armed" if one.armed else "disarmed",
        "DEPLOYED" if one.deployed else "not deployed",
        f"link {one.link_state}",
    ]
    if one.backup_voltage == one.backup_voltage:
        parts.append(f"backup {one.backup_voltage:.1f} V")
    parts.append(age_text(one.age))
    tone = "act" if one.deployed else "live" if one.armed else "plain"
    tone = "quiet" if is_old(one.age) else tone
    yield Line(_named(f"{one.link} {one.device}", ", ".join(parts)), tone)
    for fault in one.faults:
        yield Line(_named("", f"fault: {fault}"), "bad")


def _vehicle(one: VehicleView | None) -> Iterator[Line]:
    if one is None:
        yield Line("vehicle", "head")
        yield Line("  never received", "warn")
        return
    yield Line(f"vehicle {one.source or 'of no known source'}, link {one.link_state}", "head")
    battery = value_text(one.battery_voltage, "V")
    if one.battery_remaining == one.battery_remaining:
        battery += f", {one.battery_remaining * 100.0:.0f} %"
    for name, value, age in (
        ("motors", one.armed, one.armed_age),
        ("landed state", one.landed_state, one.landed_state_age),
        ("height", value_text(one.height, "m"), one.height_age),
        ("vertical speed", value_text(one.vertical_speed, "m/s"), one.vertical_speed_age),
        ("battery", battery, one.battery_age),
    ):
        # A value that was never received is none.
        told = f"{value}, {age_text(age)}" if age == age else age_text(age)
        yield Line(_named(name, told), "quiet" if is_old(age) else "plain")
    for fault in one.faults:
        yield Line(_named("", f"fault: {fault}"), "bad")


def _rules(rules: Sequence[RuleView]) -> Iterator[Line]:
    active = sum(one.active for one in rules)
    counting = [one for one in rules if one.counts]
    told = f"{len(counting)} counting" if counting else "none counting"
    yield Line(f"rules: {active} of {len(rules)} active, {told}", "head")
    for one in counting:
        tone = "warn" if one.does == "warns" else _OF_ACTION.get(one.action, "plain")
        yield Line(f"  {one.name}: {one.does}", tone)
        yield from (Line(f"      {condition}") for condition in one.conditions)
        if one.denied:
            yield Line(f"      not acted on: {one.denied}", "warn")
    if waiting := [one.name for one in rules if one.active and not one.counts]:
        yield Line(f"  not counting: {', '.join(waiting)}")


def _newest(picture: VehiclePicture) -> Line:
    return Line(f"newest decision: {picture.newest_decision or 'none yet'}", "head")


def _named(name: str, text: str) -> str:
    return f"  {name:<{_NAME}}{text}" if len(name) < _NAME else f"  {name}  {text}"
