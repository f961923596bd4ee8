"""The card of a deployment that was tried, as one HTML page to be printed and signed."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence

from chute_ros.ros.middleware_diagnostics import TASK, VERSION
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.record import CODEC
from chute_ros.tools.descent import MeasuredDescent, descent
from chute_ros.tools.flight_story import FlightStory
from chute_ros.tools.recording import Recording, utc
from chute_ros.tools.release_orders import Release
from chute_ros.tools.report_parts import cell, document, number, section, table, words
from chute_ros.tools.report_release import parachutes_of, release_of
from chute_ros.tools.timeline import escaped

DIAGNOSTICS = "diagnostics"
_NOTE = """<p>Made from a black box. What the vehicle and its devices reported is not measured
independently. This card is no certificate.</p>"""
#: What no black box knows, by heading.
_BY_HAND = {
    "Test": (
        "number and purpose",
        "place, date, local time",
        "pilot, crew, observers",
        "how the release was ordered, and why",
    ),
    "Vehicle": (
        "model, serial number, registration",
        "mass at take-off, kg",
        "centre of gravity, payload",
        "autopilot, its firmware and its file of parameters",
    ),
    "Parachute": (
        "maker, model, serial number",
        "canopy, lines, their number of deployments",
        "packed by whom and when (compare with what the device reports)",
        "charge or spring, its lot, expiry",
        "firmware of the controller and of the trigger",
    ),
    "Weather": ("wind at the ground and aloft, m/s", "temperature, pressure, rain"),
    "Seen from outside": (
        "motors stood when the canopy opened (yes, no, by which video)",
        "time from the order to the first cloth, and to a full canopy, s (frames of a video)",
        "height at the failure and at a full canopy, m, measured by what",
        "sink under the canopy, m/s, measured by what",
        "drift from the point of release, m",
        "lines: twisted, tangled, torn",
    ),
    "Landing": (
        "attitude and impact, damage to the vehicle",
        "batteries: smoke, fire, loose",
        "parachute disarmed and made safe by whom, when",
    ),
    "Result": (
        "passed or failed, by which criterion",
        "what differed from the plan",
        "names and signatures",
    ),
}


def card(
    recording: Recording,
    story: FlightStory,
    released: Sequence[Release],
    hashes: Sequence[tuple[str, str]],
) -> str:
    """The whole page. hashes: (name, SHA-256) of each file."""
    kept = (one.config for one in recording.turns if one.config is not None)
    configs = {CODEC.to_json(config, whole=True): config for config in kept}
    files = ((cell(escaped(name)), words(f"<code>{digest}</code>")) for name, digest in hashes)
    vehicle = recording.namespace or "no namespace"
    title = f"Test card: {vehicle}, {utc(recording.start)} UTC"
    remarks = "".join(f'<p><b class="warn">{escaped(one)}</b></p>' for one in recording.remarks)
    parts = [
        f"<h1>{escaped(title)}</h1>\n{_NOTE}\n{remarks}",
        section("Files", table(("file", "SHA-256"), files)),
        section(
            "Configuration",
            "".join(map(_configuration, configs.values(), configs)) or "<p>not recorded</p>",
        ),
        section("Versions", _versions(recording)),
        section("Releases", release_of(released, story)),
        section("Descent", _descents(story, released)),
        section("Parachutes at the end", parachutes_of(story)),
        *(section(f"By hand: {name}", _lines(lines)) for name, lines in _BY_HAND.items()),
    ]
    return document(title, parts)


def _configuration(config: SupervisorConfig, text: str) -> str:
    digest = hashlib.sha256(text.encode()).hexdigest()
    ladder = ", ".join(map(str, config.ladder)) or "none"
    return (
        f"<p>profile {escaped(config.profile.name)}; ladder {escaped(ladder)}; SHA-256 of all "
        f"settings <code>{digest}</code></p>\n"
        f"<details><summary>all settings</summary><code>{escaped(text)}</code></details>"
    )


def _versions(recording: Recording) -> str:
    """Of each node, as its diagnostics said last."""
    told: dict[str, dict[str, str]] = {}
    for _, array in recording.messages.get(DIAGNOSTICS, ()):
        for status in array.status:
            node, _, task = status.name.rpartition(": ")
            if task == TASK:
                told[node] = {one.key: one.value for one in status.values}
    return table(
        ("node", "chute_ros", "Fast DDS"),
        (
            (
                cell(escaped(node)),
                cell(escaped(values.get(VERSION, "not known"))),
                cell(escaped(values.get("Fast DDS", "none"))),
            )
            for node, values in sorted(told.items())
        ),
    )


def _descents(story: FlightStory, released: Sequence[Release]) -> str:
    heads = ("released at, s", "fastest sink, m/s", "sink in the end, m/s", "carried after, s")
    return table(
        (*heads, "height lost until then, m", "landed after, s"),
        (
            (
                number(f"{one.at:.3f}"),
                *map(number, map(_measured, _of(descent(story.vehicle, one.at)))),
            )
            for one in released
        ),
    )


def _of(found: MeasuredDescent) -> tuple[float, ...]:
    return found.fastest, found.rate, found.carried_after, found.lost, found.took


def _measured(value: float) -> str:
    return "not known" if math.isnan(value) else f"{value:.1f}"


def _lines(lines: Sequence[str]) -> str:
    blank = '<td class="blank"></td>'
    return table(("what", "by hand"), ((cell(escaped(one)), blank) for one in lines))
