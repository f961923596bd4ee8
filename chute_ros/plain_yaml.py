"""YAML whose numbers and truths are what they look like.

YAML 1.1 reads `010` as 8, `1:30` as 90, `1_000` as 1000, `yes` as true and `.5e3` as text; other
readers of YAML take the same for something else. Where a file decides when a parachute opens, such
a value is refused.
"""

from __future__ import annotations

import re
from typing import Any

import yaml

#: A number as everybody reads it. An exponent has its sign: without one YAML 1.1 has text there.
_PLAIN = re.compile(r"[-+]?(?:(?:0|[1-9][0-9]*)(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+][0-9]+)?")
#: These look like nothing else.
_NOT_FINITE = re.compile(r"[-+]?\.inf|\.nan", re.IGNORECASE)
#: Text to YAML 1.1 and a number to others: `1e3`, `08`, `0o17`.
_LIKE_A_NUMBER = re.compile(
    r"[-+]?(?:0[oO][0-7]+|(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)"
)
_TRUTHS = ("true", "false")


def misread(node: yaml.Node | None) -> str:
    """What is wrong with a value that YAML reads as another than it looks like, and the fix, in
    words that go on "it is"; empty: nothing is."""
    if not isinstance(node, yaml.ScalarNode) or node.style is not None:
        return ""
    text, kind = node.value, node.tag.rpartition(":")[2]
    shown = text if len(text) <= 30 else f"{text[:27]}..."
    if kind == "bool" and text.lower() not in _TRUTHS:
        meant = "true" if yaml.safe_load(text) else "false"
        return f"{shown}, which YAML reads as {meant}: write {meant}, or '{shown}' if it is a word"
    if kind in ("int", "float") and not (_PLAIN.fullmatch(text) or _NOT_FINITE.fullmatch(text)):
        try:
            meant = f"{yaml.safe_load(text):.10g}"
        except (ValueError, OverflowError):
            return f"{shown}, which no number is: need a number"
        return f"{shown}, which YAML reads as {meant}: write {meant}, if that is meant"
    if kind == "str" and _LIKE_A_NUMBER.fullmatch(text):
        return f"{shown}, which YAML reads as text: need a number in plain digits, as 12.5"
    return ""


def load(text: str) -> Any:
    """The value of a YAML text; yaml.YAMLError with the line if it has one that is misread."""
    return yaml.load(text, Loader=_Loader)


class _Loader(yaml.SafeLoader):
    """Refuses what is misread."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        if problem := misread(node):
            mark = node.start_mark
            raise yaml.constructor.ConstructorError(None, None, f"it is {problem}", mark)
        return super().construct_object(node, deep)
