"""A pseudo terminal as a wire: the device's end of a serial cable, which a node opens by path."""

from __future__ import annotations

import os
import tty
from collections.abc import Hashable
from itertools import count
from pathlib import Path

#: One read is one USB packet.
_PACKET = 64
_stream_numbers = count(1)


class PtyWire:
    """Makes a pseudo terminal. link: a symbolic link that shall point to it, empty: none."""

    def __init__(self, link: str = "") -> None:
        self._link = Path(link) if link else None
        self._master = self._slave = -1
        self._path = ""
        self._stream: tuple[str, int] = ("pty", 0)

    @property
    def is_open(self) -> bool:
        return self._master >= 0

    @property
    def path(self) -> str:
        """Of the end that others open; empty: there is none."""
        return self._path

    def open(self) -> None:
        if self.is_open:
            return
        # Our own descriptor of the far end stays open: a node that closes it is no hang-up.
        self._master, self._slave = os.openpty()
        try:
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self._path = os.ttyname(self._slave)
            self._stream = (self._path, next(_stream_numbers))
            self._point()
        except OSError:
            self.close()
            raise

    def close(self) -> None:
        """Pull the cable; opened again, it has another path."""
        if not self.is_open:
            return
        # The name goes first: its number is free for any other process from then on.
        if self._link is not None and self._links_here(self._link):
            self._link.unlink(missing_ok=True)
        master, slave = self._master, self._slave
        self._master = self._slave = -1
        self._path = ""
        os.close(slave)
        os.close(master)

    def files(self) -> list[int]:
        return [self._master] if self.is_open else []

    def read(self, file: int) -> list[tuple[bytes, Hashable]]:
        try:
            data = os.read(file, _PACKET)
        except BlockingIOError:
            return []
        return [(data, self._stream)] if data else []

    def write(self, data: bytes) -> None:
        # What does not fit is lost, as in a device whose host does not read.
        if os.write(self._master, data) != len(data):
            raise BlockingIOError(f"{self._path} takes no more data")

    def describe(self) -> str:
        return f"pty:{self._path}"

    def _point(self) -> None:
        if self._link is None:
            return
        if os.path.lexists(self._link) and not self._link.is_symlink():
            raise FileExistsError(f"{self._link} is there and is no symbolic link")
        if not self._link.parent.is_dir():
            raise FileNotFoundError(f"the folder {self._link.parent} does not exist")
        # By replacing, so that a node never finds the name missing or half made.
        fresh = self._link.with_name(f"{self._link.name}.{os.getpid()}.new")
        fresh.symlink_to(self._path)
        try:
            fresh.replace(self._link)
        except OSError:
            fresh.unlink(missing_ok=True)
            raise

    def _links_here(self, link: Path) -> bool:
        try:
            return os.readlink(link) == self._path
        except OSError:
            return False
