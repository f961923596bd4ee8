"""What ROS does between processes: topics, queues, and clocks that stamp."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from chute_ros.campaign.channel import Channel, Delivery, Way
from chute_ros.campaign.sensor_messages import Imu, Odometry
from chute_ros.campaign.world import World
from chute_ros.model import Decision
from chute_ros.runtime.topics import ActionTold, DeviceBeat
from chute_ros.supervisor.decision_gate import in_order

#: From a publisher to a subscription on one host, s.
_DELIVERY = Delivery(0.0005, in_order=True)
#: What a queue keeps of what nobody reads, one of decisions (ros/qos.py), and one of sensors.
_QUEUE, _DECISIONS, _SENSORS = 10, 50, 5

#: Types whose ways draw their chances under another name: flights are stored by their seeds.
_DRAWN_AS = {DeviceBeat: "LinkHeartbeat", ActionTold: "ActionReport"}

#: Gets a message, the wall clock here less its stamp (s), and the time.
Take = Callable[[Any, float, float], None]


class Process:
    """One process on its host."""

    def __init__(self, name: str) -> None:
        self.name = name
        #: What leaves it, and what enters it, over ROS.
        self.outward: Way = []
        self.inward: Way = []
        #: Its wall clock less the true time, s.
        self.clock = 0.0
        #: It does not run until then, virtual s.
        self.stopped_until = 0.0
        #: Since when it reads, virtual s.
        self._started = -math.inf
        self._queues: dict[Any, deque[tuple[Any, int, Take]]] = {}

    def wall(self, now: float) -> int:
        """What its wall clock says, ns."""
        return round((now + self.clock) * 1e9)

    def runs(self, now: float) -> bool:
        """It neither hangs nor is dead."""
        return now >= self.stopped_until

    def hang(self, world: World, until: float) -> None:
        """Do nothing until then, and read then what the queues have kept."""
        self.stopped_until = max(self.stopped_until, until)
        world.post(until, self._go_on)

    def die(self) -> None:
        """Do nothing until it is started."""
        self.stopped_until = math.inf

    def start(self, now: float) -> None:
        """Run, with empty queues: nobody has read what came."""
        self.stopped_until = self._started = now
        self._queues.clear()

    def deliver(self, message: Any, stamp: int, take: Take, sent: float, now: float) -> None:
        """A message came, which left then (virtual s): what was written before a reader was there
        never reaches it."""
        if sent < self._started:
            return
        if not self.runs(now):
            queue = self._queues.setdefault(take, deque(maxlen=_depth(message)))
            queue.append((message, stamp, take))
        else:
            take(message, (self.wall(now) - stamp) * 1e-9, now)

    def _go_on(self, now: float) -> None:
        if not self.runs(now):
            return
        queues, self._queues = self._queues, {}
        for queue in queues.values():
            for message, stamp, take in _as_looked_at(queue):
                take(message, (self.wall(now) - stamp) * 1e-9, now)


def _depth(message: Any) -> int:
    if isinstance(message, Decision):
        return _DECISIONS
    return _SENSORS if isinstance(message, Imu | Odometry) else _QUEUE


def _as_looked_at(queue: deque[tuple[Any, int, Take]]) -> Sequence[tuple[Any, int, Take]]:
    """In the order in which they came; decisions in the one in which they were made."""
    if isinstance(queue[0][0], Decision):
        return in_order(queue, lambda one: one[0])
    return queue


class Ros:
    """One of each kind of message from one process to another: a topic keeps its order, topics
    overtake each other."""

    def __init__(self, world: World, seed: int) -> None:
        self.world, self._seed = world, seed
        self._takers: dict[type, list[tuple[Process, Take]]] = {}
        self._channels: dict[tuple[str, str, type], Channel[Any]] = {}

    def subscribe(self, kind: type, process: Process, take: Take) -> None:
        """Have messages of this kind given to it."""
        self._takers.setdefault(kind, []).append((process, take))

    def publish(self, source: Process, message: Any) -> int:
        """To all others that want it. Returns its stamp, ns."""
        kind = type(message)
        stamp = source.wall(self.world.now)
        for process, take in self._takers.get(kind, ()):
            if process is not source:
                self._send(source, process, kind, message, stamp, take)
        return stamp

    def _send(
        self, source: Process, to: Process, kind: type, message: Any, stamp: int, take: Take
    ) -> None:
        key, sent = (source.name, to.name, kind), self.world.now
        channel = self._channels.get(key)
        if channel is None:
            drawn = _DRAWN_AS.get(kind, kind.__name__)
            seed = f"{self._seed} {source.name} {to.name} {drawn}"
            ways = (source.outward, to.inward)
            channel = self._channels[key] = Channel(self.world, seed, _DELIVERY, ways)
        channel.send((message,), lambda ones, now: to.deliver(ones[0], stamp, take, sent, now))
