"""A node of the test's own on the bus, for the tests of upf_can."""

import math
from typing import Any

from chute_ros.protocol.dronecan.endpoint import Endpoint, ReceivedTransfer


class Party:
    """A node of the test's own: it remembers what it hears, and says what it is told to."""

    def __init__(self, definitions, node_id):
        self.endpoint = Endpoint(definitions.types, node_id)
        self.heard: list[ReceivedTransfer] = []
        #: Sixteen bytes of each frame that came.
        self.frames: list[bytes] = []
        self.loop: Any = None

    def newest(self, name):
        """The newest of this type; None: none came."""
        return next((one for one in reversed(self.heard) if one.name == name), None)

    def values(self, name):
        """Fields of all of this type."""
        return [one.values for one in self.heard if one.name == name]

    def say(self, name, **values):
        """Broadcast."""
        self.loop.call(lambda link, now: link.endpoint.broadcast(name, values))

    def ask(self, server, service, number, **values):
        """Request, with number as its transfer id."""
        self.loop.call(
            lambda link, now: link.endpoint.request(server, service, number, values, 16)
        )

    def put(self, *frames):
        """Send frames as they are."""
        self.loop.call(lambda link, now: link.raw.extend(frames))

    # -- as the loop wants it ---------------------------------------------------------------------

    @property
    def raw(self):
        """What is sent next."""
        return self.endpoint._output

    def receive(self, data, now, stream=None):
        self.frames.append(data)
        heard = self.endpoint.receive(data, now)
        if heard is not None:
            self.heard.append(heard)

    def stream_ended(self, stream):
        pass

    def update(self, now):
        pass

    def next_deadline(self):
        return math.inf

    def take_output(self):
        return self.endpoint.take_output()

    def take_events(self):
        return []
