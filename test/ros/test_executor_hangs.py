"""A node whose executor hangs falls silent towards its devices: nobody watches over them."""

import threading
import time

from mavlink_bench import Autopilot, Network

#: Between two MAVLink heartbeats of the node, and until it notices that its executor hangs, s.
_BEAT, _NOTICED = 1.0, 1.0


class Listener(Autopilot):
    """Remembers when the node's heartbeats came."""

    def __init__(self):
        super().__init__()
        self.beats = []

    def heard(self, frame):
        if frame.message.get_type() == "HEARTBEAT" and frame.component_id == 191:
            self.beats.append(time.monotonic())
        super().heard(frame)


def test_its_heartbeat_ends_a_second_after_its_executor_does_and_comes_back_with_it(bench):
    listener, network = Listener(), Network(bench)
    network.plug(listener)
    bench.until(lambda: len(listener.beats) > 1, "the node's heartbeat is heard")
    # Its link goes on meanwhile, in its own thread.
    hung_at, goes_on = time.monotonic(), threading.Event()
    goes_on.wait(_NOTICED + 2.5 * _BEAT)
    last = max(listener.beats) - hung_at
    assert last <= _NOTICED + 0.2, "nobody is there, and it says so"
    heard = len(listener.beats)
    bench.until(lambda: len(listener.beats) > heard, "it is there again")
