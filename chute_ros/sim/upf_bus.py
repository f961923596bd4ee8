"""Several simulated nodes behind one connection to a CAN bus; among themselves nothing is lost."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

from chute_ros.sim.upf_node import UpfNode


class UpfBus:
    """Runs its nodes as the loop of a wire wants it. script: (s after the start, action)."""

    def __init__(
        self, nodes: list[UpfNode], script: list[tuple[float, str]] | None = None
    ) -> None:
        self.nodes = nodes
        self._script = sorted(script or [])
        self._started = float("nan")
        self._output: list[bytes] = []
        self._events: list[str] = []

    @property
    def actions(self) -> dict[str, Callable[[str], None]]:
        """Actions of all nodes by name."""
        return {name: action for node in self.nodes for name, action in node.actions.items()}

    @property
    def arguments(self) -> dict[str, Callable[[str], Any]]:
        """What turns the arguments of their actions from text."""
        return {name: turn for node in self.nodes for name, turn in node.arguments.items()}

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        for node in self.nodes:
            node.receive(data, now)

    def stream_ended(self, stream: Hashable) -> None:
        pass

    def update(self, now: float) -> None:
        if self._started != self._started:
            self._started = now
            for node in self.nodes:
                node.start(now)
        while self._script and self._script[0][0] <= now - self._started:
            self.act(self._script.pop(0)[1])
        for node in self.nodes:
            node.update(now)
        self._exchange(now)

    def next_deadline(self) -> float:
        script = [self._script[0][0] + self._started] if self._script else []
        return min([*script, *(node.next_deadline() for node in self.nodes)])

    def take_output(self) -> list[bytes]:
        output, self._output = self._output, []
        return output

    def take_events(self) -> list[str]:
        events, self._events = self._events, []
        for node in self.nodes:
            events += node.take_events()
        return events

    def act(self, action: str) -> None:
        """Have every node that knows the action do it."""
        name = action.partition("=")[0]
        for node in self.nodes:
            if name in node.actions:
                node.act(action)

    def _exchange(self, now: float) -> None:
        """Each node hears the others on this side of the connection, until all is said."""
        said = True
        while said:
            said = False
            for node in self.nodes:
                for frame in node.take_output():
                    said = True
                    self._output.append(frame)
                    for other in self.nodes:
                        if other is not node:
                            other.receive(frame, now)
            for node in self.nodes:
                if said:
                    node.update(now)
