"""Runs that were flown, in a file that later commands add to: one JSON object a line."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

from sitl.judge import Verdict
from sitl.page import Flown


def add(path: Path, flown: Flown) -> None:
    """One run more."""
    with path.open("a") as file:
        file.write(json.dumps(dataclasses.asdict(flown)) + "\n")


def load(path: Path, kind: str) -> list[Flown]:
    """All runs of this autopilot that are there."""
    if not path.exists():
        return []
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    return [
        Flown(**{**row, "verdict": Verdict(**row["verdict"])})
        for row in rows
        if row["kind"] == kind
    ]
