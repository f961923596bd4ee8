"""The two ends that are timed: the device's end of a serial cable, and a subscriber in ROS.

Both are in the measuring process; what is between them, one process, is measured.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from chute_msgs.msg import Telem
from rclpy.serialization import deserialize_message

from bench.flight_lines import FlightLines
from bench.process_cost import cpu_time
from bench.ros_thread import RosThread
from chute_ros.errors import ChuteError
from chute_ros.ros import qos
from chute_ros.sim.pty_wire import PtyWire

#: A line that was not received so long after it was written is late, s.
LATE = 0.5
#: While nothing is measured, lines are written at this rate, 1/s.
_IDLE_RATE = 40.0
#: What a writer must reach of a rate, to have tried it.
_PACE = 0.97


class NoTelemetryError(ChuteError):
    """A peer does not publish."""


@dataclass(frozen=True)
class Step:
    """Lines written at one rate. delays: ms from writing to the subscriber's callback, of those
    that came; cpu: share of one core that the process took."""

    rate: float
    written: int
    delays: list[float]
    cpu: float
    kept_pace: bool = True

    @property
    def lost(self) -> int:
        """Lines that did not come, or late."""
        return self.written - sum(delay <= LATE * 1e3 for delay in self.delays)

    @property
    def is_kept(self) -> bool:
        """The rate was written, and all of it came."""
        return self.kept_pace and not self.lost


class Subscriber(RosThread):
    """A node with a thread: what comes, as it comes, is put down with its time."""

    def __init__(self) -> None:
        super().__init__("bench_subscriber")

    def follow(self, topic: str) -> list[tuple[int, bytes]]:
        """(perf_counter_ns, message) of all that comes there. All before start."""
        came: list[tuple[int, bytes]] = []

        def callback(message: bytes) -> None:
            came.append((time.perf_counter_ns(), message))

        # Not taken apart yet: that would take as long as what is measured.
        self.node.create_subscription(Telem, topic, callback, qos.STATUS, raw=True)
        return came


@dataclass
class Ends:
    """Both ends around one peer. came: its list from the subscriber."""

    name: str
    lines: FlightLines
    came: list[tuple[int, bytes]]
    wire: PtyWire = field(default_factory=PtyWire)
    #: The process between the ends, once it runs.
    pid: int = 0
    _clock: int = 0
    _started: float = field(default_factory=time.monotonic)

    def flow(self, timeout: float) -> None:
        """Write lines until one comes at once: nothing from before is under way any more."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            self.came.clear()
            self._write()
            time.sleep(1.0 / _IDLE_RATE)
            if self._clock in self._arrivals():
                return
        raise NoTelemetryError(f"{self.name}: no telemetry within {timeout:g} s")

    def step(self, rate: float, seconds: float) -> Step:
        """Write lines at this rate for so long, and see which come."""
        count = max(1, round(rate * seconds))
        self.came.clear()
        written: dict[int, int] = {}
        before, start = cpu_time(self.pid), time.monotonic()
        for number in range(count):
            while (left := start + number / rate - time.monotonic()) > 0.0:
                time.sleep(left)
            at, is_first = self._write()
            # A flight that begins anew is a restart of the flight computer, and text without a
            # checksum: a node may wait with it for the next line, and that is no loss.
            if not is_first:
                written[self._clock] = at
        took = time.monotonic() - start
        end = start + took + LATE
        while not self._has_last() and time.monotonic() < end:
            time.sleep(0.002)
        cpu = (cpu_time(self.pid) - before) / (time.monotonic() - start)
        arrivals = self._arrivals()
        delays = [(arrivals[c] - at) / 1e6 for c, at in written.items() if c in arrivals]
        return Step(rate, len(written), delays, cpu, (count - 1) / took >= _PACE * rate)

    def messages(self) -> list[Telem]:
        """What came in the last step."""
        return [deserialize_message(message, Telem) for _, message in self.came]

    def _write(self) -> tuple[int, bool]:
        """Write a line, its clock is the newest: (perf_counter_ns before, first of a flight)."""
        for file in self.wire.files():
            self.wire.read(file)  # the node's own heartbeat
        # The device's clock is no two lines' the same, whatever the rate.
        elapsed = int((time.monotonic() - self._started) * 1000.0)
        self._clock = max(self._clock + 1, elapsed)
        line, is_first = self.lines.next(self._clock)
        at = time.perf_counter_ns()
        try:
            self.wire.write(line)
        except BlockingIOError:
            pass  # it did not fit, as in a device whose host does not read: it will be missed
        return at, is_first

    def _has_last(self) -> bool:
        return bool(self.came) and self._clock in self._clocks(self.came[-1:])

    def _arrivals(self) -> dict[int, int]:
        """The device's clock in each message that came -> perf_counter_ns."""
        return self._clocks(self.came)

    @staticmethod
    def _clocks(came: list[tuple[int, bytes]]) -> dict[int, int]:
        taken = [(at, deserialize_message(message, Telem)) for at, message in came]
        return {round(message.device_uptime * 1000.0): at for at, message in taken}
