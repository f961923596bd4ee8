"""The heights and times that the failures of described vehicles need, as a page and a table."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from chute_ros.campaign.confidence import CONFIDENCE, flights_needed
from chute_ros.campaign.described import DescribedVehicle, Range
from chute_ros.campaign.description import NUMBERS
from chute_ros.campaign.heights import WANTED, Campaign, CaseFlights
from chute_ros.campaign.needed_height import CEILING, Fall
from chute_ros.supervisor.rules import BelowMinimum, Profile
from chute_ros.tools.heights_words import ASSUMPTIONS, HOW, INTRODUCTION, WITH_FAULTS
from chute_ros.tools.pages import summary, table


@dataclass(frozen=True)
class VehicleHeights:
    """One vehicle. file: its description; picture: name of the file."""

    file: Path
    campaign: Campaign
    every: Sequence[CaseFlights]
    profile: Profile
    picture: str

    @property
    def plain(self) -> list[CaseFlights]:
        """Those without faults."""
        return [one for one in self.every if not one.case.faults]


def page(results: Sequence[VehicleHeights], command: str, how: str) -> str:
    """As Markdown. command: that wrote it; how: what its time depends on, in words."""
    lines = [
        *("# Minimum height and time of a deploy", ""),
        *(f"Written by `{command}`: {how}.", "", INTRODUCTION, ""),
    ]
    for one in results:
        lines += _vehicle(one)
    lines += ["## How it was found", "", HOW, "", "## Assumptions", "", ASSUMPTIONS]
    return "\n".join(lines) + "\n"


def _vehicle(result: VehicleHeights) -> list[str]:
    vehicle = result.campaign.vehicle
    lines = [
        *(f"## {vehicle.name}", "", _in_short(result), "", f"![heights]({result.picture})", ""),
        *("### Height that is needed", "", _HEIGHTS, "", heights(result.plain), ""),
        *(_minimum(result), "", "### Time from the failure", "", _TIMES, ""),
        *(times(result.plain), ""),
    ]
    faults = result.campaign.faults
    if faults:
        lines += [f"### With up to {faults} faults", "", WITH_FAULTS.format(faults), ""]
        lines += [heights([one for one in result.every if one.case.faults]), ""]
    fails = {one.case.name: one.case.about for one in result.plain}
    lines += ["### What fails", "", *(f"- {name}: {what}." for name, what in fails.items()), ""]
    return [*lines, "### The description as read", "", _description(result), ""]


_HEIGHTS = """\
Median and bound: height above the ground at the failure. Noticed, chain, opening: the height that
is lost until the supervisor decides to stop the motors, from there to the release (kill, its
confirmation, order, the parachute's answer), and from there until the open canopy carries: medians
of the flights from the least height."""
_TIMES = """\
Median and 99th percentile of the flights from a usual height whose canopy carried. Noticed, chain,
opening: as above."""


def _in_short(result: VehicleHeights) -> str:
    saved = [one for one in result.plain if math.isfinite(one.bound)]
    lost = [one for one in result.plain if not math.isfinite(one.bound)]
    words = []
    if lost:
        told = (
            f"{_name(one)} ({sum(map(math.isinf, one.needed))} of {len(one.needed)} were not "
            f"saved from {CEILING:g} m either)"
            for one in lost
        )
        words.append(f"**No height is enough for:** {'; '.join(told)}.")
    if saved:
        worst = max(saved, key=lambda one: one.bound)
        words.append(
            f"With {_percent(CONFIDENCE)} confidence **{math.ceil(worst.bound)} m above the "
            f"ground are enough** for at least {_percent(worst.share)} of each other failure in "
            f"the table ({result.campaign.flights} flights of each). The failure that needs the "
            f"most is: {_name(worst)}."
        )
    return " ".join(words)


def _minimum(result: VehicleHeights) -> str:
    profile, most = result.profile, result.campaign.flights
    words = []
    if profile.minimum_height and profile.below_minimum is not BelowMinimum.DEPLOY:
        what = {BelowMinimum.KILL: "the motors stop", BelowMinimum.NOTHING: "nothing happens"}
        words.append(
            f"**Lower than {profile.minimum_height:g} m above the take-off no rule releases the "
            f"parachute** (`minimum_height` of the profile {profile.name}; it is looked at when "
            f"the rule decides): {what[profile.below_minimum]}."
        )
    needed = flights_needed(WANTED)
    if most < needed:
        words.append(
            f"{most} flights of each failure are too few to bound {_percent(WANTED)} of them: "
            f"that takes {needed} (`--flights {needed}`)."
        )
    return " ".join(words)


def heights(every: Sequence[CaseFlights]) -> str:
    """Of each case: what it needs."""
    head = ("failure", "median", "bound", "of such failures at least")
    rows = []
    for one in every:
        parts = zip(*(fall.parts for fall in one.lowest), strict=True)
        lost = " + ".join(f"{statistics.median(values):.1f}" for values in parts)
        saved, least = one.usual_saved
        told = f"{saved} of {len(one.needed)} (at least {_percent(least)})"
        middle = statistics.median(one.needed) if one.needed else math.nan
        needs = (_m(middle), f"**{_m(one.bound)}**", _share(one))
        rows.append((_name(one), *needs, f"{lost} m" if lost else "", told))
    return table((*head, "noticed + chain + opening", "saved from the usual heights"), rows)


#: Of a fall: s.
_SPANS: dict[str, Callable[[Fall], float]] = {
    "noticed": lambda one: one.noticed.after,
    "chain": lambda one: one.released.after - one.noticed.after,
    "opening": lambda one: one.carried.after - one.released.after,
    "failure to release": lambda one: one.released.after,
    "failure to canopy": lambda one: one.carried.after,
}


def times(every: Sequence[CaseFlights]) -> str:
    """Of each case: how long it takes; median and 99th percentile."""
    rows = []
    for found in every:
        cells = []
        for span in _SPANS.values():
            values = [span(one) for one in found.carried]
            cells.append("{:.2f} / {:.2f} s".format(*summary(values)) if values else "")
        rows.append((_name(found), str(len(found.carried)), *cells))
    return table(("failure", "flights", *_SPANS), rows)


def _description(result: VehicleHeights) -> str:
    vehicle = result.campaign.vehicle
    rows = [
        (f"`{key}`", _value(getattr(vehicle, key), field.unit), field.meaning)
        for key, field in NUMBERS.items()
        if getattr(vehicle, key)
    ]
    rows += [(f"sink of {name}", f"{span} m/s", "in the end") for name, span in vehicle.sinks]
    rows += [
        (f"`{key}`", str(value), "")
        for key, value in (
            ("kind", vehicle.kind),
            ("parachute", vehicle.parachute),
            ("self_release", str(vehicle.self_release).lower()),
            ("autopilot", vehicle.autopilot),
            ("vehicle_sources", ", ".join(vehicle.vehicle_sources)),
            ("profile", result.profile.name),
        )
    ]
    return (
        f"`{result.file}`:\n\n{table(('field', 'value', 'meaning'), rows)}\n\n{_follows(vehicle)}"
    )


def _follows(vehicle: DescribedVehicle) -> str:
    speeds = {
        "falls": vehicle.fall_speed.most,
        "sinks under its canopy": vehicle.descent_rate,
        "lands softly": vehicle.soft_landing,
    }
    told = [f"{what} with {v:.1f} m/s and {vehicle.energy(v):.0f} J" for what, v in speeds.items()]
    return f"It follows: the vehicle {', '.join(told)} (at most)."


def _value(value: float | Range, unit: str) -> str:
    return f"{value if isinstance(value, Range) else format(value, 'g')} {unit}"


def _name(found: CaseFlights) -> str:
    more = ", with faults" if found.case.faults else ""
    return f"{found.case.name}, {found.case.flown}{more}"


def _share(found: CaseFlights) -> str:
    return _percent(found.share) if math.isfinite(found.bound) else ""


def _percent(share: float) -> str:
    # Never more than is so.
    return f"{math.floor(share * 1000.0 + 1e-9) / 10.0:g} %"


def _m(height: float) -> str:
    if math.isnan(height):
        return "not flown"
    return "no height" if math.isinf(height) else f"{height:.1f} m"
