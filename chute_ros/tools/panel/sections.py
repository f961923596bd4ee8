"""The parts of a vehicle's page as HTML, made of its picture. Pure: what is shown comes in."""

from __future__ import annotations

import datetime
import math
import re
from collections.abc import Mapping, Sequence
from html import escape

from chute_ros.model import LinkState, ParachuteState
from chute_ros.plain_text import span_text
from chute_ros.supervisor.inputs import Mode
from chute_ros.tools.chute.diagnostic_tasks import Task
from chute_ros.tools.chute.status_text import (
    LINK_TONE,
    battery_text,
    headline,
    link_text,
    link_tone,
    newest_fired,
    parachute_age_text,
)
from chute_ros.tools.chute.view import (
    DecisionView,
    LinkView,
    ParachuteView,
    RuleView,
    VehiclePicture,
)
from chute_ros.tools.chute.words import age_text, is_old, not_here, value_text
from chute_ros.tools.panel.tones import TONES

#: What a state means to a person, where the supervisor says no more than its name.
MEANINGS = {
    "STARTUP": "The supervisor waits for the first word of its links.",
    "BLOCKED": "The vehicle must not take off.",
    "READY": "Nothing forbids the take-off; no parachute says that it is armed.",
    "ARMED": "The parachutes are armed: keep clear of them. Nothing forbids the take-off.",
    "IN_FLIGHT": "The vehicle flies, and is guarded.",
    "KILLING": "The motors are being stopped.",
    "DEPLOYING": "The parachute is being released.",
    "DEPLOYED": "A parachute was released.",
    "LANDED": "The vehicle has landed.",
    "FAULT": "What was ordered could not be done.",
}
#: What released a parachute, as itself says -> in words.
_BY = {
    "MANUAL": "hand (MANUAL)",
    "ATS": "its own sensors (ATS)",
    "DRONE": "an order over the vehicle's trigger (DRONE)",
    "MAVLINK": "an order over MAVLink (MAVLINK)",
    "GEOFENCE": "its geofence (GEOFENCE)",
    "FTS_PRECHECKING": "its flight termination system (FTS_PRECHECKING)",
}
_HISTORY = 8
_MODES = {"SHADOW": "it decides, and sends nothing", "INHIBITED": "it does nothing"}
#: Diagnostics come once a second; those that do not are not of now, s.
_DIAGNOSTICS_WITHIN = 5.0
_DIAGNOSTIC_TONE = {"WARN": "warn", "STALE": "quiet", "ERROR": "bad"}


def banner(picture: VehiclePicture) -> str:
    """The state in one large word, and why in a sentence."""
    if is_old(picture.age):
        word = "NOT KNOWN NOW"
        why = f"It was {picture.state}; the last word came {span_text(picture.age)} ago."
        tone = "quiet"
    else:
        line = headline(picture)
        word, tone, why = line.text.replace("_", " "), line.tone, _why(picture)
    mode = ""
    if picture.mode != Mode.ACTIVE.name:
        meant = _MODES.get(picture.mode, "what it does is not known")
        mode = f'<div class="mode">{_sign("bad")} {escape(picture.mode)}: {escape(meant)}</div>'
    alarms = "".join(f"<li>{escape(one)}</li>" for one in picture.other_alarms)
    return (
        f'<div class="banner tone-{tone}">'
        f'<div class="word">{_sign(tone)} {escape(word)}</div><div class="why">{escape(why)}</div>'
        f"{mode}</div>" + (f'<ul class="alarms">{alarms}</ul>' if alarms else "")
    )


def nothing(namespace: str, around: str, seconds: float) -> str:
    """The banner before the first word."""
    why = (
        f"No supervisor is received in {namespace} for {span_text(seconds)}. Looked for in: "
        f"{around}."
    )
    return (
        f'<div class="banner tone-quiet"><div class="word">{_sign("quiet")} NOTHING '
        f'RECEIVED YET</div><div class="why">{escape(why)}</div></div>'
    )


