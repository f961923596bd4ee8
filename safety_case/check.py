"""Each requirement is traced to code, tests and pages, each test to a requirement, each part to
its failures; and what is named exists."""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import get_args

from chute_ros.campaign.judge import Count
from chute_ros.campaign.scenario import Failure, Fault
from safety_case.documents import Node, files_of, of_kind, parents_of
from safety_case.parts import ACTIONS, PARTS, without_section

#: How a part may fail, and how a control action may be unsafe.
MODES = ("late", "lost", "wrong", "twice", "restarted", "forged")
KINDS = ("not given", "given wrongly", "too early", "too late", "stopped too soon")

#: Who learns of a failure that stays before it does harm, the fewest first.
TOLD = ("NOBODY", "FLIGHT", "GROUND", "GROUND, FLIGHT")

#: Folders of the tests; and of the modules each of which, or whose folder, a requirement names.
TESTS = ("test/", "msg_defs/test/")
MODULES = (
    *("chute_ros/protocol", "chute_ros/supervisor", "chute_ros/runtime", "chute_ros/links"),
    *("chute_ros/ros", "chute_ros/transport"),
)

#: Rows of the campaign's page: what fails, what else goes wrong, what a flight is counted as.
ROWS = {*Failure.__members__, *(one.__name__ for one in get_args(Fault)), *Count.__members__}

_NAMED = re.compile(r"``([\w./-]+)(?:::(\w+))?``")


def problems(nodes: Sequence[Node], root: Path) -> list[str]:
    """What is not traced, each in a line; root: of the repository."""
    requirements = of_kind(nodes, "REQUIREMENT")
    failures, actions = of_kind(nodes, "FAILURE_MODE"), of_kind(nodes, "UNSAFE_ACTION")
    rows = [*failures, *actions]
    return [
        *(one for requirement in requirements for one in _of_requirement(requirement, root)),
        *_tests_of_nobody(requirements, root),
        *_modules_of_nobody(requirements, root),
        *_pages_of_nobody(requirements, root),
        *_incomplete(failures, PARTS, MODES, "failure"),
        *_incomplete(actions, ACTIONS, KINDS, "unsafe action"),
        *without_section(),
        *(one for row in failures for one in _of_failure(row)),
        *(one for row in rows for one in _without_parents(row)),
        *(one for row in [*rows, *of_kind(nodes, "CRITERION")] for one in _not_there(row, root)),
        *(one for row in [*requirements, *failures] for one in _campaign(row)),
        *(one for requirement in requirements for one in _without_row(requirement)),
    ]


def _of_requirement(node: Node, root: Path) -> Iterable[str]:
    files = files_of(node)
    if not any(one.startswith(TESTS) for one in files):
        yield f"{node['UID']} is an orphan: no test shows it; name one in its RELATIONS"
    if all(one.startswith(TESTS) for one in files):
        yield f"{node['UID']} is an orphan: no code fulfils it; name a file in its RELATIONS"
    for name in files:
        if not (root / name).is_file():
            yield f"{node['UID']}: there is no {name}"
    for page in _words(node, "PAGES"):
        if not (root / "docs" / page).is_file():
            yield f"{node['UID']}: there is no page docs/{page}"
    for folder in _words(node, "FOLDERS"):
        if not (root / folder).is_dir():
            yield f"{node['UID']}: there is no folder {folder}"


def _tests_of_nobody(requirements: Iterable[Node], root: Path) -> Iterable[str]:
    named = _files(requirements)
    for path in sorted(one for folder in TESTS for one in (root / folder).rglob("test_*.py")):
        if (name := path.relative_to(root).as_posix()) not in named:
            yield (
                f"{name} is an orphan: it shows no requirement; name it in the RELATIONS of one "
                "in safety_case/requirements.sdoc"
            )


