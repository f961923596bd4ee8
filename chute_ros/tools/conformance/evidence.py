"""make conformance: each kit on its simulated device, sound and broken in each clause.

In virtual time; writes docs/evidence/conformance.md. Exit code 1: a kit did not find just what is
broken.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from chute_ros.conformance.clause import Clause, Result, Verdict
from chute_ros.conformance.kit import Kit
from chute_ros.links.api import load
from chute_ros.links.registered import links
from chute_ros.tools.pages import table

_PAGE = Path("docs/evidence/conformance.md")
_HEAD = """# Conformance kits on devices that break each clause

Written by `make conformance`. Each kit ([guide](../guide/conformance.md)) tries its simulated
device in virtual time: sound, and wrong in one clause after the other. A kit that fails another
clause, or not the one that is broken, is a failure of the command. What no bench can show is not
tried: its reason stands in its place.
"""


def main() -> None:
    """Write the page."""
    parts, wrong = [_HEAD], []
    for kind in links().values():
        if kind.kit:
            text, problems = _part(kind.device, load(kind.kit))
            parts.append(text)
            wrong += problems
    _PAGE.write_text("\n".join(parts))
    if wrong:
        sys.exit("\n".join(f"conformance: {one}" for one in wrong))


def tried(kit: Kit, broken: str) -> list[Result]:
    """The results on a device that breaks this clause; empty: none."""
    line = kit.virtual(broken)
    line.run()
    return [event for event in line.events if isinstance(event, Result)]


def _part(device: str, kit: Kit) -> tuple[str, list[str]]:
    """Of the page, and what is wrong."""
    sound = tried(kit, "")
    problems = [f"{device}, sound: {one.clause.name}: {one.why}" for one in _failed(sound)]
    rows, found, broken = [], 0, 0
    for clause in kit.clauses:
        if why := clause.out_of_reach:
            rows.append(_row(clause, f"not tried: {why}", []))
            continue
        broken += 1
        failed = _failed(tried(kit, clause.name))
        others = [one.clause.name for one in failed if one.clause.name != clause.name]
        mine = [one.why for one in failed if one.clause.name == clause.name]
        found += bool(mine) and not others
        if others or not mine:
            told = ", ".join(others) or "nothing"
            problems.append(f"{device}, {clause.name} is broken: found {told}")
        rows.append(_row(clause, mine[0] if mine else "**not found**", others))
    verdicts = [one.verdict for one in sound]
    counted = ", ".join(f"{verdicts.count(one)} {one.value}" for one in Verdict if one in verdicts)
    told = (
        f"The sound device: {counted}. Of {broken} devices that break a clause each, {found} "
        "failed in that clause and in no other."
    )
    heads = ("clause", "section", "what the document says", "seen of a device that breaks it")
    return f"## {device}: {kit.document}\n\n{told}\n\n{table(heads, rows)}\n", problems


def _failed(results: list[Result]) -> list[Result]:
    return [one for one in results if one.verdict is Verdict.FAILED]


def _row(clause: Clause[Any], seen: str, others: list[str]) -> tuple[str, ...]:
    besides = f"; **and {', '.join(others)}**" if others else ""
    source = f"{clause.document}, {clause.section}"
    return f"`{clause.name}`", source, clause.text, (seen + besides).replace("|", "\\|")


if __name__ == "__main__":
    main()