def blocks(picture: VehiclePicture) -> str:
    """Why it must not take off, each reason on a line; what of it cannot be used, in flight."""
    reasons = [*picture.block_reasons]
    reasons += [f"blocked by device {one}" for one in picture.device_blocks]
    rows = [_row("flight", "BLOCKED" if picture.flight_blocked else "not blocked", "")]
    rows += [_row("", one, "warn") for one in reasons]
    if picture.state == "IN_FLIGHT":
        rows += [_row("cannot be used", one, "warn") for one in picture.unusable]
        if picture.never_given:
            rows.append(_row("not measured", ", ".join(picture.never_given), ""))
    rows.append(_row("newest decision", picture.newest_decision or "none yet", ""))
    rows.append(_row("supervisor", f"{picture.supervisor}, {age_text(picture.age)}", ""))
    return _card("Flight", "".join(rows), is_old(picture.age))


def parachutes(
    picture: VehiclePicture,
    identities: Mapping[str, str],
    today: datetime.date,
) -> str:
    """A card each. identities: by link and device, as their devices tell."""
    if not picture.parachutes:
        return _card("Parachutes", _row("", not_here(picture.listened), "warn"), True)
    return "".join(_parachute(one, identities, today) for one in picture.parachutes)


def links(those: Sequence[LinkView], old: bool) -> str:
    """State and age of each. old: the supervisor that judges them is silent."""
    rows = "".join(_link(one, old) for one in those) or _row("", "none required", "")
    return _card("Links", rows, old)


def vehicle(picture: VehiclePicture) -> str:
    """Its measurements, each with its age."""
    one = picture.vehicle
    if one is None:
        return _card("Vehicle", _row("", not_here(picture.listened), "warn"), True)
    attitude = ", ".join(
        f"{name} {value_text(math.degrees(angle), '°', 0)}"
        for name, angle in (("roll", one.roll), ("pitch", one.pitch), ("yaw", one.yaw))
    )
    rows = "".join(
        _measured(name, value, age)
        for name, value, age in (
            ("height", value_text(one.height, "m"), one.height_age),
            ("vertical speed", value_text(one.vertical_speed, "m/s"), one.vertical_speed_age),
            ("tilt", value_text(math.degrees(one.tilt), "°", 0), one.attitude_age),
            ("attitude", attitude, one.attitude_age),
            ("arming state", one.armed, one.armed_age),
            ("landed state", one.landed_state, one.landed_state_age),
            ("battery", battery_text(one), one.battery_age),
        )
    )
    rows += "".join(_row("fault", fault, "bad") for fault in one.faults)
    source = one.source or "no known source"
    return _card(f"Vehicle {source}, link {one.link_state}", rows, False)


def rules(those: Sequence[RuleView], old: bool) -> str:
    """A bar for each that is active, which fills as its conditions hold; those that count
    first. old: the supervisor is silent."""
    shown = [one for one in those if one.active or one.counts]
    rows = "".join(_rule(one) for one in sorted(shown, key=lambda one: not one.counts))
    others = [one for one in those if one not in shown]
    if waiting := [one.name for one in others if not one.never]:
        rows += _row("not active now", ", ".join(waiting), "quiet")
    rows += "".join(_row(one.name, one.never, "quiet") for one in others if one.never)
    return _card("Rules", rows or _row("", "none", ""), old)


def decisions(those: Sequence[DecisionView]) -> str:
    """What was decided, the newest first: kills and deploys also before somebody looked."""
    rows = []
    newest = list(reversed(those))
    # However often flight was blocked since.
    fired = [one for one in newest_fired(those) if one not in newest[:_HISTORY]]
    for one in [*newest[:_HISTORY], *reversed(fired)]:
        told = [*one.reasons, *(f"→ {outcome}" for outcome in one.outcomes)]
        lines = "".join(f"<li>{escape(line)}</li>" for line in told)
        rows.append(f'<div class="decision"><b>{escape(one.headline)}</b><ul>{lines}</ul></div>')
    return _card("Decisions", "".join(rows) or _row("", "no kill, no deploy", ""), False)


def diagnostics(tasks: Sequence[Task]) -> str:
    """What is not OK, worst first; how many are."""
    old = [one for one in tasks if one.age > _DIAGNOSTICS_WITHIN]
    now = [one for one in tasks if one not in old]
    bad = [one for one in now if one.level != "OK"]
    rows = "".join(
        _row(f"{one.level} {one.node}: {one.task}", one.message, _DIAGNOSTIC_TONE[one.level])
        for one in bad
    )
    rows += "".join(
        _row(f"{one.node}: {one.task}", f"not received now; {age_text(one.age)}", "quiet")
        for one in old
    )
    rows += _row("", f"{len(now) - len(bad)} of {len(tasks)} OK", "")
    return _card("Diagnostics", rows, False)


