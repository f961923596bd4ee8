"""A protocol that only remembers, and a loop around it, for the tests of the transport."""

import math
import os
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from chute_ros.transport.address import parse_address
from chute_ros.transport.loop import WireLoop
from chute_ros.transport.wire import make_wire
from chute_ros.transport.wire_events import WireChange

LOCAL = "127.0.0.1"


class Recorder:
    """Remembers what it is told; sends what it was given; may answer or fail."""

    def __init__(self) -> None:
        self.received: list[tuple[bytes, Any]] = []
        self.ended: list[Any] = []
        self.updates: list[float] = []
        self.deadline = math.inf
        self.output: list[bytes] = []
        self.events: list[Any] = []
        self.answer: Callable[[bytes], bytes | None] = lambda _: None

    def receive(self, data: bytes, now: float, stream: Any = None) -> None:
        self.received.append((data, stream))
        answer = self.answer(data)
        if answer is not None:
            self.output.append(answer)

    def stream_ended(self, stream: Any) -> None:
        self.ended.append(stream)

    def update(self, now: float) -> None:
        self.updates.append(now)
        if now >= self.deadline:
            self.events.append(("due", now))
            self.deadline = math.inf

    def next_deadline(self) -> float:
        return self.deadline

    def take_output(self) -> list[bytes]:
        output, self.output = self.output, []
        return output

    def take_events(self) -> list[Any]:
        events, self.events = self.events, []
        return events

    def heard(self) -> bytes:
        """All bytes so far."""
        return b"".join(data for data, _ in self.received)


class Running:
    """A Recorder on a real wire."""

    def __init__(self, connection: str) -> None:
        self.link = Recorder()
        self.delivered: list[Any] = []
        self.wire = make_wire(parse_address(connection))
        self.loop = WireLoop(self.link, self.wire, self.delivered.extend)

    @property
    def port(self) -> int:
        """The port that was really bound."""
        return int(self.wire.describe().split(":")[2])

    @property
    def changes(self) -> list[WireChange]:
        """The openings and closings so far."""
        return [event for event in self.delivered if isinstance(event, WireChange)]

    def send(self, data: bytes) -> None:
        """Have the protocol send data."""
        self.loop.call(lambda link, now: link.output.append(data))


@contextmanager
def running(connection: str) -> Iterator[Running]:
    """A loop over connection, ended at the end."""
    one = Running(connection)
    one.loop.start()
    try:
        yield one
    finally:
        one.loop.stop()


def descriptors() -> int:
    """How many this process holds."""
    return len(os.listdir("/proc/self/fd"))


def loop_threads() -> list[str]:
    """Names of the link threads that run."""
    return [t.name for t in threading.enumerate() if t.name.startswith("link ")]


def udp() -> socket.socket:
    """A socket on a free port."""
    end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    end.bind((LOCAL, 0))
    end.settimeout(20.0)
    return end


def point(link: Path, target: str) -> None:
    """Have the symbolic link point to target, as udev does for a device that comes back."""
    fresh = link.with_suffix(".new")
    fresh.symlink_to(target)
    fresh.replace(link)
