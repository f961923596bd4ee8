"""The loop between a wire and a protocol: one thread, one descriptor to wake it, no polling.

The protocol (a ProtocolLink) and its wire are touched by one thread at a time: the loop's own, or,
while that one waits, another that has a call for it.
"""

from __future__ import annotations

import select
import socket
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from typing import Any, Generic, Protocol, TypeVar

from chute_ros.transport.lateness import Lateness
from chute_ros.transport.wire import Wire, WireWatch
from chute_ros.transport.wire_events import LoopFault, WireChange

REOPEN_INTERVAL = 0.5  # s
#: The loop runs at least this often (s), so that a hung one can be told from an idle one.
LONGEST_WAIT = 0.2
#: A caller waits at most so long (s) for its turn; a thread that hangs must not hang the caller.
TURN_WITHIN = 0.002


class ProtocolLink(Protocol):
    """A pure protocol: bytes and time in, bytes and events out."""

    def receive(self, data: bytes, now: float, stream: Hashable = None) -> None:
        """Bytes came in."""

    def stream_ended(self, stream: Hashable) -> None:
        """A stream was closed; None: all of them."""

    def update(self, now: float) -> None:
        """Look at the clock."""

    def next_deadline(self) -> float:
        """When update has something to do."""

    def take_output(self) -> list[bytes]:
        """Frames to send."""

    def take_events(self) -> list[Any]:
        """What happened."""


LinkT = TypeVar("LinkT", bound=ProtocolLink)


