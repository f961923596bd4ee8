"""A thread that reads an interface of python-can which has no descriptor to wait for."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable

from chute_ros.protocol.dronecan.can_frame import SIZE

#: Frames taken at once, so that a flood cannot keep the loop from its deadlines.
BURST = 64
#: How long the reading thread waits at once, s: so long may closing take.
WAIT = 0.1


class FrameReader:
    """A thread that waits for frames and makes a descriptor readable with each."""

    def __init__(self, take_one: Callable[[float], bytes | None], name: str) -> None:
        self._take_one = take_one
        # Whole frames, as each is sent at once. Who sends waits while the loop does not read.
        self._ours, self._theirs = socket.socketpair()
        self._ours.setblocking(False)
        self._failure = ""
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name=f"reader {name}", daemon=True)
        self._thread.start()

    def fileno(self) -> int:
        """Readable when a frame has come, or the interface is gone."""
        return self._ours.fileno()

    def take(self) -> list[bytes]:
        """Frames that came; OSError: the interface is gone."""
        try:
            data = self._ours.recv(SIZE * BURST)
        except BlockingIOError:
            return []
        if not data:
            raise OSError(self._failure)
        return [data[at : at + SIZE] for at in range(0, len(data), SIZE)]

    def stop(self) -> None:
        """End the thread."""
        self._stopping = True
        self._ours.shutdown(socket.SHUT_RDWR)  # it may be waiting until somebody reads
        self._thread.join()
        self._ours.close()

    def _run(self) -> None:
        with self._theirs as theirs:
            while not self._stopping:
                try:
                    frame = self._take_one(WAIT)
                    if frame:
                        theirs.sendall(frame)
                except OSError as error:
                    self._failure = str(error)
                    return
