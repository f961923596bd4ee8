"""Values of a profile's YAML with their lines, and what is wrong with them in words."""

from __future__ import annotations

import difflib
import enum
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

import yaml

from chute_ros.errors import ProfileError
from chute_ros.plain_yaml import misread
from chute_ros.supervisor.measurements import STANDARD_LIMITS, Limits

#: Instead of a link's name: it is enough if one is so, or all must be.
ANY, ALL = "any", "all"
_Kind = TypeVar("_Kind", bound=enum.Enum)


class Where:
    """A value of the file with its line, and its children alike."""

    def __init__(self, node: yaml.Node | None, value: Any, line: int) -> None:
        self.node, self.value, self.line = node, value, line

    @property
    def is_mapping(self) -> bool:
        """Has it `key: value` lines?"""
        return isinstance(self.node, yaml.MappingNode)


class ProfileLines:
    """Reads values that must be of some kind; collects the mistakes, so that all are told at once.
    name: of the file; links: the names of those that are followed."""

    def __init__(self, name: str, links: Sequence[str]) -> None:
        self.name, self._links = name, links
        self.mistakes: list[str] = []
        #: Of the measurements of this profile.
        self.limits: Mapping[str, Limits] = STANDARD_LIMITS

    def wrong(self, line: int, text: str) -> None:
        """One more mistake."""
        self.mistakes.append(f"{self.name}, line {line}: {text}")

    def mapping(self, where: Where, allowed: Iterable[str], what: str) -> dict[str, Where]:
        """The entries of a mapping; an unknown key is a mistake."""
        if not isinstance(where.node, yaml.MappingNode):
            self.wrong(where.line, f"{what} is {where.value!r}: need `key: value` lines")
            return {}
        entries: dict[str, Where] = {}
        allowed = tuple(allowed)
        for key_node, node in where.node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, yaml.ScalarNode):
                # Its text could be as long as its aliases make it.
                self.wrong(line, f"a key of {what} is no word: need `key: value` lines")
                continue
            key = str(key_node.value)
            if allowed and key not in allowed:
                near = difflib.get_close_matches(key, allowed)
                fix = f"did you mean {near[0]}? " if near else ""
                self.wrong(line, f"{what} has no {key!r}: {fix}it may have {', '.join(allowed)}")
            elif key in entries:
                self.wrong(line, f"{key!r} is there twice: remove one")
            else:
                # The line of the key: a mapping begins only on the line after it.
                entries[key] = Where(node, where_of(node).value, line)
        return entries

    def truth(self, where: Where, what: str) -> bool:
        """True or false."""
        if problem := misread(where.node):
            self.wrong(where.line, f"{what} is {problem}")
        elif not isinstance(where.value, bool):
            self.wrong(where.line, f"{what} is {where.value!r}: need true or false")
        return where.value is True

    def number(
        self, where: Where, what: str, least: float = -math.inf, most: float = math.inf
    ) -> float:
        """A finite number in a range, written as everybody reads it."""
        value = where.value
        if problem := misread(where.node):
            self.wrong(where.line, f"{what} is {problem}")
        elif isinstance(value, bool) or not isinstance(value, (int, float)):
            self.wrong(where.line, f"{what} is {value!r}: need a number")
        elif math.isinf(least) and not math.isfinite(value):
            self.wrong(where.line, f"{what} is {value}: need a finite number")
        elif not least <= value <= most:  # NaN as well
            self.wrong(where.line, f"{what} is {value}: need {least:g} to {most:g}")
        else:
            return float(value)
        return math.nan

    def choice(self, where: Where, what: str, choices: Iterable[str]) -> str:
        """One word of several."""
        choices = tuple(choices)
        if where.value in choices:
            return str(where.value)
        near = difflib.get_close_matches(str(where.value), choices)
        fix = f" (did you mean {near[0]}?)" if near else ""
        self.wrong(where.line, f"{what} is {where.value!r}: need {' or '.join(choices)}{fix}")
        return choices[0]

    def link(self, where: Where, what: str, besides: tuple[str, ...]) -> str:
        """The name of a link that the supervisor follows."""
        return self.choice(where, what, (*besides, *self._links))

    def member(self, where: Where, what: str, kind: type[_Kind]) -> _Kind:
        """The member of an enumeration whose value is written."""
        return kind(self.choice(where, what, [one.value for one in kind]))

    def text(self, where: Where, what: str) -> str:
        """Words."""
        said = isinstance(where.node, yaml.ScalarNode) and isinstance(where.value, str)
        words = where.value.split() if said else []
        if not words:
            self.wrong(where.line, f"{what} is {where.value!r}: need words")
        return " ".join(words)

    def many(self, where: Where, what: str) -> list[Where]:
        """The entries of a list; one alone may stand without brackets."""
        if isinstance(where.node, yaml.SequenceNode):
            if not where.node.value:
                self.wrong(where.line, f"{what} is empty: need at least one")
            return [where_of(node) for node in where.node.value]
        return [where]


def compose(text: str, name: str) -> Where:
    """The root of a YAML text; ProfileError if it is none. name: of the file."""
    try:
        return where_of(yaml.compose(text, Loader=yaml.SafeLoader))
    except RecursionError:
        raise ProfileError(f"{name}, line 1: not YAML: it is nested too deep") from None
    except (yaml.YAMLError, ValueError) as error:  # most say where, and what in short
        mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", error)
        line = 1 if mark is None else mark.line + 1
        raise ProfileError(f"{name}, line {line}: not YAML: {problem}") from None


def where_of(node: yaml.Node | None) -> Where:
    """A node of the file."""
    if node is None:
        return Where(None, None, 1)
    value = "a list" if isinstance(node, yaml.SequenceNode) else "a mapping"
    if isinstance(node, yaml.ScalarNode):
        try:
            if node.style is None:
                value = yaml.constructor.SafeConstructor().construct_object(node)
            else:
                value = node.value
        except (yaml.YAMLError, ValueError):  # as of 2024-13-45, a date that is none
            value = node.value
        if isinstance(value, int) and abs(value) > sys.float_info.max:
            value = node.value  # no number that could be reckoned with
    return Where(node, value, node.start_mark.line + 1)
