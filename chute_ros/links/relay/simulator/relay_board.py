"""A simulated relay board: the bytes of an LCUS-1 switch its channel, and it says nothing."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from chute_ros.links.relay.protocol.link import RelayConfig
from chute_ros.sim.acting import Actor, Script


class RelayBoard(Actor):
    """on_fire: called when the channel closes for the first time. Actions: stuck, free, reboot,
    repack."""

    def __init__(
        self,
        script: list[tuple[float, str]] | None = None,
        on_fire: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__()
        self.closed = self.fired = False
        #: Whole orders to close that came.
        self.orders = 0
        self._on_fire = on_fire
        self._stuck = False
        self._heard = b""
        self._script = Script(script or [])
        self._bytes = RelayConfig()
        self.actions = {
            "stuck": lambda _: self._hold(True),
            "free": lambda _: self._hold(False),
            "reboot": lambda _: self.reboot(),
            "repack": lambda _: self._repack(),
        }

    def _hold(self, stuck: bool) -> None:
        self._stuck = stuck

    def _repack(self) -> None:
        self._stuck = self.fired = False
        self.reboot()

    def reboot(self) -> None:
        """Its power was gone: the channel is open."""
        self.closed, self._heard = False, b""

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        self._heard += data
        length = len(self._bytes.fire)
        while len(self._heard) >= length:
            order = self._heard[:length]
            if order not in (self._bytes.fire, self._bytes.rest):
                self._heard = self._heard[1:]  # noise: the next byte may begin an order
                continue
            self._heard = self._heard[length:]
            self._switch(order == self._bytes.fire)

    def stream_ended(self, stream: Hashable) -> None:
        pass

    def update(self, now: float) -> None:
        for action in self._script.take_due(now):
            self.act(action)

    def next_deadline(self) -> float:
        return self._script.next_deadline()

    def take_output(self) -> list[bytes]:
        return []

    def _switch(self, close: bool) -> None:
        self.orders += close
        if self._stuck or close == self.closed:
            return
        self.closed = close
        self.say("channel 1 closes" if close else "channel 1 opens")
        if close and not self.fired:
            self.fired = True
            self._on_fire()
