"""The node relay and a simulated relay board on a real pty."""

from typing import Any

from simulated_device import SimulatedDevice

from chute_ros.links.relay.node import RelayNode
from chute_ros.links.relay.simulator.relay_board import RelayBoard
from chute_ros.sim.pty_wire import PtyWire
from chute_ros.transport.loop import WireLoop


class CountingBoard(RelayBoard):
    """Counts the pulses that it is ordered, whatever becomes of them."""

    pulses = 0

    def receive(self, data, now, stream=None):
        before, orders = self.closed, self.orders
        super().receive(data, now, stream)
        self.pulses += self.orders > orders and not before


class Board(SimulatedDevice):
    """The node, and a board that can be plugged into its port and pulled out."""

    def __init__(self, bench, **parameters):
        self.bench = bench
        self.path = bench.folder / "ttyRELAY"
        self.board = CountingBoard()
        self.loop: WireLoop[Any] | None = None
        connection = f"serial:{self.path}:9600"
        self.node = bench.add(RelayNode, **{"connection": connection, **parameters})

    def plug_in(self):
        self.loop = self.bench.simulate_on(PtyWire(str(self.path)), self.board)

    def pull_out(self):
        """It is gone from the port."""
        assert self.loop is not None
        self.bench.unplug(self.loop)

    def commands_to_deploy(self):
        return self.board.pulses

    @property
    def deployed(self):
        return self.board.fired

    # What a board that says nothing cannot do.

    def fall_silent(self):
        raise NotImplementedError

    speak_again = stop_answering = come_to_ground = be_stuck = fall_silent

    def break_down(self):
        raise NotImplementedError
