"""Reads what a profile names: links, words of an enumeration."""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from typing import TypeVar

from chute_ros.supervisor.measurements import STANDARD_LIMITS, Limits
from chute_ros.supervisor.yaml_lines import LineReader, Where

#: Instead of a link's name: it is enough if one is so, or all must be.
ANY, ALL = "any", "all"
_Kind = TypeVar("_Kind", bound=enum.Enum)


class ProfileLines(LineReader):
    """links: the names of those that are followed."""

    def __init__(self, name: str, links: Sequence[str]) -> None:
        super().__init__(name)
        self._links = links
        #: Of the measurements of this profile.
        self.limits: Mapping[str, Limits] = STANDARD_LIMITS

    def link(self, where: Where, what: str, besides: tuple[str, ...]) -> str:
        """The name of a link that the supervisor follows."""
        return self.choice(where, what, (*besides, *self._links))

    def member(self, where: Where, what: str, kind: type[_Kind]) -> _Kind:
        """The member of an enumeration whose value is written."""
        return kind(self.choice(where, what, [one.value for one in kind]))
