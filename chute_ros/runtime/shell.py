"""Shell that carries out the effects of a device node's runtime: a ROS node, or the campaign's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from chute_ros.protocol.events import Notice


class Shell(Protocol):
    """Two turns: the link's, in which the link is called and nothing else, and the owner's, in
    which everything comes that is not of the wire."""

    def in_link(self, function: Callable[[Any, float], None]) -> None:
        """Have function(link, now) called in the link's turn, soon, in order."""

    def at_turns_end(self, function: Callable[[Any, float], None]) -> None:
        """The same after a turn in which the link did all that it had to do."""

    def deliver(self, events: list[Any]) -> None:
        """In the link's turn: have the runtime take these in the owner's."""

    def publish(self, message: Any) -> int:
        """Give message to who follows its type: a topic (chute_ros.runtime.topics, the inputs of
        the core), a file, a log. Returns its stamp, ns of the wall clock."""

    def log(self, notice: Notice) -> None:
        """A line for a person."""

    def behind(self) -> float:
        """For how long what came may have waited, s: the processor is short."""
