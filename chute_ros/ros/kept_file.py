"""What is written to a disk is written by a thread: a slow one must not be in the way of whoever
decides, or acts."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Generic, TypeVar

from chute_ros.ros.private_files import replace_text

T = TypeVar("T")


class Newest(Generic[T]):
    """Does something, in a thread of this name, with the newest of what it is given."""

    def __init__(self, do: Callable[[T], None], name: str) -> None:
        self._do = do
        self._newest: list[T] = []
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._do_all, name=name, daemon=True)
        self._thread.start()

    def give(self, value: T) -> None:
        """The newest; what waits before it never has its turn."""
        with self._changed:
            self._newest = [value]
            self._changed.notify()

    def close(self) -> None:
        """What waits is done."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(timeout=2.0)

    def _do_all(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._newest or self._closed)
                newest, self._newest = self._newest, []
            if not newest:
                return
            self._do(newest[0])


class KeptFile(Generic[T]):
    """A file with the newest of what it is given. render: the text for it; empty: the file goes.
    name: of the thread. durable: a power cut does not cost it."""

    def __init__(
        self, path: Path, render: Callable[[T], str], name: str, durable: bool = False
    ) -> None:
        self.path, self._durable = path, durable
        #: Why the newest is not in the file; empty: it is.
        self.trouble = ""
        self.times_written = 0
        self._render = render
        self._newest: Newest[T] = Newest(self._write, name)
        self.keep, self.close = self._newest.give, self._newest.close

    def _write(self, value: T) -> None:
        try:
            if text := self._render(value):
                replace_text(self.path, text, self._durable)
                self.times_written += 1
            else:
                self.path.unlink(missing_ok=True)
            self.trouble = ""
        except OSError as error:
            self.trouble = str(error)
