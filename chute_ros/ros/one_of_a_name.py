"""A name is for one living supervisor on a computer: a lock that ends with its process."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
from typing import IO

from chute_ros.errors import NameTakenError
from chute_ros.ros.private_files import make_folder

#: Neither a link that somebody laid there, nor a pipe that waits for its other end.
_FLAGS = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK


class NameLock:
    """Held from its beginning to close, or to the end of the process however it comes.

    NameTakenError if another process, or another lock in this one, holds it. what: for people.
    """

    def __init__(self, path: Path, what: str) -> None:
        #: Why nobody is kept out; empty: everybody is.
        self.trouble = ""
        self._file: IO[str] | None = None
        try:
            make_folder(path.parent)
            self._file = os.fdopen(os.open(path, _FLAGS, 0o600), "r+")
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._file.truncate(0)
            print(os.getpid(), file=self._file, flush=True)
        except BlockingIOError:
            raise NameTakenError(
                f"{what} runs already, as process {self._holder()}, which holds {path}: give this "
                "one a name (-r __node:=NAME), a rank and hot_standby of its own, or end that one"
            ) from None
        except (OSError, ValueError) as error:
            # A pipe cannot be read back and forth, which Python says without its path.
            why = getattr(error, "strerror", None) or error
            self.trouble = f"{path}: {why}; let this user write a plain file there"

    def close(self) -> None:
        """Others may have the name. The file stays: who removed it would take it from another."""
        if self._file is not None:
            self._file.close()

    def _holder(self) -> str:
        """The number of the process, as it wrote it."""
        if self._file is None:
            return "unknown"
        with self._file:
            text = self._file.read(20).strip()
        return text if text.isascii() and text.isdigit() else "unknown"