def _why(picture: VehiclePicture) -> str:
    if picture.why:
        return picture.why
    if picture.state in ("STARTUP", "BLOCKED") and picture.block_reasons:
        return picture.block_reasons[0]
    return MEANINGS.get(picture.state, "")


def _parachute(one: ParachuteView, identities: Mapping[str, str], today: datetime.date) -> str:
    rows = [
        _row("armed", _armed(one), "live" if one.armed else ""),
        _row("released", _released(one), "act" if one.deployed else ""),
        _row("state", f"{one.state}, link {one.link_state}", _state_tone(one)),
        _row("packed", _packed(one.packed_date, today), ""),
        _row("own supply", value_text(one.backup_voltage, "V"), ""),
    ]
    if one.height == one.height:
        rows.append(_row("own height", value_text(one.height, "m"), ""))
    identity = identities.get(f"{one.link} {one.device}", "not reported")
    rows.append(_row("identity", identity, ""))
    rows += [_row("fault", fault, "bad") for fault in one.faults]
    rows.append(_row("last word", parachute_age_text(one), "quiet" if is_old(one.age) else ""))
    return _card(f"Parachute {one.link} {one.device}", "".join(rows), is_old(one.age))


def _state_tone(one: ParachuteView) -> str:
    """An armed parachute looks armed wherever that stands."""
    if one.link_state == LinkState.OK.name and one.state == ParachuteState.ARMED.name:
        return "live"
    return LINK_TONE.get(one.link_state, "")


def _armed(one: ParachuteView) -> str:
    if one.unmonitored:
        return "not known: it tells nothing, and can always fire"
    if not one.armed:
        return "no"
    return f"YES: {', '.join(one.armed_triggers)}" if one.armed_triggers else "YES"


def _released(one: ParachuteView) -> str:
    if one.unmonitored:
        return "not known: it tells nothing"
    if not one.deployed:
        return "no"
    return f"YES, by {_BY[one.released_by]}" if one.released_by in _BY else "YES"


def _packed(date: str, today: datetime.date) -> str:
    if not date:
        return "not reported"
    try:
        days = (today - datetime.date.fromisoformat(date)).days
    except ValueError:
        return date
    if days < 0:
        return f"{date}, in {-days} days: one of the two clocks is wrong"
    return f"{date}, {days} days ago"


def _link(one: LinkView, old: bool) -> str:
    return _row(one.name, link_text(one), "quiet" if old else link_tone(one))


def _measured(name: str, value: str, age: float) -> str:
    # A value that was never received is none.
    told = escape(age_text(age))
    if age == age:
        told = f"{escape(value)} <small>{told}</small>"
    old = " old" if is_old(age) else ""
    return f'<div class="row{old}"><span>{escape(name)}</span><span>{told}</span></div>'


def _rule(one: RuleView) -> str:
    filled = 0.0 if not one.hold else min(1.0, one.level / one.hold)
    if one.fulfilled or one.acted_on:
        filled = 1.0
    lines = "".join(f"<li>{escape(line)}</li>" for line in one.conditions if one.counts)
    if one.denied:
        lines += f"<li>not acted on: {escape(one.denied)}</li>"
    percent = f"{filled * 100.0:.0f}"
    return (
        f'<div class="rule"><div class="row"><span>{broken(one.name)}</span>'
        f"<span>{escape(one.does)}</span></div>"
        f'<div class="bar" role="progressbar" aria-label="{escape(one.name)}" aria-valuemin="0" '
        f'aria-valuemax="100" aria-valuenow="{percent}"><i style="width:{percent}%"></i></div>'
        f"<ul>{lines}</ul></div>"
    )


def _row(name: str, text: str, tone: str) -> str:
    sign = f"{_sign(tone)} " if tone else ""
    told = f"<span>{broken(name)}</span><span>{sign}{broken(text)}</span>"
    return f'<div class="row{f" is-{tone}" if tone else ""}">{told}</div>'


def _card(title: str, rows: str, old: bool) -> str:
    return f'<section class="card{" old" if old else ""}"><h2>{broken(title)}</h2>{rows}</section>'


def broken(name: str) -> str:
    """A name as HTML, that on a narrow screen goes on in the next line after a _ or a /."""
    return re.sub("([_/])", r"\1<wbr>", escape(name))


def _sign(tone: str) -> str:
    return f'<span class="sign" aria-hidden="true">{TONES[tone].sign}</span>' if tone else ""
