"""The page of the failures that alone lead to a missed or a false deploy."""

from __future__ import annotations

from collections.abc import Sequence

from safety_case.check import TOLD
from safety_case.documents import Node, list_table, of_kind, plain, write_made
from safety_case.parts import VEHICLES, carried_by

_INTRODUCTION = """
Each single failure that, with the shipped settings, can lead to a missed or to a false deploy
although everything else works. All other rows of the `FMEA <fmea.html>`_ are covered by what the
row says. No likelihood of your parts is known here: what weighs most is what nobody is told of
before it does harm, and comes first; in each table, what concerns more kinds of vehicles comes
before what concerns fewer. What takes a stranger has a table of its own, as it has one answer:
signing keys, SROS 2, and wires that stay inside the vehicle.

IN: the vehicles of ``config/`` that have this part. The last column says why the failure stays,
and what you must do.
"""
_LEADS = {"MISSED": "missed deploy", "FALSE": "false deploy"}
_FORGED = "A stranger on a wire or on the network"
_TITLES = (
    "Nobody is told before it does harm",
    "An alarm in flight: land",
    "A take-off is forbidden; in flight nothing tells it before",
    "A take-off is forbidden, and an alarm in flight",
)
# Four columns are as wide as a printed page.
_HEAD = ("what fails", "leads to, in", "what happens", "why it stays, and what you must do")
_WIDTHS = (20, 14, 26, 40)


def write(nodes: Sequence[Node]) -> None:
    """From the rows of the FMEA."""
    failures = of_kind(nodes, "FAILURE_MODE")
    stay = [one for one in failures if one.get("STAYS")]
    tables: dict[str, list[Node]] = {title: [] for title in (*_TITLES, _FORGED)}
    for one in sorted(stay, key=lambda one: -len(carried_by(one["SECTION"]))):
        title = _FORGED if one["TITLE"] == "forged" else _TITLES[TOLD.index(one["TOLD"])]
        tables[title].append(one)
    kinds = "\n".join(f"- {one.name}: {plain(one.description)}" for one in VEHICLES.values())
    counted = f"{len(stay)} of {len(failures)} failure modes stay."
    parts = [("", f"{_INTRODUCTION}\n{kinds}\n\n{counted}")]
    for title, rows in tables.items():
        if rows:
            parts.append((title, list_table(_HEAD, map(_row, rows), _WIDTHS)))
    write_made("single_failures", "Single failures", parts)


def _row(one: Node) -> tuple[str, ...]:
    leads = [_LEADS[word.strip()] for word in one["SINGLE"].split(",")]
    return (
        f"{one['SECTION']}: **{one['TITLE']}**\n\n[LINK: {one['UID']}, {one['UID']}]",
        "\n\n".join([*leads, f"in {_wiring(one['SECTION'])}"]),
        _line(one["STATEMENT"]),
        _line(one["STAYS"]),
    )


def _wiring(section: str) -> str:
    names = carried_by(section)
    return "all" if len(names) == len(VEHICLES) else ", ".join(names)


def _line(text: str) -> str:
    return " ".join(text.split())
