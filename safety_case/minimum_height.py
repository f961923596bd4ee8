"""The page of the minimum height, as docs/evidence/minimum_height.md has it."""

from __future__ import annotations

import re
import shutil

from safety_case.documents import PICTURES, ROOT, write_made
from safety_case.evidence import age

_PAGE = ROOT / "docs" / "evidence" / "minimum_height.md"
_PICTURE = re.compile(r"\]\(([\w.]+\.svg)\)")
#: A link to another page of docs leads nowhere here.
_LINK = re.compile(r"\[([^\]]+)\]\((?!http|_assets)[^)]+\)")


def write() -> None:
    """With its pictures."""
    text = _PAGE.read_text(encoding="utf-8")
    PICTURES.mkdir(exist_ok=True)
    for name in _PICTURE.findall(text):
        shutil.copy(_PAGE.parent / name, PICTURES / name)
    text = _LINK.sub(r"\1", _PICTURE.sub(r"](_assets/\1)", text))
    before, *sections = text.split("\n## ")
    title, _, introduction = before.removeprefix("# ").partition("\n")
    parts = [
        ("", f"{introduction}\n\n{age(_PAGE.name)}"),
        *(_titled(section) for section in sections),
    ]
    write_made("minimum_height", title, parts, markup="Markdown")


def _titled(section: str) -> tuple[str, str]:
    title, _, text = section.partition("\n")
    return title, text
