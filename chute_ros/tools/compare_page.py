"""The comparison with what people use today as a page."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from typing import NamedTuple

from chute_ros.campaign.comparison import CURVE_OF, FACTORS, Compared
from chute_ros.campaign.guards import GUARDS, OURS
from chute_ros.campaign.judge import Count
from chute_ros.tools.compare_classes import (
    MISSED,
    Better,
    better,
    by_class,
    excused_and_saved,
    missed_and_false,
    paired_delays,
)
from chute_ros.tools.compare_words import (
    BETTER,
    CLASSES,
    CURVES,
    DELAYS,
    EXCUSED,
    INTRODUCTION,
    RULES,
    SHORT,
    WHY_BETTER,
)
from chute_ros.tools.pages import summary, table

#: So many seeds of flights are named.
_MOST_NAMED = 8


class Run(NamedTuple):
    """seeds: flown from seed first on; took: s; how: what the speed depends on, in words."""

    seeds: int
    first: int
    took: float
    how: str


def page(lines: Sequence[Compared], run: Run, pictures: Sequence[str]) -> str:
    """As Markdown. pictures: the names of the files of the curves and of the delays."""
    curves, delays = pictures
    plain = [one for one in lines if one.factor == 1.0]
    command = f"make compare FLIGHTS={run.seeds} SEED={run.first}"
    flights = len({one.seed for one in plain})
    told = f"{flights} flights of aircraft with each guard, {run.took:.0f} s, {run.how}"
    parts = [
        "# Beside what people use today",
        f"Written by `{command}`: {told}.",
        INTRODUCTION,
        SHORT,
        _short(plain),
        table(("guard", "settings, and what is scaled for the curves"), _guards()),
        RULES,
        *_counted(plain),
        "## From the failure to the release",
        f"![delays]({delays})",
        DELAYS,
        _delays(plain),
        "## By class",
        CLASSES,
        *(_classes(plain, title, key) for title, key in _KEYS),
        "## False against missed",
        f"![curves]({curves})",
        CURVES,
        _curve(lines),
        "## Where others are better",
        BETTER,
        _table_of_better(plain),
        WHY_BETTER,
        "## Excused, and saved by a peer",
        EXCUSED,
        _excused(plain),
    ]
    return "\n\n".join(parts) + "\n"


#: Titles of classes, and what a flight's class is.
_KEYS: tuple[tuple[str, Callable[[Compared], tuple[str, str]]], ...] = (
    ("what fails", lambda one: (one.profile, one.failure)),
    ("fault", lambda one: (one.profile, one.fault)),
    ("manoeuvre", lambda one: (one.profile, one.manoeuvre or "none")),
)


def _guards() -> list[tuple[str, str]]:
    return [(one.name, one.about) for one in GUARDS]


def _short(plain: Sequence[Compared]) -> str:
    profiles = sorted({one.profile for one in plain})
    rows = []
    for guard in GUARDS:
        cells = []
        for profile in profiles:
            of = [one for one in plain if (one.profile, one.guard) == (profile, guard.name)]
            needed = [one for one in of if one.needed]
            saved = sum(one.bare is Count.CORRECT for one in needed)
            cells += [_share(saved, needed), _share(missed_and_false(of, guard.name)[1], of)]
        rows.append((guard.name, *cells))
    head = (f"{profile}: {what}" for profile in profiles for what in ("saved", "false"))
    return table(("guard", *head), rows)


def _share(number: int, whole: Sequence[Compared]) -> str:
    return f"{number} of {len(whole)} ({100.0 * number / max(1, len(whole)):.1f} %)"


def _counted(plain: Sequence[Compared]) -> list[str]:
    parts = []
    for profile in sorted({one.profile for one in plain}):
        of = [one for one in plain if one.profile == profile]
        parts += [
            f"## Counted: {profile}",
            "As the campaign counts:",
            _counts(of, lambda one: one.count),
            "Without any excuse:",
            _counts(of, lambda one: one.bare),
        ]
    return parts


def _counts(of: Sequence[Compared], count: Callable[[Compared], Count]) -> str:
    present = [c for c in Count if any(count(one) is c for one in of)]
    rows = []
    for guard in GUARDS:
        counts = [count(one) for one in of if one.guard == guard.name]
        rows.append((guard.name, *(str(counts.count(c)) for c in present)))
    return table(("guard", *(c.value.partition(":")[0] for c in present)), rows)


def _delays(plain: Sequence[Compared]) -> str:
    rows = []
    for profile in sorted({one.profile for one in plain}):
        of = [one for one in plain if one.profile == profile]
        for guard in GUARDS:
            mine = [one for one in of if one.guard == guard.name]
            told = [one for one in mine if not math.isnan(one.delay)]
            pairs = paired_delays(of, guard.name) if guard is not OURS else []
            rows.append(
                (
                    f"{profile}, {guard.name}",
                    f"{len(told)} of {sum(one.needed for one in mine)}",
                    *_spread([one.delay for one in told], "s"),
                    *_spread([one.lost for one in told], "m"),
                    *_medians(pairs),
                )
            )
    head = ("guard", "released of needed", "delay: median", "99th percentile")
    lost = ("height lost: median", "99th percentile", "both: the peer", "this product")
    return table((*head, *lost), rows)


def _spread(values: list[float], unit: str) -> tuple[str, str]:
    if not values:
        return "", ""
    middle, high, _ = summary(values)
    return f"{middle:.2f} {unit}", f"{high:.2f} {unit}"


def _medians(pairs: list[tuple[float, float]]) -> tuple[str, str]:
    if not pairs:
        return "", ""
    theirs, ours = zip(*pairs, strict=True)
    return f"{statistics.median(theirs):.2f} s", f"{statistics.median(ours):.2f} s"


def _classes(
    plain: Sequence[Compared], title: str, key: Callable[[Compared], tuple[str, str]]
) -> str:
    rows = []
    for (profile, name), of in by_class(plain, key):
        flights = sum(one.guard == OURS.name for one in of)
        cells = (missed_and_false(of, guard.name) for guard in GUARDS)
        rows.append((profile, name, str(flights), *(f"{m} / {f}" for m, f in cells)))
    return table(("profile", title, "flights", *(one.name for one in GUARDS)), rows)


def _curve(lines: Sequence[Compared]) -> str:
    rows = []
    for profile in sorted({one.profile for one in lines}):
        for guard in GUARDS:
            cells = (shares(lines, profile, guard.name, factor) for factor in FACTORS)
            told = ("" if one is None else f"{one[0]:.1f} / {one[1]:.1f}" for one in cells)
            rows.append((f"{profile}, {guard.name}", *told))
    return table(("missed / false, %", *(f"{one:g}" for one in FACTORS)), rows)


def shares(
    lines: Sequence[Compared], profile: str, guard: str, factor: float
) -> tuple[float, float] | None:
    """Return missed or late in percent of those that need a parachute, and false in percent of
    all, of the flights of the curve; None: there is none."""
    of = [
        one
        for one in lines
        if one.seed % CURVE_OF == 0
        and (one.profile, one.guard, one.factor) == (profile, guard, factor)
    ]
    if not of:
        return None
    needed = sum(one.needed for one in of)
    missed = sum(one.bare in MISSED for one in of)
    false = sum(one.bare is Count.FALSE for one in of)
    return 100.0 * missed / max(1, needed), 100.0 * false / len(of)


def _table_of_better(plain: Sequence[Compared]) -> str:
    # What two peers are better in to the same extent is one row.
    found: dict[tuple[str, Better], list[str]] = {}
    for title, key in _KEYS:
        for (profile, name), of in by_class(plain, key):
            for guard in GUARDS:
                one = better(of, guard.name) if guard is not OURS else None
                if one is not None:
                    where = f"{profile}, {title}: {name}"
                    found.setdefault((where, one), []).append(guard.name)
    rows = [(where, "; ".join(who), *_cells(one)) for (where, one), who in found.items()]
    if not rows:
        return "None."
    head = ("class", "peer", "missed or late: peer, ours", "false: peer, ours")
    return table((*head, "median delay: peer, ours", "seeds"), rows)


def _excused(plain: Sequence[Compared]) -> str:
    rows = []
    for (profile, failure), of in by_class(plain, lambda one: (one.profile, one.failure)):
        for guard in GUARDS:
            if seeds := excused_and_saved(of, guard.name):
                named = ", ".join(str(seed) for seed in seeds[:_MOST_NAMED])
                rows.append((profile, failure, guard.name, str(len(seeds)), named))
    if not rows:
        return "None."
    return table(("profile", "what fails", "peer", "flights", "seeds"), rows)


def _cells(one: Better) -> tuple[str, ...]:
    missed = _marked(one.missed, one.missed[0] < one.missed[1])
    false = _marked(one.false, one.false[0] < one.false[1])
    delay = ""
    if one.delay is not None:
        delay = _marked(tuple(f"{s:.2f} s" for s in one.delay), one.earlier)
    return missed, false, delay, ", ".join(str(seed) for seed in one.seeds)


def _marked(pair: Sequence[object], is_better: bool) -> str:
    text = ", ".join(str(one) for one in pair)
    return f"**{text}**" if is_better else text
