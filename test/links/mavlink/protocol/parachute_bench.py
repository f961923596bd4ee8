"""A parachute that sends a heartbeat and then statuses, over the wire's bytes."""

from link_bench import heartbeat, status

from chute_ros.links.mavlink.protocol.parachute import ParachuteTracker, StatusLimits
from chute_ros.model import ErrorFlags
from chute_ros.protocol.liveness import LivenessLimits
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder


class Told:
    """One parachute's story."""

    def __init__(self, ignored=0):
        limits = StatusLimits(3.5, ErrorFlags(ignored))
        self.tracker = ParachuteTracker(1, 161, LivenessLimits(2.5, 5.0), limits)
        self._encoder, self._decoder = FrameEncoder(1, 161), FrameDecoder()

    def heartbeat(self, now=0.0, **fields):
        self.tracker.heartbeat(self._over_the_wire(heartbeat(**fields)), now)
        return self

    def status(self, now=0.0, **fields):
        self.tracker.parachute_status(self._over_the_wire(status(**fields)), now)
        return self

    def at(self, now):
        self.tracker.update(now)
        return self.tracker.status(now)

    def _over_the_wire(self, message):
        (frame,) = self._decoder.feed_datagram(self._encoder.encode(message, 0.0), 0.0)
        return frame.message


def picture(**fields):
    """After one healthy heartbeat and one status."""
    return Told().heartbeat().status(**fields).at(0.0)