class WireLoop(Generic[LinkT]):
    """Runs link over wire. deliver gets the events, in the loop's thread or a caller's, and must
    not block.

    opened: for a protocol that wants to know from when on (monotonic s) it can send.
    not_written: for one that wants to know of a frame that the wire did not take.
    frames: how many frames the protocol has taken, for one whose clients must send some.
    """

    def __init__(
        self,
        link: LinkT,
        wire: Wire,
        deliver: Callable[[list[Any]], None],
        opened: Callable[[float], None] = lambda now: None,
        not_written: Callable[[bytes], None] = lambda frame: None,
        frames: Callable[[], int] | None = None,
    ) -> None:
        self.link = link
        self.wire = wire
        self.send_errors = 0
        self.last_run = time.monotonic()
        #: Of reading what the wire brings.
        self.late = Lateness()
        #: When nothing waited to be read from each of the wire's files, monotonic s.
        self._empty_at: dict[int, float] = {}
        self._deliver, self._opened, self._not_written = deliver, opened, not_written
        self._watch = WireWatch(wire, frames, deliver)
        self._calls: deque[Callable[[LinkT, float], None]] = deque()
        self._at_turns_end: deque[Callable[[LinkT, float], None]] = deque(maxlen=1)
        self._touching = threading.Lock()
        #: The thread that holds it; 0: none does.
        self._toucher = 0
        self._wake_in, self._wake_out = socket.socketpair()
        self._wake_in.setblocking(False)
        self._wake_out.setblocking(False)
        self._stopping = False
        self._reopen_at = 0.0
        self._last_failure = ""
        #: What a call found wrong with the wire, for the loop's thread.
        self._found_lost = ""
        self._thread = threading.Thread(target=self._run, name=f"link {wire.describe()}")

    def start(self) -> None:
        """Open the wire, if it can be, and start the thread."""
        self._reopen(time.monotonic())
        self._thread.start()

    def stop(self) -> None:
        """End the thread and close the wire. May be called once."""
        self._stopping = True
        self._wake()
        if self._thread.is_alive():
            self._thread.join()
        self.wire.close()
        self._wake_in.close()
        self._wake_out.close()

    def call(self, function: Callable[[LinkT, float], None]) -> None:
        """Have function(link, now) called, soon, in order, with what it sends on the wire.

        The caller's own thread does it where the loop's waits for something to happen: to wake
        another one first is most of what a call costs. Else the loop does it in this turn or the
        next. The caller waits for its turn at most TURN_WITHIN, and for the wire as long as a
        write takes.
        """
        self._calls.append(function)
        within = self._toucher == threading.get_ident()
        if not within and self._thread.is_alive() and self._touching.acquire(timeout=TURN_WITHIN):
            with self._touched():
                self._guarded(self._make_calls, time.monotonic())
        # A deadline may be nearer now.
        self._wake()

    def call_at_turns_end(self, function: Callable[[LinkT, float], None]) -> None:
        """Have function(link, now) called by the loop's own thread, after a turn in which nothing
        failed: that it is called shows that the loop turns. One that still waits is left out."""
        self._at_turns_end.append(function)
        self._wake()

    def _wake(self) -> None:
        try:
            self._wake_out.send(b"w")
        except BlockingIOError:
            pass  # enough wake-ups are on their way
        except OSError:
            if not self._stopping:
                raise
            # Another thread calls one that has ended: nobody is there to be woken.

    def _run(self) -> None:
        while not self._stopping:
            try:
                self._turn()
            except Exception:  # noqa: BLE001
                # The node must outlive a mistake of ours; the report makes it visible.
                self._deliver([LoopFault(traceback.format_exc())])
                # A mistake that repeats each turn must not take the whole processor.
                time.sleep(0.01)

    def _turn(self) -> None:
        if not self._take_turn():
            return
        with self._touched():
            now = time.monotonic()
            if self._found_lost:
                self._lost(self._found_lost, now)
            if not self.wire.is_open and now >= self._reopen_at:
                self._reopen(now)
            poll, wait = self._watched(now)
        ready = self._await(poll, wait)
        if not self._take_turn():
            return
        with self._touched():
            now = time.monotonic()
            for file, _ in ready:
                if file == self._wake_in.fileno():
                    self._wake_in.recv(4096)
                elif file in self.wire.files():  # the one before it may have ended the wire
                    self._read(file, poll, now)
            # What this brings about leaves before the link looks at its clock.
            self._send()
            self._make_calls(now)
            self.link.update(now)
            self._send()
            self._hand_over()
            self._watch.look(now)
            self.last_run = now
            if self._at_turns_end:
                self._guarded(self._at_turns_end.popleft(), self.link, now)
                self._send()
                self._hand_over()

    def _await(self, poll: select.poll, wait: int) -> list[tuple[int, int]]:
        """What is ready, within so many ms; how long it may have waited is noted."""
        began = time.monotonic()
        ready = self._waiting(poll)
        if not ready:
            ready = poll.poll(wait)
            # One that was not let run when something came cannot know when that was.
            came_at = min(time.monotonic(), began + wait / 1000.0)
            self._empty_at = dict.fromkeys(self._empty_at, came_at)
        now = time.monotonic()
        if ready:
            waited = (now - self._empty_at[file] for file, _ in ready if file in self._empty_at)
            self.late.note(max(waited, default=0.0), now)
        return ready

    def _waiting(self, poll: select.poll) -> list[tuple[int, int]]:
        """What is ready now; that the others are empty is noted."""
        now = time.monotonic()
        ready = poll.poll(0)
        self._empty_at |= dict.fromkeys(self._empty_at.keys() - {file for file, _ in ready}, now)
        return ready

    def _take_turn(self) -> bool:
        """The lock; False: it ends. A Ctrl-C may have taken it from under the caller who had it,
        who then never gives it back."""
        while not self._touching.acquire(timeout=LONGEST_WAIT):
            if self._stopping:
                return False
        return True

    @contextmanager
    def _touched(self) -> Iterator[None]:
        """With the lock, which the caller has taken: whose it is is known until it is free."""
        self._toucher = threading.get_ident()
        try:
            yield
        finally:
            self._toucher = 0
            self._touching.release()

    def _make_calls(self, now: float) -> None:
        while self._calls:
            self._guarded(self._calls.popleft(), self.link, now)
            self._send()
        self._hand_over()

    def _hand_over(self) -> None:
        events = self.link.take_events()
        if events:
            self._deliver(events)

    def _guarded(self, step: Callable[..., None], *arguments: Any) -> None:
        """One step of the protocol: a mistake of ours in it must not cost those that follow."""
        try:
            step(*arguments)
        except Exception:  # noqa: BLE001
            self._deliver([LoopFault(traceback.format_exc())])

    def _watched(self, now: float) -> tuple[select.poll, int]:
        """What to wait for, and at most how long, ms."""
        poll = select.poll()
        poll.register(self._wake_in, select.POLLIN)
        files = self.wire.files()
        for file in files:
            poll.register(file, select.POLLIN)
        self._empty_at = {file: self._empty_at.get(file, now) for file in files}
        # A call may have left a deadline that is long over, as minus infinity.
        wait = max(0.0, min(self.link.next_deadline() - now, LONGEST_WAIT))
        if self._calls:
            wait = 0.0  # a mistake in the last turn has left them over
        # Rounded up: a wait that ends before its deadline would only have to be repeated.
        return poll, int(wait * 1000.0 + 0.999)

    def _read(self, file: int, poll: select.poll, now: float) -> None:
        try:
            chunks = self.wire.read(file)
        except OSError as error:
            self._lost(f"{self.wire.describe()}: {error}", now)
            return
        # What comes from now on waits for no longer than this takes to be handled.
        self._waiting(poll)
        for data, stream in chunks:
            if data or stream is None:
                self._watch.before_data()
                self._guarded(self.link.receive, data, now, stream)
                self._watch.data_heard(stream, now)
            else:
                self._guarded(self.link.stream_ended, stream)

    def _send(self) -> None:
        for frame in self.link.take_output():
            self._write(frame)

    def _write(self, frame: bytes) -> None:
        if not self.wire.is_open:
            self._failed(frame)
            return
        try:
            self.wire.write(frame)
        except BlockingIOError:
            self._failed(frame)
        except (ConnectionError, ValueError) as error:
            self._failed(frame)
            self._lost(f"{self.wire.describe()}: {error}", time.monotonic())
        except OSError:
            # No route, no buffer: the next frame may pass.
            self._failed(frame)

    def _failed(self, frame: bytes) -> None:
        self.send_errors += 1
        self._guarded(self._not_written, frame)

    def _reopen(self, now: float) -> None:
        self._reopen_at = now + REOPEN_INTERVAL
        try:
            self.wire.open()
        except (OSError, ValueError) as error:
            self._lost(f"{self.wire.describe()} cannot be opened: {error}", now)
            return
        self._last_failure = ""
        self._opened(now)
        self._deliver([WireChange(True, f"{self.wire.describe()} is open")])

    def _lost(self, text: str, now: float) -> None:
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            # To close may take long, which nobody who calls must wait for.
            self._found_lost = text
            return
        self._found_lost = ""
        self.wire.close()
        self.link.stream_ended(None)
        self._reopen_at = now + REOPEN_INTERVAL
        if text != self._last_failure:
            self._last_failure = text
            self._deliver([WireChange(False, f"{text}; trying again each {REOPEN_INTERVAL} s")])
