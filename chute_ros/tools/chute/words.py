"""Numbers and ages as a person reads them."""

from __future__ import annotations

import math

from chute_ros.plain_text import span_text

#: What is older than this is not shown as if it were now, s.
OLD_AFTER = 2.0
NEVER = "never received"


def is_old(age: float) -> bool:
    """Older than OLD_AFTER, or never received."""
    return not age <= OLD_AFTER


def age_text(age: float) -> str:
    """An age (s) in words; old ones say so."""
    if math.isnan(age):
        return NEVER
    if age < 1.0:
        return "<1 s ago"
    return f"{'OLD: ' if is_old(age) else ''}{span_text(age)} ago"


def not_here(listened: float) -> str:
    """Of what was not received since the listener heard its first word, so long ago (s): it may
    have been before, and by others."""
    return f"not received here within {span_text(listened)}"


def value_text(value: float, unit: str, digits: int = 1) -> str:
    """A measurement with its unit; NaN is not known."""
    # Without the sign of what rounds to zero.
    return "not known" if math.isnan(value) else f"{round(value, digits) + 0.0:.{digits}f} {unit}"
