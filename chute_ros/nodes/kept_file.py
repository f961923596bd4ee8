"""A file with the newest of what it is given. A thread writes: a slow disk must not be in the way
of whoever decides."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Generic, TypeVar

from chute_ros.nodes.private_files import replace_text

T = TypeVar("T")


class KeptFile(Generic[T]):
    """render: the text for it; empty: the file goes. name: of the thread."""

    def __init__(self, path: Path, render: Callable[[T], str], name: str) -> None:
        self.path = path
        #: Why the newest is not in the file; empty: it is.
        self.trouble = ""
        self.times_written = 0
        self._render = render
        self._newest: list[T] = []
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._write_all, name=name, daemon=True)
        self._thread.start()

    def keep(self, value: T) -> None:
        """The newest; what is not written yet before it never is."""
        with self._changed:
            self._newest = [value]
            self._changed.notify()

    def close(self) -> None:
        """Write what waits."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(timeout=2.0)

    def _write_all(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._newest or self._closed)
                newest, self._newest = self._newest, []
            if not newest:
                return
            try:
                self._write(newest[0])
                self.trouble = ""
            except OSError as error:
                self.trouble = str(error)

    def _write(self, value: T) -> None:
        text = self._render(value)
        if not text:
            self.path.unlink(missing_ok=True)
            return
        # Not flushed to the disk: a power cut may cost it, a crash of the process does not.
        replace_text(self.path, text)
        self.times_written += 1
