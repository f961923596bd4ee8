"""The page of the failures that alone lead to a missed or a false deploy."""

from __future__ import annotations

from collections.abc import Sequence

from chute_ros.links.registered import vehicles
from safety_case.documents import Node, list_table, of_kind, plain, write_made
from safety_case.parts import carried_by

_INTRODUCTION = """
Each single failure that, with the shipped settings, can lead to a missed or to a false deploy
although everything else works. All other rows of the `FMEA <fmea.html>`_ are covered by what the
row says. The last column says why the failure stays, and what the integrator must do.

IN: the vehicles of ``config/`` that have this part.
"""
_LEADS = {"MISSED": "missed deploy", "FALSE": "false deploy"}


def write(nodes: Sequence[Node]) -> None:
    """From the rows of the FMEA."""
    failures = of_kind(nodes, "FAILURE_MODE")
    # What takes a stranger comes last: it has one answer, and hides the others.
    stay = sorted(
        (one for one in failures if one.get("STAYS")), key=lambda one: one["TITLE"] == "forged"
    )
    rows = [
        (
            f"{one['SECTION']}: **{one['TITLE']}**\n\n[LINK: {one['UID']}, {one['UID']}]",
            "\n\n".join(
                [_LEADS[word.strip()] for word in one["SINGLE"].split(",")]
                + [f"in {_wiring(one['SECTION'])}"]
            ),
            _line(one["STATEMENT"]),
            _line(one["STAYS"]),
        )
        for one in stay
    ]
    # Five columns are wider than a printed page.
    head = ("what fails", "leads to, in", "what happens", "why it stays, and what you must do")
    table = list_table(head, rows, (20, 14, 26, 40))
    kinds = "\n".join(f"- {one.name}: {plain(one.description)}" for one in vehicles().values())
    counted = f"{len(stay)} of {len(failures)} failure modes stay."
    text = f"{_INTRODUCTION}\n{kinds}\n\n{counted}\n\n{table}"
    write_made("single_failures", "Single failures", [("", text)])


def _wiring(section: str) -> str:
    names = carried_by(section)
    return "all" if len(names) == len(vehicles()) else ", ".join(names)


def _line(text: str) -> str:
    return " ".join(text.split())
