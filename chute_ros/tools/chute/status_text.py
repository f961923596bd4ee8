"""A vehicle's picture as lines of text, each with a tone for a screen that has colours."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from chute_ros.model import FIRES, LinkState
from chute_ros.plain_text import span_text
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.machine import ON_GROUND
from chute_ros.supervisor.state_text import UNGUARDED
from chute_ros.tools.chute.view import (
    DecisionView,
    LinkView,
    ParachuteView,
    RuleView,
    VehiclePicture,
    VehicleView,
)
from chute_ros.tools.chute.words import age_text, is_old, not_here, value_text
from chute_ros.tools.timeline_rows import ACTION_TONES, LINK_TONES, STAGE_TONES

#: Name of a state of the vehicle, or of a link -> its tone (timeline_rows.py).
STAGE_TONE = {stage.name: tone for stage, tone in STAGE_TONES.items()}
LINK_TONE = {state.name: tone for state, tone in LINK_TONES.items()}
_OF_ACTION = {action.name: tone for action, tone in ACTION_TONES.items()}
#: Columns of the name at the beginning of a line; and of one of two values in one.
_NAME, _HALF = 19, 40
_ON_GROUND = tuple(stage.name for stage in ON_GROUND)
#: Decisions that stop motors or release a parachute.
_FIRES = tuple(action.name for action in FIRES)


@dataclass(frozen=True)
class StatusLine:
    """One line. tone: as in timeline_rows.py; "head" for a headline; rows: of a terminal that it
    may take."""

    text: str
    tone: str = "plain"
    rows: int = 3


def headline(picture: VehiclePicture) -> StatusLine:
    """The state first; what is old is not shown as the state."""
    if is_old(picture.age):
        text = f"NOT KNOWN NOW (was {picture.state}, last word {span_text(picture.age)} ago)"
        return StatusLine(text, "quiet")
    armed = any(one.armed and not is_old(one.age) for one in picture.parachutes)
    warns = bool(picture.alarms) or picture.mode != Mode.ACTIVE.name
    tone = state_tone(picture.state, picture.unguarded, warns, armed)
    return StatusLine(state_words(picture.state, picture.unguarded), tone)


def state_words(state: str, unguarded: bool) -> str:
    """What is shown in large."""
    return f"{state}, {UNGUARDED}" if unguarded else state


def state_tone(state: str, unguarded: bool, warns: bool, armed: bool) -> str:
    """No state is shown as if all were well while something warns, nor as if nothing could fire
    while a parachute is armed beside people. warns: an alarm, or a mode that sends nothing; armed:
    any parachute is."""
    tone = STAGE_TONE.get(state, "quiet")
    if unguarded:
        return "bad"
    if armed and state in _ON_GROUND:
        return "live"
    return "warn" if warns and tone in ("good", "plain", "quiet") else tone


def status_lines(picture: VehiclePicture) -> list[StatusLine]:
    """Everything but the decisions: for `chute status`, with the state first."""
    return [
        headline(picture),
        *_about(picture),
        *why_lines(picture),
        *_reasons(picture),
        *_unusable(picture),
        StatusLine("links", "head"),
        *(_link(one) for one in picture.links),
        *([] if picture.links else [StatusLine("  none required")]),
        StatusLine("parachutes", "head"),
        *(line for one in picture.parachutes for line in _parachute(one)),
        *([] if picture.parachutes else [_no_parachute(picture)]),
        *_vehicle(picture),
        *_fired(picture),
        *rule_lines(picture.rules),
        _newest(picture),
    ]


def watch_lines(picture: VehiclePicture) -> list[StatusLine]:
    """The same for a screen of 24 rows, on which what matters most must find its place: each
    thing in as few rows as it needs, what may be long below all others."""
    on_ground = picture.state in ("STARTUP", "BLOCKED")
    flight = "BLOCKED" if picture.flight_blocked else "not blocked"
    about = f"{picture.namespace}, {picture.supervisor}, {age_text(picture.age)}; "
    about += f"mode {picture.mode}; flight {flight}"
    reasons = [*_reasons(picture)]
    return [
        StatusLine(f"  {about}", "plain" if picture.mode == Mode.ACTIVE.name else "bad", rows=2),
        *why_lines(picture),
        *(reasons if on_ground else []),
        *(_in_short(one) for one in newest_fired(picture.decisions)),
        *(replace(_link(one), rows=1) for one in picture.links),
        *(replace(line, rows=1) for one in picture.parachutes for line in _parachute(one)),
        *([] if picture.parachutes else [_no_parachute(picture, "parachutes: ")]),
        *_vehicle_in_short(picture),
        *_unusable_in_short(picture),
        *rule_lines(picture.rules),
        *([] if on_ground else reasons),
        *decision_lines(picture.decisions, "decisions"),
    ]


def _no_parachute(picture: VehiclePicture, what: str = "") -> StatusLine:
    return StatusLine(f"  {what}{not_here(picture.listened)}", "warn")


def newest_fired(decisions: Sequence[DecisionView]) -> list[DecisionView]:
    """The newest kill and the newest deploy, as far as they are known, the newest last."""
    newest = {one.action: one for one in decisions if one.action in _FIRES}
    return [one for one in decisions if newest.get(one.action) is one]


def _fired(picture: VehiclePicture) -> list[StatusLine]:
    title = "newest kill and deploy"
    if picture.not_received:
        text = f"{title}: number {picture.not_received} was not received here yet; ask again"
        return [StatusLine(text, "warn")]
    fired = newest_fired(picture.decisions)
    return decision_lines(fired, title) if fired else []


def decision_lines(decisions: Sequence[DecisionView], title: str) -> list[StatusLine]:
    """The newest first."""
    lines = [StatusLine(title, "head")]
    for one in reversed(decisions):
        lines.append(StatusLine(f"  {one.headline}", _OF_ACTION.get(one.action, "plain")))
        lines += [StatusLine(f"      {reason}") for reason in one.reasons]
        lines += [StatusLine(f"      -> {outcome}") for outcome in one.outcomes]
    return lines if decisions else [*lines, StatusLine("  none")]


def order_lines(namespace: str, picture: VehiclePicture | None, does: str) -> list[str]:
    """What a person should see before a parachute is released or motors are stopped."""
    if picture is None:
        return [f"{namespace}: NOT KNOWN, no supervisor is received", f"this {does}"]
    lines = [f"{namespace}: {headline(picture).text}"]
    if picture.why:
        lines.append(_named("why", picture.why))
    lines += [line.text for line in _vehicle(picture)]
    lines += [line.text for one in picture.parachutes for line in _parachute(one)]
    return [*lines, f"this {does}"]


def _in_short(one: DecisionView) -> StatusLine:
    told = [*one.reasons, *(f"-> {outcome}" for outcome in one.outcomes)]
    text = f"  {one.headline}: {'; '.join(told)}"
    return StatusLine(text, _OF_ACTION.get(one.action, "plain"), rows=2)


def _about(picture: VehiclePicture) -> Iterator[StatusLine]:
    vehicle = f"{picture.namespace}, supervisor {picture.supervisor}, {age_text(picture.age)}"
    yield StatusLine(_named("vehicle", vehicle), "quiet" if is_old(picture.age) else "plain")
    yield StatusLine(
        _named("mode", picture.mode), "plain" if picture.mode == Mode.ACTIVE.name else "bad"
    )


def why_lines(picture: VehiclePicture) -> Iterator[StatusLine]:
    """Why it is in this state, and every alarm that this does not tell."""
    listed = picture.flight_blocked and picture.why == "; ".join(picture.block_reasons)
    if picture.why and not listed:
        yield StatusLine(_named("why", picture.why), headline(picture).tone)
    for alarm in picture.other_alarms:
        yield StatusLine(_named("ALARM", alarm), "bad")


def _reasons(picture: VehiclePicture) -> Iterator[StatusLine]:
    flight = "BLOCKED" if picture.flight_blocked else "not blocked"
    yield StatusLine(_named("flight", flight), "warn" if picture.flight_blocked else "plain")
    for reason in picture.block_reasons:
        yield StatusLine(_named("", reason), "warn")
    for device in picture.device_blocks:
        yield StatusLine(_named("", f"blocked by device {device}"), "warn")


def _unusable(picture: VehiclePicture) -> Iterator[StatusLine]:
    if picture.state == "IN_FLIGHT":
        # On the ground a measurement that does not move is none, and that is no news.
        for one in picture.unusable:
            yield StatusLine(_named("cannot be used", one), "warn")
        if picture.never_given:
            yield StatusLine(_named("not measured", ", ".join(picture.never_given)), "plain")


def link_text(one: LinkView) -> str:
    """Its state and its two ages: the node may live while its device is silent."""
    parts = [one.state]
    if not one.device_healthy:
        parts.append("device NOT healthy")
    elif one.state == LinkState.OK.name and not is_old(one.age):
        parts.append("device healthy")
    if one.device_age is not None:
        parts.append(f"device {age_text(one.device_age)}")
    text = ", ".join([*parts, f"node {age_text(one.age)}"])
    return f"{text}: {'; '.join(one.reasons)}" if one.reasons else text


def parachute_age_text(one: ParachuteView) -> str:
    """Of an output that says nothing it is known only when it was written."""
    written = "written " if one.unmonitored else ""
    return f"{written}{age_text(one.age)}"


def _unusable_in_short(picture: VehiclePicture) -> list[StatusLine]:
    names = [one.partition(":")[0] for one in picture.unusable]
    if picture.state != "IN_FLIGHT" or not names:
        return []
    return [StatusLine(_named("cannot be used", ", ".join(names)), "warn", rows=1)]


def link_tone(one: LinkView) -> str:
    """A link is no better than its device."""
    tone = LINK_TONE.get(one.state, "warn")
    return "warn" if tone == "good" and not one.device_healthy else tone


def _link(one: LinkView) -> StatusLine:
    return StatusLine(_named(one.name, link_text(one)), link_tone(one))


def _parachute(one: ParachuteView) -> Iterator[StatusLine]:
    told = [
        "armed" if one.armed else "disarmed",
        "DEPLOYED" if one.deployed else "not deployed",
    ]
    if one.unmonitored:
        told = ["armed and deployed not known: it tells nothing, and can always fire"]
    parts = [one.state, *told, f"link {one.link_state}"]
    if one.backup_voltage == one.backup_voltage:
        parts.append(f"backup {one.backup_voltage:.1f} V")
    parts.append(parachute_age_text(one))
    tone = "act" if one.deployed else "live" if one.armed else "plain"
    tone = "quiet" if is_old(one.age) else tone
    yield StatusLine(_named(f"{one.link} {one.device}", ", ".join(parts)), tone)
    for fault in one.faults:
        yield StatusLine(_named("", f"fault: {fault}"), "bad")


def battery_text(one: VehicleView) -> str:
    """Its voltage, and what is left of it if that is known."""
    voltage = value_text(one.battery_voltage, "V")
    if math.isnan(one.battery_remaining):
        return voltage
    return f"{voltage}, {one.battery_remaining * 100.0:.0f} %"


def _vehicle(picture: VehiclePicture) -> Iterator[StatusLine]:
    one = picture.vehicle
    if one is None:
        yield StatusLine("vehicle", "head")
        yield StatusLine(f"  {not_here(picture.listened)}", "warn")
        return
    yield StatusLine(
        f"vehicle {one.source or 'of no known source'}, link {one.link_state}", "head"
    )
    for name, value, age in (
        ("arming state", one.armed, one.armed_age),
        ("landed state", one.landed_state, one.landed_state_age),
        ("height", value_text(one.height, "m"), one.height_age),
        ("vertical speed", value_text(one.vertical_speed, "m/s"), one.vertical_speed_age),
        ("battery", battery_text(one), one.battery_age),
    ):
        # A value that was never received is none.
        told = f"{value}, {age_text(age)}" if age == age else age_text(age)
        yield StatusLine(_named(name, told), "quiet" if is_old(age) else "plain")
    for fault in one.faults:
        yield StatusLine(_named("", f"fault: {fault}"), "bad")


def _vehicle_in_short(picture: VehiclePicture) -> list[StatusLine]:
    """Two values in a row, grey if either is old."""
    one = picture.vehicle
    title, *lines = _vehicle(picture)
    if one is None:
        return [title, *lines]
    values, faults = lines[: -len(one.faults) or None], lines[len(lines) - len(one.faults) :]
    pairs = [values[number : number + 2] for number in range(0, len(values), 2)]
    return [title, *map(_side_by_side, pairs), *faults]


def _side_by_side(lines: Sequence[StatusLine]) -> StatusLine:
    old = any(line.tone == "quiet" for line in lines)
    text = "".join(f"{line.text:<{_HALF}}" for line in lines)
    return StatusLine(text.rstrip(), "quiet" if old else "plain")


def rule_lines(rules: Sequence[RuleView]) -> Iterator[StatusLine]:
    """Those that count, with their conditions; the names of the others in one row."""
    active = sum(one.active for one in rules)
    counting = [one for one in rules if one.counts]
    told = f"{len(counting)} counting" if counting else "none counting"
    yield StatusLine(f"rules: {active} of {len(rules)} active, {told}", "head")
    for one in counting:
        tone = "warn" if one.does == "warns" else _OF_ACTION.get(one.action, "plain")
        yield StatusLine(f"  {one.name}: {one.does}", tone)
        yield from (StatusLine(f"      {condition}") for condition in one.conditions)
        if one.denied:
            yield StatusLine(f"      not acted on: {one.denied}", "warn")
    if waiting := [one.name for one in rules if one.active and not one.counts]:
        yield StatusLine(f"  not counting: {', '.join(waiting)}", rows=1)
    yield from (StatusLine(f"  {one.name}: {one.never}", "quiet") for one in rules if one.never)


def _newest(picture: VehiclePicture) -> StatusLine:
    return StatusLine(f"newest decision: {picture.newest_decision or 'none yet'}", "head")


def _named(name: str, text: str) -> str:
    return f"  {name:<{_NAME}}{text}" if len(name) < _NAME else f"  {name}  {text}"
