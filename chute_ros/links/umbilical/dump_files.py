"""Dumps of the flight computer's memory as files.

While a dump comes its file has ".part" at the end of its name, and keeps it if the dump does not
come whole.
"""

from __future__ import annotations

import datetime
import os
from dataclasses import dataclass
from io import BufferedWriter
from pathlib import Path

from chute_ros.ros.private_files import make_folder, open_new
from chute_ros.ros.ros_home import ros_home
from chute_ros.transport.given_path import given_path

PART = ".part"


@dataclass(frozen=True)
class DumpResult:
    """A file that was written, its size in bytes, and what went wrong with it (empty: nothing)."""

    path: str
    size: int
    failure: str = ""


class DumpFiles:
    """One dump at a time. folder: where those go whose path is empty or relative; empty: one
    under ROS_HOME."""

    def __init__(self, folder: str) -> None:
        named = "parameter dump_folder"
        self.folder = given_path(folder, named) if folder else ros_home() / "dumps"
        self._final = Path()
        self._file: BufferedWriter | None = None
        self._size = 0
        self._failure = ""

    def refusal(self, path: str) -> str:
        """Why a dump cannot go to this path (empty: a new name); empty text: it can."""
        try:
            make_folder(self.folder)
            if not path:
                return ""
            wanted = self.folder / Path(path).expanduser()
            for one in (wanted, Path(f"{wanted}{PART}")):
                if one.exists():
                    return f"{one} exists already: name another path"
            if not wanted.parent.is_dir():
                return f"there is no folder {wanted.parent}"
        except (OSError, RuntimeError, ValueError) as error:
            return f"{path or self.folder}: {error}"
        return ""

    def start(self, memory: str, suffix: str, path: str, now: datetime.datetime) -> str:
        """A dump begins; where it goes."""
        self.finish(False)
        name = f"{memory}_{now:%Y%m%dT%H%M%S_%f}{suffix}"
        self._size, self._failure = 0, ""
        try:
            self._final = self.folder / (Path(path).expanduser() if path else name)
            make_folder(self._final.parent)
            self._file = os.fdopen(open_new(Path(f"{self._final}{PART}")), "wb")
        except OSError as error:
            self._failure = f"cannot be written: {error}"
        return str(self._final)

    def write(self, data: bytes) -> None:
        """The next bytes."""
        if self._file is None:
            return
        try:
            self._file.write(data)
            self._size += len(data)
        except OSError as error:
            self._failure = f"cannot be written: {error}"
            self._close()

    def finish(self, complete: bool) -> DumpResult:
        """The dump is over."""
        was_open = self._file is not None
        self._close()
        path = Path(f"{self._final}{PART}")
        if was_open and complete and not self._failure:
            try:
                path = path.rename(self._final)
            except OSError as error:
                self._failure = f"cannot be renamed: {error}"
        written = str(path) if self._size or was_open else ""
        return DumpResult(written, self._size, self._failure)

    def _close(self) -> None:
        file, self._file = self._file, None
        if file is not None:
            try:
                file.close()
            except OSError as error:
                self._failure = f"cannot be written: {error}"
