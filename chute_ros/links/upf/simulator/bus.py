"""Several simulated nodes behind one connection to a CAN bus; among themselves nothing is lost."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from chute_ros.links.upf.simulator.node import UpfNode
from chute_ros.sim.acting import Actor, Argument, Script


class UpfBus:
    """Runs its nodes as the loop of a wire wants it. script: (s after the start, action)."""

    def __init__(
        self, nodes: list[UpfNode], script: list[tuple[float, str]] | None = None
    ) -> None:
        self.nodes = nodes
        self._script = Script(script or [])
        #: Has the actions of what is around the nodes.
        self._around = Actor()
        self._is_started = False
        self._output: list[bytes] = []

    @property
    def actions(self) -> dict[str, Callable[[str], None]]:
        """Actions of all nodes by name, and those of what is around them."""
        return {name: action for one in self._actors for name, action in one.actions.items()}

    @property
    def arguments(self) -> dict[str, Argument]:
        """What their actions take."""
        return {name: what for node in self.nodes for name, what in node.arguments.items()}

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        for node in self.nodes:
            node.receive(data, now)

    def stream_ended(self, stream: Hashable) -> None:
        pass

    def update(self, now: float) -> None:
        if not self._is_started:
            self._is_started = True
            for node in self.nodes:
                node.start(now)
        for action in self._script.take_due(now):
            self.act(action)
        for node in self.nodes:
            node.update(now)
        self._exchange(now)

    def next_deadline(self) -> float:
        deadlines = (node.next_deadline() for node in self.nodes)
        return min([self._script.next_deadline(), *deadlines])

    def take_output(self) -> list[bytes]:
        output, self._output = self._output, []
        return output

    def take_events(self) -> list[str]:
        return [event for one in self._actors for event in one.take_events()]

    def act(self, action: str) -> str:
        """Have every node that knows the action do it. Returns why it cannot be done now."""
        name = action.partition("=")[0]
        reasons = [one.act(action) for one in self._actors if name in one.actions]
        return "; ".join(filter(None, reasons))

    def add_action(self, name: str, function: Callable[[str], None]) -> None:
        """One more, of what is around the nodes."""
        self._around.add_action(name, function)

    @property
    def _actors(self) -> list[Actor]:
        return [self._around, *self.nodes]

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
