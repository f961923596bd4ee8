"""YAML whose numbers and truths are what they look like.

YAML 1.1 reads `010` as 8, `1:30` as 90, `1_000` as 1000, `yes` as true and `.5e3` as text; other
readers of YAML take the same for something else. Where a file decides when a parachute opens, such
a value is refused.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
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
    """The value of a YAML text; yaml.YAMLError with the line if it has one that is misread, or a
    name twice."""
    return yaml.load(text, Loader=_Loader)


def load_marked(text: str) -> Any:
    """The same, where a Misread stands for each of these: of a file that many share each refuses
    what is its own."""
    return yaml.load(text, Loader=_Marking)


@dataclass(frozen=True)
class Misread:
    """problem: in words that go on "it is"; line: from 1."""

    problem: str
    line: int


class _Loader(yaml.SafeLoader):
    """Refuses what is misread, and what a later one of the same name would replace."""

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        if problem := misread(node):
            return self.found(problem, node)
        return super().construct_object(node, deep)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        # Merged names stand before those that replace them, on purpose.
        own = [key.value for key, _ in node.value if key.tag != "tag:yaml.org,2002:merge"]
        content = super().construct_mapping(node, deep)
        for key in node.value[-len(own) :] if own else ():
            if own.count(key[0].value) > 1 and isinstance(key[0], yaml.ScalarNode):
                content[key[0].value] = self.found("there twice: leave one of them", key[0])
        return content

    def found(self, problem: str, node: yaml.Node) -> Any:
        """What stands for it."""
        mark = node.start_mark
        raise yaml.constructor.ConstructorError(None, None, f"it is {problem}", mark)


class _Marking(_Loader):
    """Has a Misread in its place."""

    def found(self, problem: str, node: yaml.Node) -> Any:
        return Misread(problem, node.start_mark.line + 1)
