"""What ends a command, besides its result."""

from __future__ import annotations

from collections.abc import Mapping

from chute_ros.errors import ChuteError


class MistakeError(ChuteError, ValueError):
    """The user's mistake: exit code 2, and nothing was sent."""


class CommandError(ChuteError):
    """The command cannot be completed: exit code 1. details: for --json, beside the text."""

    def __init__(self, text: str, details: Mapping[str, object] | None = None) -> None:
        super().__init__(text)
        self.details = dict(details or {})
