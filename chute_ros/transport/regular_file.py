"""Reading a file that somebody put in its place: never waiting, never without an end."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

#: No file that is read whole is longer, bytes.
LONGEST = 16 * 2**20
_KINDS = (
    (stat.S_ISFIFO, "a FIFO"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISDIR, "a folder (Is a directory)"),
)


class NotRegularError(OSError):
    """A FIFO, a device, a folder or a socket in place of a file."""


class TooLongError(OSError):
    """It holds more than it may."""


def open_regular(path: Path) -> BinaryIO:
    """The file, open for reading, however long it is. OSError, as usual, and NotRegularError."""
    # Before it is opened: that alone may do something to a device.
    _check(os.stat(path))
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    try:
        # What is opened may be another than what was looked at.
        _check(os.fstat(number))
        return os.fdopen(number, "rb")
    except BaseException:
        os.close(number)
        raise


def read_regular(path: Path, longest: int = LONGEST) -> tuple[os.stat_result, bytes]:
    """What the file is, and what is in it. OSError, as usual; NotRegularError and
    TooLongError (longest in bytes): a FIFO that nobody writes to would never answer, and a device
    such as /dev/zero never end."""
    with open_regular(path) as file:
        data = file.read(longest + 1)
        if len(data) > longest:
            raise TooLongError(f"it holds more than {longest} bytes")
        return os.fstat(file.fileno()), data


def read_regular_text(path: Path) -> str:
    """The same as text in UTF-8; UnicodeDecodeError if it is none."""
    return read_regular(path)[1].decode("utf-8")


def why_not_secret(name: str | Path, about: os.stat_result) -> str:
    """Why what is in it may be no secret, and what to do; empty: only its user can read it, who is
    ours or root."""
    if about.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        return f"{name} may be read by others: chmod 600 {name}"
    if about.st_uid not in (0, os.geteuid()):
        return f"{name} belongs to another user: chown it"
    return ""


def _check(about: os.stat_result) -> None:
    if not stat.S_ISREG(about.st_mode):
        kind = next((name for is_it, name in _KINDS if is_it(about.st_mode)), "something else")
        raise NotRegularError(f"no regular file but {kind}")
