"""The results of a campaign as a page and a picture."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from xml.sax.saxutils import escape

from chute_ros.campaign.campaign import Line, Tally
from chute_ros.campaign.judge import ENOUGH_TIME, WRONG, Count
from chute_ros.campaign.scenario import MOST_FAULTS

#: Bars of the picture: so many, up to so many s.
_BARS, _SPAN = 60, 3.0
_WIDTH, _HEIGHT, _LEFT, _BOTTOM = 720, 150, 50, 30
#: So many wrong flights are named.
_MOST_NAMED = 50


def page(tally: Tally, seed: int, picture: str) -> str:
    """As Markdown. picture: the name of its file."""
    lines = [
        "# Fault campaign",
        "",
        f"Written by `make campaign FLIGHTS={tally.flights} SEED={seed}`.",
        "",
        "Each flight is a world in virtual time: the real core, the real MAVLink protocol, the",
        "simulated autopilot and parachute, with frames and messages that are lost, doubled,",
        "delayed, corrupted, cables that flap, processes that hang or die, sensors that lie, up",
        f"to {MOST_FAULTS} of them at a time, most of them around the failure. The truth comes",
        "from the flight model: since when only a parachute helps, and until when its release",
        f"still lands the vehicle softly. Flights that left less than {ENOUGH_TIME:g} s for that,",
        "or in which no such time in a row was free of cuts and stops, are named with the cause.",
        "",
        "| counted as | flights |",
        "|---|---|",
    ]
    lines += [f"| {count.value} | {tally.counts[count]} |" for count in Count]
    lines += ["", f"{sum(tally.counts[one] for one in WRONG)} of them must not be."]
    if tally.wrong:
        lines += ["", "| seed | profile | what failed | counted as |", "|---|---|---|---|"]
        for line in tally.wrong[:_MOST_NAMED]:
            what = f"{line.count.name}: {line.why}"
            lines.append(f"| {line.seed} | {line.profile} | {line.failure} | {what} |")
    if tally.reasons:
        lines += ["", "## Not told", "", "| why | flights |", "|---|---|"]
        lines += [f"| {why} | {number} |" for why, number in tally.reasons.most_common()]
    lines += ["", "## From the failure to the release", "", f"![delays]({picture})", ""]
    lines += [
        "| profile | flights | median | 99th percentile | largest | height lost: median | most |",
        "|---|---|---|---|---|---|---|",
    ]
    for profile, some in _by_profile(tally.lines).items():
        delays = sorted(line.release_delay for line in some)
        lost = sorted(line.height_lost for line in some)
        high = delays[math.ceil(0.99 * len(delays)) - 1]
        lines.append(
            f"| {profile} | {len(some)} | {statistics.median(delays):.2f} s | {high:.2f} s | "
            f"{delays[-1]:.2f} s | {statistics.median(lost):.1f} m | {lost[-1]:.1f} m |"
        )
    return "\n".join(lines) + "\n"


def picture(tally: Tally) -> str:
    """How long it took, by profile, as SVG."""
    groups = _by_profile(tally.lines)
    height = len(groups) * _HEIGHT
    size = f'viewBox="0 0 {_WIDTH} {height}" font-family="sans-serif" font-size="12"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size}>',
        f'<rect width="{_WIDTH}" height="{height}" fill="white"/>',
    ]
    for number, (profile, some) in enumerate(groups.items()):
        parts += _bars(profile, some, number * _HEIGHT)
    return "\n".join([*parts, "</svg>"]) + "\n"


def _by_profile(lines: Sequence[Line]) -> dict[str, list[Line]]:
    groups: dict[str, list[Line]] = {}
    for line in sorted(lines, key=lambda one: (one.profile, one.seed)):
        groups.setdefault(line.profile, []).append(line)
    return groups


def _bars(profile: str, lines: Sequence[Line], top: float) -> list[str]:
    counts = [0] * _BARS
    for line in lines:
        counts[min(_BARS - 1, max(0, int(line.release_delay / _SPAN * _BARS)))] += 1
    most, wide = max(counts), (_WIDTH - _LEFT - 20) / _BARS
    floor, room = top + _HEIGHT - _BOTTOM, _HEIGHT - _BOTTOM - 30
    title = f"{escape(profile)}: {len(lines)} releases, s after the failure"
    parts = [f'<text x="{_LEFT}" y="{top + 18}" font-weight="bold">{title}</text>']
    for number, count in enumerate(counts):
        tall = room * count / most
        parts.append(
            f'<rect x="{_LEFT + number * wide:.1f}" y="{floor - tall:.1f}" '
            f'width="{wide - 1:.1f}" height="{tall:.1f}" fill="#27496d"/>'
        )
    for tick in range(int(_SPAN * 2) + 1):
        x = _LEFT + tick / 2 / _SPAN * wide * _BARS
        more = " and more" if tick == int(_SPAN * 2) else ""
        parts.append(
            f'<text x="{x:.1f}" y="{floor + 16}" text-anchor="middle">{tick / 2:g}{more}</text>'
        )
    parts.append(
        f'<line x1="{_LEFT}" y1="{floor}" x2="{_WIDTH - 20}" y2="{floor}" stroke="#333"/>'
    )
    parts.append(f'<text x="{_LEFT - 6}" y="{top + 42}" text-anchor="end">{most}</text>')
    return parts
