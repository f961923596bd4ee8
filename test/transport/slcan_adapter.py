"""A CAN adapter that speaks the LAWICEL protocol on a pseudo terminal, for the tests of slcan."""

import os
import select
import threading
import tty
from pathlib import Path

from loop_bench import point

_OK, _BELL = b"\r", b"\a"


class Adapter:
    """The far end, plugged in at a path. Frames pass only while its channel is open."""

    def __init__(self, path: Path) -> None:
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path = path
        self.commands: list[bytes] = []
        self.sent: list[bytes] = []
        self.listens = True
        self.channel_open = threading.Event()
        self._plugged = True
        self._wake_in, self._wake_out = os.pipe()
        point(path, os.ttyname(self._slave))
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def deliver(self, *lines: bytes) -> None:
        """Have the host receive lines, as frames from the bus come."""
        for line in lines:
            data = line + b"\r"
            while data:
                data = data[os.write(self.master, data) :]

    def stop_listening(self) -> None:
        """Take nothing more from the host."""
        self.listens = False
        os.write(self._wake_out, b"w")

    def unplug(self) -> None:
        """Be gone; a second time does nothing."""
        if not self._plugged:
            return
        self._plugged = False
        # The name goes first: its number is free for any other process from then on.
        self.path.unlink()
        os.write(self._wake_out, b"w")
        self._thread.join()
        for end in (self.master, self._slave, self._wake_in, self._wake_out):
            os.close(end)

    def _run(self) -> None:
        buffer = b""
        while self._plugged:
            listening = [self.master] if self.listens else []
            ready = select.select([*listening, self._wake_in], [], [])[0]
            if self._wake_in in ready:
                os.read(self._wake_in, 100)
            elif self.master in ready:
                *lines, buffer = (buffer + os.read(self.master, 4096)).split(b"\r")
                for line in lines:
                    os.write(self.master, self._answer(line))

    def _answer(self, line: bytes) -> bytes:
        if line[:1] in (b"t", b"T", b"r", b"R"):
            if not self.channel_open.is_set():
                return _BELL
            self.sent.append(line)
            return (b"z" if line[:1] in b"tr" else b"Z") + _OK
        self.commands.append(line)
        if line == b"O":
            if self.channel_open.is_set():
                return _BELL
            self.channel_open.set()
        elif line == b"C":
            self.channel_open.clear()
        elif line[:1] == b"S" and self.channel_open.is_set():
            return _BELL
        return _OK
