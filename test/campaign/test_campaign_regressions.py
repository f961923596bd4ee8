"""Flights that once went wrong, flown again: each file says what it once was, and each has its row
in docs/evidence/lessons.md, which names none that is not stored."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from campaign_bench import SHIPPED

from chute_ros.campaign.flight import fly
from chute_ros.campaign.judge import WRONG, judge
from chute_ros.campaign.scenario_text import scenario_of

STORED = sorted((Path(__file__).parent / "regressions").glob("*.json"))
LESSONS = Path(__file__).parents[2] / "docs" / "evidence" / "lessons.md"


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_what_once_went_wrong_goes_well(path: Path) -> None:
    scenario, was = scenario_of(path.read_text(encoding="utf-8"), path.name)
    assert was
    judged = judge(fly(scenario, SHIPPED))
    assert judged.count not in WRONG, f"{was}; now: {judged.why}"


def test_each_stored_flight_has_its_row_with_what_it_was_counted_as() -> None:
    table = LESSONS.read_text(encoding="utf-8").split("<!--")[1]
    counted: dict[str, str] = {}
    for row in table.splitlines():
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        if row.startswith("| `"):
            assert len(cells) == 4, row
            assert all(cells), row
            counted |= dict.fromkeys(re.findall(r"`(\w+)`", cells[0]), cells[1])
    assert counted == {
        path.stem: re.match(r"[A-Z_]+", json.loads(path.read_text())["was"])[0] for path in STORED
    }
    assert counted
