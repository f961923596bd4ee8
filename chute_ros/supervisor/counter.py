"""The leaky counter of a rule: goes up while the conditions hold, leaks while they do not.

It is never reset by one good sample: a counter that starts anew each time has missed deployments
of falling vehicles whose attitude swung through the upright.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.rules import Rule

#: Two floats that count the same seconds may differ by this, s.
_ROUNDING = 1e-6
#: Weights that add up to what is needed may miss it by this.
_WEIGHTS_ROUNDING = 1e-9
#: A counter stands still for so long while nothing can be said, s: a gap in the messages of a
#: vehicle that falls must not undo what was counted.
UNKNOWN_STANDS = 3.0
#: A sign goes on (`until`) for so long after it last held by its own limit, s: an autopilot counts
#: as lost 2.5 s after a fall has begun, and a force that is always told too small is no fall.
LINGERS = 5.0


class Look(NamedTuple):
    """A condition as it was found. holds None: it cannot be said. samples: so many of what it
    rests on have come so far; -1: none come. doubted: it counts only the rule's part of it.
    lingers: it holds only as it goes on.
    """

    holds: bool | None
    samples: int = -1
    doubted: bool = False
    lingers: bool = False


@dataclass(frozen=True)
class RuleEvidence:
    """What is known of a rule. level: s, 0 to the rule's hold."""

    level: float = 0.0
    #: The conditions that are counted held at the last look; None: it could not be said.
    holds: bool | None = False
    #: For how long it has not been possible to say, s.
    unknown: float = 0.0
    #: For each condition the distinct samples that showed it, at most those that the rule needs,
    #: less what has leaked: one sample that denies it takes the rule's leak away.
    shown: tuple[float, ...] = ()
    #: For each condition the samples that had come at the last look; -1: it rests on none.
    seen: tuple[int, ...] = ()
    #: For each condition: for how long it may still go on to hold, s; empty: none may.
    kept: tuple[float, ...] = ()
    #: Enough conditions held, each of them shown by enough samples.
    sure: bool = False
    #: It was acted on and is not done with yet.
    latched: bool = False
    #: Its deploy was put off, as it was too low for one: the motors were stopped alone. It follows
    #: once the vehicle is not too low, or nobody knows, while it still falls.
    put_off: bool = False
    #: Why it was fulfilled and not acted on; empty: it was not, or was.
    denied: str = ""

    def counted(self, rule: Rule, passed: float) -> RuleEvidence:
        """passed s later, while nothing new was seen."""
        if self.holds is False and self.level == 0.0 == self.unknown and not self.kept:
            return self  # most rules stand so at most updates
        unknown = self.unknown + passed if self.holds is None else 0.0
        level = self.level
        if self.holds:
            level += passed
        elif self.holds is False:
            level -= rule.leak * passed
        else:
            # What cannot be said is no good sample: it leaks only once it has been so for long.
            level -= rule.leak * min(passed, max(0.0, unknown - UNKNOWN_STANDS))
        level = min(max(level, 0.0), rule.hold)
        kept = self.kept
        if kept:
            emptied = level <= 0.0 and not self.full(rule)
            kept = () if emptied else tuple([max(0.0, left - passed) for left in kept])
            kept = kept if any(kept) else ()
        if level == self.level and unknown == self.unknown and kept == self.kept:
            return self
        return replace(self, level=level, unknown=unknown, kept=kept)

    def seeing(self, rule: Rule, found: Sequence[Look]) -> RuleEvidence:
        """After the conditions were looked at. found: each of them, in their order."""
        known = len(self.shown) == len(found)  # otherwise it is another rule of this name
        before = self.shown if known else (0.0,) * len(found)
        last = self.seen if known else (-1,) * len(found)
        shown, now_seen = [], []
        weight = possible = sure = 0.0
        for condition, (holds, seen, doubted, _), count, old in zip(
            rule.conditions, found, before, last, strict=True
        ):
            counts = condition.weight * (rule.doubted if doubted else 1.0)
            now_seen.append(seen)
            if seen != old:
                change = 1.0 if holds else 0.0 if holds is None else -rule.leak
                count = min(max(0.0, count + change), float(rule.samples))
            shown.append(count)
            if holds:
                sure += counts if seen < 0 or count >= rule.samples else 0.0
            presumed = not condition.counted
            if holds or presumed:
                weight += counts
            # What cannot be said keeps no more than it has shown itself.
            stands = holds is None and (seen < 0 or count > 0.0)
            if holds or presumed or stands:
                possible += counts
        enough = rule.needed - _WEIGHTS_ROUNDING
        rule_holds = True if weight >= enough else None if possible >= enough else False
        is_sure, shown_now, seen_now = sure >= enough, tuple(shown), tuple(now_seen)
        kept = self._kept(rule, found, shown) if rule.goes_on else ()
        same = rule_holds is self.holds and is_sure is self.sure and kept == self.kept
        if same and seen_now == self.seen and shown_now == self.shown:
            return self
        return replace(
            self, holds=rule_holds, shown=shown_now, seen=seen_now, sure=is_sure, kept=kept
        )

    def _kept(
        self, rule: Rule, found: Sequence[Look], shown: Sequence[float]
    ) -> tuple[float, ...]:
        """What holds by its own limit, in no doubt, in enough samples, as the counter is full,
        goes on from now. What is beyond its last limit is over; the others are as they were."""
        full = self.full(rule)
        before = self.kept if len(self.kept) == len(found) else (0.0,) * len(found)
        kept = []
        for (holds, seen, doubted, lingers), count, left in zip(found, shown, before, strict=True):
            if holds and not lingers:
                sure = full and not doubted and seen >= 0 and count >= rule.samples
                kept.append(LINGERS if sure else left)
            else:
                kept.append(0.0 if holds is False else left)
        return tuple(kept) if any(kept) else ()

    def fulfilled(self, rule: Rule) -> bool:
        """It holds now, has for long enough, and enough samples showed it."""
        return self.sure and self.full(rule)

    def full(self, rule: Rule) -> bool:
        """Its counter has gone up to the rule's hold."""
        return self.level >= rule.hold - _ROUNDING

    def cleared(self) -> bool:
        """Its counter has leaked to nothing."""
        return not self.holds and self.level <= _ROUNDING

    def deadline(self, rule: Rule, now: float) -> float:
        """When the counter is full, or empty, if nothing new is seen; infinity: it is."""
        if self.holds:
            return now + rule.hold - self.level if self.level < rule.hold else math.inf
        if self.latched and rule.leak > 0.0 and self.level > 0.0:
            stands = UNKNOWN_STANDS - self.unknown if self.holds is None else 0.0
            return now + max(0.0, stands) + self.level / rule.leak
        return math.inf
