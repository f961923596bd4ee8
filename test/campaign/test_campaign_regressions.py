"""Flights that once went wrong, flown again: each file says what it once was."""

from __future__ import annotations

from pathlib import Path

import pytest
from campaign_bench import SHIPPED

from chute_ros.campaign.flight import fly
from chute_ros.campaign.judge import WRONG, judge
from chute_ros.campaign.scenario_text import scenario_of

STORED = sorted((Path(__file__).parent / "regressions").glob("*.json"))


def test_there_are_some() -> None:
    assert STORED


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_what_once_went_wrong_goes_well(path: Path) -> None:
    scenario, was = scenario_of(path.read_text(encoding="utf-8"), path.name)
    assert was
    judged = judge(fly(scenario, SHIPPED))
    assert judged.count not in WRONG, f"{was}; now: {judged.why}"
