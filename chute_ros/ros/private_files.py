"""Files for their owner alone, whatever the umask, and whoever else may write where they lie."""

from __future__ import annotations

import glob
import os
import stat
from pathlib import Path

from chute_ros.transport.regular_file import read_regular


def make_folder(path: Path) -> None:
    """The folder, and those above it that are missing. One that is there stays as it is."""
    for folder in reversed((path, *path.parents)):
        folder.mkdir(mode=0o700, exist_ok=True)


def open_new(path: Path) -> int:
    """The descriptor of a new file. FileExistsError if anything has that name, a link as well:
    what is written must not go where somebody else points to."""
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)


def replace_text(path: Path, text: str, durable: bool = False) -> None:
    """Write text beside path, then put it in its place: a crash leaves the one or the other.
    durable: on the disk when this returns, against a power cut. OSError as the disk does."""
    make_folder(path.parent)
    for left in path.parent.glob(f"{glob.escape(path.name)}.*.new"):
        left.unlink(missing_ok=True)  # of a process that was killed while it wrote
    beside = path.with_name(f"{path.name}.{os.getpid()}.new")
    descriptor = open_new(beside)
    try:
        with os.fdopen(descriptor, "w") as file:
            file.write(text)
            file.flush()
            if durable:
                os.fsync(file.fileno())
        beside.replace(path)
    except OSError:
        beside.unlink(missing_ok=True)
        raise
    if durable:
        sync_folder(path.parent)


def sync_folder(path: Path) -> None:
    """The names in it are on the disk when this returns."""
    folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def read_own_text(path: Path) -> str:
    """The text of a file that decides what a node does; PermissionError if others may have
    written it. FileNotFoundError, OSError (what is no regular file, too) and UnicodeDecodeError as
    read_regular has them."""
    about, data = read_regular(path)
    if about.st_uid not in (0, os.geteuid()):
        raise PermissionError(f"{path} belongs to another user: chown it")
    if about.st_mode & stat.S_IWOTH:
        raise PermissionError(f"{path} may be written by everybody: chmod 600 {path}")
    return data.decode("utf-8")
