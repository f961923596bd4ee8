"""docs/evidence/lessons.md has a row for each stored flight, and names none that is not stored."""

from __future__ import annotations

import json
import re
from pathlib import Path

FOLDER = Path(__file__).parent / "regressions"
PAGE = Path(__file__).parents[2] / "docs" / "evidence" / "lessons.md"


def test_each_stored_flight_has_its_row_with_what_it_was_counted_as() -> None:
    table = PAGE.read_text(encoding="utf-8").split("<!--")[1]
    counted: dict[str, str] = {}
    for row in table.splitlines():
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        if row.startswith("| `"):
            assert len(cells) == 4, row
            assert all(cells), row
            counted |= dict.fromkeys(re.findall(r"`(\w+)`", cells[0]), cells[1])
    stored = {
        path.stem: re.match(r"[A-Z_]+", json.loads(path.read_text())["was"])[0]
        for path in FOLDER.glob("*.json")
    }
    assert counted == stored