def _modules_of_nobody(requirements: Iterable[Node], root: Path) -> Iterable[str]:
    named = _files(requirements)
    folders = {one for requirement in requirements for one in _words(requirement, "FOLDERS")}
    for path in sorted(one for folder in MODULES for one in (root / folder).rglob("*.py")):
        name, folder = (one.relative_to(root).as_posix() for one in (path, path.parent))
        if name not in named and folder not in folders and _has_code(path):
            yield (
                f"{name} is an orphan: no requirement names it; name it in the RELATIONS, or its "
                "folder in FOLDERS, of one in safety_case/requirements.sdoc"
            )


def _has_code(path: Path) -> bool:
    """More than the docstring of a package."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return path.name != "__init__.py" or len(tree.body) > 1


def _pages_of_nobody(requirements: Iterable[Node], root: Path) -> Iterable[str]:
    named = {one for requirement in requirements for one in _words(requirement, "PAGES")}
    for path in sorted((root / "docs").rglob("*.md")):
        # The index promises nothing itself.
        if (name := path.relative_to(root / "docs").as_posix()) not in {*named, "index.md"}:
            yield (
                f"docs/{name} is an orphan: it describes no requirement; name it in the PAGES of "
                "one in safety_case/requirements.sdoc"
            )


def _files(requirements: Iterable[Node]) -> set[str]:
    return {one for requirement in requirements for one in files_of(requirement)}


def _incomplete(
    rows: Iterable[Node], sections: Collection[str], words: Collection[str], what: str
) -> Iterable[str]:
    """In each of these sections a row of each word, and no other section."""
    titles: dict[str, list[str]] = {section: [] for section in sections}
    for row in rows:
        titles.setdefault(row["SECTION"], []).append(row["TITLE"])
    for section, has in titles.items():
        if section not in sections:
            yield f"{section}: no such section in safety_case/parts.py"
        for word in words:
            if has.count(word) != 1:
                yield f"{section}: {has.count(word)} rows for the {what} '{word}', need 1"
        for word in sorted({*has} - {*words}):
            yield f"{section}: the {what} '{word}' is none of {', '.join(words)}"


def _of_failure(row: Node) -> Iterable[str]:
    if ("NONE" in _words(row, "SINGLE")) == bool(row.get("STAYS")):
        yield f"{row['UID']}: STAYS says why a single failure stays; without one it is left out"
    if (row.get("TOLD") in TOLD) != bool(row.get("STAYS")):
        yield f"{row['UID']}: TOLD says who learns of what stays: {'; '.join(TOLD)}"


def _without_parents(row: Node) -> Iterable[str]:
    if not parents_of(row):
        yield f"{row['UID']}: no requirement answers it; name one in its RELATIONS"


def _not_there(row: Node, root: Path) -> Iterable[str]:
    """Each file and test that SHOWN_BY names exists."""
    text = row.get("SHOWN_BY", "")
    named = _NAMED.findall(text)
    for path, test in named:
        if not (root / path).is_file():
            yield f"{row['UID']}: there is no {path}"
        elif test and test not in _functions(root / path):
            yield f"{row['UID']}: {path} has no {test}"
    if len(named) != len(text.splitlines()) or (not named and row["_NODE_TYPE"] != "CRITERION"):
        yield f"{row['UID']}: SHOWN_BY is a list of ``path`` or ``path::test``"


@functools.cache
def _functions(path: Path) -> frozenset[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return frozenset(one.name for one in ast.walk(tree) if isinstance(one, ast.FunctionDef))


def _campaign(row: Node) -> Iterable[str]:
    if not row.get("CAMPAIGN", "").startswith("none:"):
        for name in _words(row, "CAMPAIGN"):
            if name not in ROWS:
                yield f"{row['UID']}: the campaign has no row {name}"


def _without_row(requirement: Node) -> Iterable[str]:
    if not requirement.get("CAMPAIGN", "").removeprefix("none:").strip():
        yield f"{requirement['UID']}: CAMPAIGN names rows of the campaign, or says 'none: why'"


def _words(node: Node, field: str) -> list[str]:
    return [one.strip() for one in node.get(field, "").split(",") if one.strip()]
