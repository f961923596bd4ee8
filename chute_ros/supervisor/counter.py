"""The leaky counter of a rule: goes up while the conditions hold, leaks while they do not.

It is never reset by one good sample: a counter that starts anew each time has missed deployments
of falling vehicles whose attitude swung through the upright.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from chute_ros.supervisor.rules import Rule

#: Two floats that count the same seconds may differ by this, s.
_ROUNDING = 1e-6
#: A counter stands still for so long while nothing can be said, s: a gap in the messages of a
#: vehicle that falls must not undo what was counted.
UNKNOWN_STANDS = 3.0


@dataclass(frozen=True)
class RuleEvidence:
    """What is known of a rule. level: s, 0 to the rule's hold."""

    level: float = 0.0
    #: The conditions held at the last update; None: it could not be said.
    holds: bool | None = False
    #: For how long it has not been possible to say, s.
    unknown: float = 0.0
    #: Distinct samples that showed it since the counter left 0.
    samples: int = 0
    #: Samples that had come at the last update.
    seen: int = -1
    #: It was acted on and is not done with yet.
    latched: bool = False
    #: Why it was fulfilled and not acted on; empty: it was not, or was.
    denied: str = ""

    def counted(self, rule: Rule, passed: float) -> RuleEvidence:
        """passed s later, while nothing new was seen."""
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
        stands = self.holds is None and unknown < UNKNOWN_STANDS
        kept = self.samples if self.holds or level > 0.0 or stands else 0
        return replace(self, level=level, samples=kept, unknown=unknown)

    def seeing(self, holds: bool | None, seen: int) -> RuleEvidence:
        """After the conditions were looked at; seen: samples that have come so far."""
        new = bool(holds) and (seen < 0 or seen != self.seen)
        return replace(self, holds=holds, seen=seen, samples=self.samples + int(new))

    def fulfilled(self, rule: Rule) -> bool:
        """It holds now, has for long enough, and enough samples showed it."""
        enough = self.samples >= rule.samples or self.seen < 0
        return bool(self.holds) and enough and self.level >= rule.hold - _ROUNDING

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
