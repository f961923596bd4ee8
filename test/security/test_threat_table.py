"""Every row of the threat table names tests, and they exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WIRES = {"MAVLink", "CAN", "umbilical", "ROS network", "files", "web"}

#: What stands beside a row's own story.
UNNAMED = {
    "test_the_times_of_signing_are_for_the_owner_alone_and_hold_no_key",
    "test_times_that_cannot_be_kept_are_a_warning",
    "test_the_autopilot_of_another_without_the_key_is_nobody",
}


def rows():
    text = (ROOT / "docs" / "guide" / "security.md").read_text()
    table = text[text.index("<!-- threats") : text.index("<!-- end of threats -->")]
    lines = [line for line in table.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[1:]]


def named(row):
    return re.findall(r"`([\w/]+\.py)::(\w+)`", row[3])


def functions(path):
    tree = ast.parse((ROOT / path).read_text())
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def test_every_wire_is_in_the_table():
    assert {row[0] for row in rows()} == WIRES
    assert len(rows()) > 25


@pytest.mark.parametrize("row", rows(), ids=lambda row: f"{row[0]}: {row[1]}"[:60])
def test_a_row_has_four_cells_and_names_tests_that_exist(row):
    assert len(row) == 4
    assert all(row)
    tests = named(row)
    assert tests, "no test is named"
    assert len(tests) == row[3].count("`") // 2, "all of the cell is tests"
    for path, name in tests:
        assert name.startswith("test_")
        assert name in functions(path), f"{path} has no {name}"


def test_every_test_of_an_attack_is_in_the_table():
    """A story of an attack that no row names would be one that nobody reads of."""
    told = {name for row in rows() for _, name in named(row)}
    attacks = set()
    for path in (ROOT / "test" / "security").glob("test_*_attacks.py"):
        attacks |= {name for name in functions(path) if name.startswith("test_")}
    assert attacks - told == UNNAMED
