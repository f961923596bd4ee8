"""Runs a module at a terminal that nobody looks at: bench.at_terminal MODULE ARGUMENTS."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import struct
import sys
import termios


def _read(ours: int) -> None:
    # It ends with an error when the other end is closed.
    with contextlib.suppress(OSError):
        while os.read(ours, 65536):
            pass


if __name__ == "__main__":
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 50, 120, 0, 0))
    if os.fork() == 0:
        os.close(theirs)
        _read(ours)
        os._exit(0)
    os.close(ours)
    for stream in (0, 1):
        os.dup2(theirs, stream)
    os.environ["TERM"] = "xterm-256color"
    os.execv(sys.executable, [sys.executable, "-m", *sys.argv[1:]])
