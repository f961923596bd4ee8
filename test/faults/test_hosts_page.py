"""docs/evidence/hosts.md is written part by part."""

import pytest

from faults.__main__ import main
from faults.hosts_page import PARTS, with_part


def test_a_part_alone_makes_a_page():
    page = with_part("", "ground", "| a table |", 0.5)
    assert page.startswith("# Several hosts\n")
    assert "## Vehicle and ground station" in page
    assert "Load before the run: 0.5" in page
    assert page.endswith("| a table |\n")
    assert "## A fleet" not in page


def test_a_part_that_is_written_again_leaves_the_others_alone():
    page = ""
    for part in reversed(PARTS):
        page = with_part(page, part, f"| {part} at first |", 0.5)
    again = with_part(page, "discovery", "| found |", 2.0)
    assert again == page.replace("| discovery at first |", "| found |").replace(
        "Load before the run: 0.5 (of the last minute).\n\n| found |",
        "Load before the run: 2.0 (of the last minute).\n\n| found |",
    )


def test_the_parts_keep_their_order_whichever_is_written_first():
    page = ""
    for part in reversed(PARTS):
        page = with_part(page, part, f"| {part} |", 0.5)
    places = [page.index(f"| {part} |") for part in PARTS]
    assert places == sorted(places)


def test_a_part_that_does_not_exist_is_said_before_anything_is_started(monkeypatch):
    monkeypatch.setattr("sys.argv", ["faults", "flet"])
    with pytest.raises(SystemExit) as ended:
        main()
    known = ", ".join(PARTS)
    assert str(ended.value) == f"hosts: part 'flet' is not known: need one of {known}"
