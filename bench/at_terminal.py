"""Runs a module at a terminal that nobody looks at: bench.at_terminal TEXT MODULE ARGUMENTS.

Says that it looks once this text has come.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import struct
import sys
import termios

#: What an onlooker of the bench says once it sees a vehicle.
LOOKS = "looks"


def _read(ours: int, until: bytes) -> None:
    seen, looks = b"", False
    # It ends with an error when the other end is closed.
    with contextlib.suppress(OSError):
        while told := os.read(ours, 65536):
            seen = (seen + told)[-65536:]
            if not looks and until in seen:
                looks = True
                print(LOOKS, flush=True)


if __name__ == "__main__":
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 50, 120, 0, 0))
    if os.fork() == 0:
        os.close(theirs)
        _read(ours, sys.argv[1].encode())
        os._exit(0)
    os.close(ours)
    for stream in (0, 1):
        os.dup2(theirs, stream)
    os.environ["TERM"] = "xterm-256color"
    os.execv(sys.executable, [sys.executable, "-m", *sys.argv[2:]])
