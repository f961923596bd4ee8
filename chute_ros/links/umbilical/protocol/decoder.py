"""$TELEM lines to records: which layout it is, and what is wrong with a line that is none.

A layout that was set is the only one. Otherwise it is recognised: by the count of fields, and
where two layouts have the same count by what the fields can be. It takes several lines in a row
that fit one layout to believe in it, as a cut line may have the count of another by chance.

Source: Umbilical Reference, section 3.
"""

from __future__ import annotations

from collections import Counter

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.protocol.fields import may_be_record
from chute_ros.links.umbilical.protocol.layouts import Layout, Problem, Record
from chute_ros.protocol.events import Notice, Severity

#: So many lines in a row must fit a layout before it is believed, or another one is.
LINES_TO_RECOGNISE = 3
#: Different counts of fields that are told of in words.
_MOST_TOLD = 16

NOT_YET = "before the layout was recognised"


class TelemetryDecoder:
    """layouts: those that are known, the preferred one first; fixed: the name of the only one."""

    def __init__(self, layouts: list[Layout], fixed: str, counts: Counter[str]) -> None:
        self.layouts = layouts
        names = [layout.name for layout in layouts]
        if fixed and fixed not in names:
            raise ParameterError(f"layout {fixed!r} is not known: need one of {', '.join(names)}")
        self._fixed = bool(fixed)
        self._counts = counts
        self.layout = next((one for one in layouts if one.name == fixed), None)
        #: Lines in a row that fit this layout, which is not the present one.
        self._rival: Layout | None = None
        self._streak = 0
        self._told: set[int] = set()
        self._notices: list[Notice] = []

    def decode(self, body: str, now: float) -> Record | None:
        """The record in a line's body; None: it is counted under its reason."""
        present = self.layout
        problem = None
        if present is not None:
            result = present.decode(body)
            if isinstance(result, Problem):
                problem = result
            elif self._fixed or present.is_as_expected(result) or self._fitting(body) is present:
                if self._rival is not None and not _fits(self._rival, body):
                    # A line that fits both says nothing against the other.
                    self._rival, self._streak = None, 0
                return Record(present, result, now)
        if not self._fixed and self._recognised(self._fitting(body)):
            assert self.layout is not None
            values = self.layout.decode(body)
            assert not isinstance(values, Problem)
            return Record(self.layout, values, now)
        self._count(body, problem)
        return None

    def is_telemetry(self, body: bytes) -> bool:
        """A whole record of any layout that may come: not a part of a dump."""
        if not may_be_record(body):
            return False
        text = body.decode()
        known = [self.layout] if self._fixed and self.layout else self.layouts
        return any(not isinstance(one.decode(text), Problem) for one in known)

    def take_notices(self) -> list[Notice]:
        """What a person should read; each is handed out once."""
        notices, self._notices = self._notices, []
        return notices

    # -- inside ----------------------------------------------------------------------------------

    def _fitting(self, body: str) -> Layout | None:
        """The layout that a line fits best: the present one if it is as good as any."""
        present = [self.layout] if self.layout is not None else []
        order = [*present, *(one for one in self.layouts if one is not self.layout)]
        fits = [(one, one.decode(body)) for one in order]
        good = [(one, values) for one, values in fits if not isinstance(values, Problem)]
        as_expected = [one for one, values in good if one.is_as_expected(values)]
        return next(iter([*as_expected, *(one for one, _ in good)]), None)

    def _recognised(self, fitting: Layout | None) -> bool:
        """Count this line for its layout; True: the layout is believed from now on."""
        if fitting is not self._rival:
            self._rival, self._streak = fitting, 0
        if fitting is None:
            return False
        self._streak += 1
        if self._streak < LINES_TO_RECOGNISE:
            return False
        before, self.layout = self.layout, fitting
        self._rival, self._streak = None, 0
        text = f"telemetry has layout {fitting.name} ({fitting.count} fields)"
        if before is None:
            self._notices.append(Notice(Severity.INFO, text))
        else:
            text = f"{text}, no longer {before.name}"
            self._notices.append(Notice(Severity.WARNING, text))
        return True

    def _count(self, body: str, problem: Problem | None) -> None:
        """Under its reason: by the present layout, or by the first that has this count."""
        count = body.count(",") + 1
        if self._rival is not None:
            present = self.layout
            fits = f"fits {self._rival.name}, not {present.name}" if present else NOT_YET
            self._counts[fits] += 1
            return
        if self.layout is None:
            problems = (one.decode(body) for one in self.layouts if one.count == count)
            problem = next((one for one in problems if isinstance(one, Problem)), None)
        elif count != self.layout.count:
            problem = None
        if problem is not None:
            self._counts[problem.reason] += 1
            return
        told = self._tell(count)
        self._counts[f"{count} fields" if told else "other counts of fields"] += 1

    def _tell(self, count: int) -> bool:
        """Say once that no layout has this count; False: too many different ones came."""
        if count not in self._told:
            if len(self._told) >= _MOST_TOLD:
                return False
            self._told.add(count)
            known = ", ".join(f"{one.name} ({one.count} fields)" for one in self.layouts)
            wanted = f"{self.layout.name} has {self.layout.count}" if self.layout else "none fits"
            text = f"a $TELEM line of {count} fields: {wanted}; known are {known}"
            self._notices.append(Notice(Severity.WARNING, text))
        return True


def _fits(layout: Layout, body: str) -> bool:
    values = layout.decode(body)
    return not isinstance(values, Problem) and layout.is_as_expected(values)
