"""What a judged log tells: what was decided, how near each rule came, what was not known."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from chute_ros.model import Action
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.judge_log.log_flight import JudgedLog
from chute_ros.tools.state_rows import RuleTold, rules_of

_DIGITS = str.maketrans("0123456789", "0" * 10)


@dataclass(frozen=True)
class Unknown:
    """A measurement that could not be used for this share (0 to 1) of the flight, or of a log
    without one, and why."""

    name: str
    share: float
    why: str


@dataclass(frozen=True)
class Rating:
    """One rule of the profile that ends a flight, in this one. nearest: its measurements when they
    came nearest to their limits, in words; blind: share of the time (0 to 1) in which too
    little was known for it to be fulfilled."""

    told: RuleTold
    nearest: tuple[str, ...]
    blind: float

    @property
    def share(self) -> float:
        """The highest counter as a share of what fulfils the rule."""
        if self.told.hold > 0.0:
            return self.told.peak / self.told.hold
        return 0.0 if math.isnan(self.told.fulfilled_at) else 1.0

    @property
    def short_of(self) -> str:
        """What it lacked beside a full counter, in words; empty: nothing, or its counter was not
        full."""
        full = self.share >= 1.0 and math.isnan(self.told.fulfilled_at)
        return ", shown by too few distinct samples" if full else ""


@dataclass(frozen=True)
class LogVerdict:
    """A judged log in a few words, without what was seen of it. first: when it was ended, s of the
    log, NaN: it was not; release_height: where a parachute was released, m, NaN: none was, or
    nobody knew; ratings: of its rules, the nearest first; unknown: the longest first."""

    path: Path
    format: str
    profile: str
    duration: float
    flew: float
    words: str
    first: float
    release_height: float
    ratings: tuple[Rating, ...]
    unknown: tuple[Unknown, ...]

    @property
    def moved(self) -> list[Rating]:
        """Of the rules whose counters moved."""
        return [one for one in self.ratings if one.share > 0.0]

    @property
    def nearest(self) -> str:
        """Which rule, and how near it came, in words."""
        near = next(iter(self.moved), None)
        if near is None:
            return "none moved"
        return f"{near.told.name}: {100.0 * near.share:.0f} %{near.short_of}"

    @property
    def ended(self) -> bool:
        """A parachute would have been released, or the motors stopped in flight."""
        return not math.isnan(self.first)


def verdict_of(judged: JudgedLog) -> LogVerdict:
    """Of this log."""
    released = [at for at, one in judged.fired if one.action is Action.DEPLOY]
    return LogVerdict(
        judged.log.path,
        judged.log.format,
        judged.config.profile.name,
        judged.log.duration,
        judged.flew,
        _words(judged),
        judged.fired[0][0] if judged.fired else math.nan,
        height_at(judged, released[0]) if released else math.nan,
        ratings(judged),
        unknown(judged),
    )


def _words(judged: JudgedLog) -> str:
    if judged.fired:
        return fired_words(judged)
    return "nothing ended the flight" if judged.flew else "never in flight"


def fired_words(judged: JudgedLog) -> str:
    """What ended it, and when; empty: nothing did."""
    return ", ".join(f"{one.action.name} at {at:.1f} s ({one.rule})" for at, one in judged.fired)


def height_at(judged: JudgedLog, at: float) -> float:
    """The height (m) that was known then; NaN: none."""
    known = [state.height for when, state in judged.vehicle if when <= at]
    return known[-1] if known else math.nan


def ratings(judged: JudgedLog) -> tuple[Rating, ...]:
    """Of each rule that may end a flight, the nearest first."""
    told = {one.name: one for one in rules_of(judged.pictures)}
    near = judged.nearest
    found = [
        Rating(told[rule.name], tuple(near.words(rule)), near.blind(rule))
        for rule in judged.config.profile.rules
        if rule.action >= Action.KILL and rule.name in told
    ]
    return tuple(sorted(found, key=lambda one: -one.share))


def unknown(judged: JudgedLog) -> tuple[Unknown, ...]:
    """What of the vehicle could not be used in flight, the longest first; of a vehicle that was
    never in flight, in the whole log: that may be why."""
    looked_at = [one for _, one in judged.pictures if one.state == Stage.IN_FLIGHT]
    looked_at = looked_at or [one for at, one in judged.pictures if at >= 0.0]
    reasons: dict[str, Counter[str]] = {}
    for one in looked_at:
        for line in one.unusable:
            name, _, why = line.partition(": ")
            reasons.setdefault(name, Counter())[why.translate(_DIGITS)] += 1
    lines = [line.partition(": ") for one in looked_at for line in one.unusable]
    newest = {name: why for name, _, why in lines}
    found = [
        Unknown(name, sum(whys.values()) / len(looked_at), newest[name])
        for name, whys in reasons.items()
    ]
    return tuple(sorted(found, key=lambda one: -one.share))


def blocked(judged: JudgedLog) -> list[str]:
    """Why the vehicle must not have taken off, as the supervisor knew it when it did; empty: it
    was ready, or nobody knows."""
    before: Sequence[str] = ()
    for _, one in judged.pictures:
        if one.state == Stage.IN_FLIGHT:
            return list(before)
        before = one.block_reasons
    return []
