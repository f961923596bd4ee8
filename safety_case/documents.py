"""The documents of this folder, as StrictDoc reads them; and documents in its form."""

from __future__ import annotations

import json
import os
import re
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "safety_case"
#: What is made new each time, beside what people write.
_MADE = "made_{}.sdoc"
#: Where StrictDoc looks for the pictures of documents; all of them are made.
PICTURES = FOLDER / "_assets"
TOOLS = ROOT / ".venv-case" / "bin"

Node = Mapping[str, Any]

_HEAD = """[DOCUMENT]
TITLE: {title}
UID: {uid}
VERSION: @GIT_VERSION
DATE: @GIT_COMMIT_DATETIME
OPTIONS:
  MARKUP: {markup}
  NODE_IN_TOC: False

[GRAMMAR]
IMPORT_FROM_FILE: case.sgra
"""


class NotReadError(Exception):
    """StrictDoc refuses the documents; the text says why."""


def strictdoc(*arguments: str) -> None:
    """Run StrictDoc on this folder. NotReadError: it refuses, or is not installed."""
    command = [str(TOOLS / "strictdoc"), "export", str(FOLDER), *arguments]
    # StrictDoc calls its printing command by name.
    environment = {**os.environ, "PATH": f"{TOOLS}{os.pathsep}{os.environ['PATH']}"}
    try:
        ended = subprocess.run(
            command, env=environment, cwd=ROOT, capture_output=True, text=True, check=False
        )
    except FileNotFoundError:
        raise NotReadError(
            f"there is no {command[0]}: run `make case`, which sets it up"
        ) from None
    if ended.returncode:
        lines = (ended.stdout + ended.stderr).splitlines()
        told = [one for one in lines if one.startswith("error: ")] or lines[-12:]
        raise NotReadError("\n".join(told))


def read() -> list[Node]:
    """Each node, with the TITLE of the section that it stands in as SECTION."""
    with tempfile.TemporaryDirectory() as out:
        # Without a look into the source files, which takes longest.
        strictdoc("--formats=json", f"--output-dir={out}", f"--config={FOLDER / 'read.toml'}")
        found = json.loads((Path(out) / "json" / "index.json").read_text(encoding="utf-8"))
    return [node for document in found["DOCUMENTS"] for node in _nodes(document, "")]


def _nodes(parent: Node, section: str) -> Iterator[Node]:
    for node in parent.get("NODES", ()):
        yield {**node, "SECTION": section}
        yield from _nodes(node, str(node.get("TITLE", "")))


def of_kind(nodes: Iterable[Node], kind: str) -> list[Node]:
    """Those of this kind."""
    return [one for one in nodes if one["_NODE_TYPE"] == kind]


def files_of(node: Node) -> list[str]:
    """The files that it names by a relation."""
    return [one["VALUE"] for one in node.get("RELATIONS", ()) if one["TYPE"] == "File"]


def parents_of(node: Node) -> list[str]:
    """The UIDs that it names by a relation."""
    return [one["VALUE"] for one in node.get("RELATIONS", ()) if one["TYPE"] == "Parent"]


def write_made(
    uid: str, title: str, parts: Iterable[tuple[str, str]], markup: str = "RST"
) -> None:
    """A document of sections (title, text); an empty title: text before the first section."""
    blocks = [_HEAD.format(title=title, uid=uid.upper(), markup=markup)]
    for name, text in parts:
        block = f"[TEXT]\nSTATEMENT: >>>\n{text.strip()}\n<<<\n"
        if name:
            block = f"[[SECTION]]\nTITLE: {name}\n\n{block}\n[[/SECTION]]\n"
        blocks.append(block)
    (FOLDER / _MADE.format(uid)).write_text("\n".join(blocks), encoding="utf-8")


def plain(text: str) -> str:
    """As it stands, in reStructuredText."""
    return re.sub(r"([*`|_\\])", r"\\\1", text)


def remove_made() -> None:
    """Of this time, or left by another one."""
    for path in (*FOLDER.glob(_MADE.format("*")), *PICTURES.glob("*")):
        path.unlink()
    if PICTURES.exists():
        PICTURES.rmdir()


def list_table(head: Sequence[str], rows: Iterable[Sequence[str]], widths: Sequence[int]) -> str:
    """A table in reStructuredText; a cell may have line ends."""
    lines = [
        ".. list-table::",
        "   :header-rows: 1",
        f"   :widths: {' '.join(map(str, widths))}",
        "",
    ]
    for row in [head, *rows]:
        for number, cell in enumerate(row):
            first, *more = cell.splitlines() or [""]
            lines.append(f"   {'* -' if number == 0 else '  -'} {first}")
            lines += [f"       {one}" if one else "" for one in more]
    return "\n".join(lines)
