"""The shell of a runtime in tests."""

from collections.abc import Callable
from typing import Any

from chute_ros.protocol.events import Notice


class Shell:
    """Carries out everything at once, and notes it. The test sets now."""

    def __init__(self) -> None:
        self.now = 100.0
        self.link: Any = None
        self.published: list[Any] = []
        self.logged: list[Notice] = []
        self.take: Callable[[Any, float], None] = lambda event, now: None

    def in_link(self, function: Callable[[Any, float], None]) -> None:
        function(self.link, self.now)

    at_turns_end = in_link

    def deliver(self, events: list[Any]) -> None:
        for event in events:
            self.take(event, self.now)

    def publish(self, message: Any) -> int:
        self.published.append(message)
        return round(self.now * 1e9)

    def log(self, notice: Notice) -> None:
        self.logged.append(notice)

    def behind(self) -> float:
        return 0.0
