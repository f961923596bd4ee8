"""What every simulated device does on demand: actions by name, at set times, told in lines."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from chute_ros.errors import ChuteError

#: Name -> what it does; what follows "=" comes as the argument.
ActionTable = dict[str, Callable[[str], None]]


class NotNowError(ChuteError):
    """A device cannot do an action as it is now; the text says why and what would help."""


@dataclass(frozen=True)
class Argument:
    """What an action takes. convert: turns it from text, KeyError or ValueError if it is none;
    need: what it can be, in words."""

    convert: Callable[[str], Any]
    need: str


def one_of(choices: Mapping[str, Any]) -> Argument:
    """The name of one of them."""
    return Argument(choices.__getitem__, f"one of {', '.join(choices)}")


def number_of(unit: str, highest: float) -> Argument:
    """From 0 to highest."""

    def convert(text: str) -> float:
        if not 0.0 <= (value := float(text)) <= highest:
            raise ValueError(text)
        return value

    return Argument(convert, f"0 to {highest:g} {unit}")


class Actor:
    """Has actions and says what happens. name: before each line, empty: nothing."""

    def __init__(self, name: str = "") -> None:
        self.actions: ActionTable = {}
        #: Action -> what it takes; those that are not here take nothing.
        self.arguments: dict[str, Argument] = {}
        self._prefix = f"{name}: " if name else ""
        self._said: list[str] = []

    def act(self, action: str) -> str:
        """Do what --at says: "name" or "name=argument". Returns why it cannot be done now; empty:
        it is done."""
        name, _, argument = action.partition("=")
        self.say(f"action {action}")
        try:
            self.actions[name](argument)
        except NotNowError as error:
            self.say(f"{name} is not done: {error}")
            return str(error)
        return ""

    def add_action(self, name: str, function: Callable[[str], None]) -> None:
        """One more, of what is around the device."""
        self.actions[name] = function

    def say(self, text: str) -> None:
        """One line for whoever watches."""
        self._said.append(self._prefix + text)

    def take_events(self) -> list[str]:
        """The lines since the last call."""
        said, self._said = self._said, []
        return said


class Script:
    """The entries of --at: (s after the start, action). It starts as it is first asked what is
    due."""

    def __init__(self, entries: list[tuple[float, str]]) -> None:
        self._entries = sorted(entries)
        self._started = math.nan

    def take_due(self, now: float) -> list[str]:
        """The actions whose time has come; each is handed out once."""
        if math.isnan(self._started):
            self._started = now
        due = []
        while self._entries and self._entries[0][0] <= now - self._started:
            due.append(self._entries.pop(0)[1])
        return due

    def next_deadline(self) -> float:
        """When the next one is due; infinity: never."""
        if not self._entries:
            return math.inf
        return -math.inf if math.isnan(self._started) else self._entries[0][0] + self._started
