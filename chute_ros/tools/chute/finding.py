"""What the doctor finds: one line each, with its remedy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

WRONG, NOTE, OK = "WRONG", "NOTE", "OK"
_WORST_FIRST = (WRONG, NOTE, OK)


@dataclass(frozen=True)
class DoctorFinding:
    """level: WRONG needs its remedy, NOTE is good to know, OK is as it should be."""

    level: str
    what: str
    remedy: str = ""


def worst_first(findings: Sequence[DoctorFinding]) -> list[DoctorFinding]:
    """Those of one level in the order in which they were found."""
    return sorted(findings, key=lambda one: _WORST_FIRST.index(one.level))


def finding_lines(findings: Sequence[DoctorFinding]) -> list[str]:
    """For a terminal."""
    return [
        f"{one.level:<6} {one.what}" + (f" -> {one.remedy}" if one.remedy else "")
        for one in findings
    ]
