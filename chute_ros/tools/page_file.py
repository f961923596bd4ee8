"""Writes the files that tools make: never over what was read, nor over others."""

from __future__ import annotations

import contextlib
import os
import re
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from chute_ros.errors import ChuteError
from chute_ros.transport.regular_file import open_regular

#: So much of a file tells its kind, bytes.
_HEAD = 500


class FileKind(NamedTuple):
    """A kind of file: its name, and how it begins."""

    name: str
    begins: re.Pattern[bytes]


HTML = FileKind("HTML page", re.compile(rb"<!DOCTYPE html>"))
SVG = FileKind("SVG picture", re.compile(rb"(<\?xml [^>]*>\s*)?<svg "))
#: A title alone: parameter files begin with a comment of several lines.
MARKDOWN = FileKind("Markdown page", re.compile(rb"# [^\n]+\n\n"))
JUNIT = FileKind("JUnit report", re.compile(rb"(<\?xml [^>]*>\s*)?<testsuite"))


def require_output(path: Path, kind: FileKind, inputs: Iterable[Path] = ()) -> None:
    """ChuteError, in one line, where write_page would raise it now."""
    try:
        existing = _existing(path, kind, inputs)
        if existing is None or stat.S_ISREG(existing.st_mode):
            with contextlib.closing(_Beside(path)):
                pass
    except OSError as error:
        raise _refused(path, error) from None


def write_page(path: Path, text: str, kind: FileKind, inputs: Iterable[Path] = ()) -> None:
    """write_output of a text, in UTF-8."""
    write_output(path, text.encode("utf-8"), kind, inputs)


def write_output(path: Path, data: bytes, kind: FileKind, inputs: Iterable[Path] = ()) -> None:
    """Write data to path: whole, or what was there stays. ChuteError, in one line: it cannot be
    written, is one of inputs, or is there and is no earlier output of this kind."""
    assert kind.begins.match(data), f"no {kind.name}"  # the next one could not go over it
    try:
        existing = _existing(path, kind, inputs)
        if existing is not None and not stat.S_ISREG(existing.st_mode):
            # A terminal or a pipe, such as /dev/stdout: nothing is there that could be lost.
            path.write_bytes(data)
            return
        with contextlib.closing(_Beside(path)) as beside:
            beside.replace(data, existing)
    except OSError as error:
        raise _refused(path, error) from None


def _existing(path: Path, kind: FileKind, inputs: Iterable[Path]) -> os.stat_result | None:
    """What is there; None: nothing."""
    try:
        about = path.stat()
    except FileNotFoundError:
        return None
    if stat.S_ISDIR(about.st_mode):
        raise ChuteError(f"{path} is a folder: name a file in it")
    if not stat.S_ISREG(about.st_mode):
        return about
    for one in inputs:
        with contextlib.suppress(OSError):
            if os.path.samestat(about, one.stat()):
                raise ChuteError(f"{path} is read here: nothing is written over it: name another")
    with open_regular(path) as file:
        head = file.read(_HEAD)
    if head and not kind.begins.match(head):
        raise ChuteError(f"{path} exists and is no {kind.name}: remove it, or name another")
    return about


class _Beside:
    """A new file beside path, or beside the file that path links to."""

    def __init__(self, path: Path) -> None:
        self._path = Path(os.path.realpath(path))
        self._new = self._path.with_name(f"{self._path.name}.{os.getpid()}.new")
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        self._descriptor = os.open(self._new, flags, 0o666)

    def replace(self, data: bytes, existing: os.stat_result | None) -> None:
        """Put data in the place of path, with the rights of the existing file."""
        if existing is not None:
            os.fchmod(self._descriptor, stat.S_IMODE(existing.st_mode))
        left = memoryview(data)
        while left:
            left = left[os.write(self._descriptor, left) :]
        self._new.replace(self._path)

    def close(self) -> None:
        """Leave nothing beside it."""
        os.close(self._descriptor)
        self._new.unlink(missing_ok=True)


def _refused(path: Path, error: OSError) -> ChuteError:
    return ChuteError(f"{path}: {error.strerror or error}")
