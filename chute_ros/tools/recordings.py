"""Which recordings the given paths hold. Named files of one supervisor are one recording, however
often it started; in a folder each of its starts is one."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from chute_ros.errors import ChuteError, RecordError
from chute_ros.tools.recording import Beginning, beginning, files_of, utc

#: As a black box names its files: after the vehicle and the node, then a number and the time.
_NAME = re.compile(r"(.+)_\d{6,}_[0-9TZ]+\.mcap")


@dataclass
class RecordingFiles:
    """The files of one recording, in their order. supervisor: whose they are; begin: None if it
    is not known; trouble: why they cannot be read, empty if they can."""

    files: list[Path]
    supervisor: tuple[Path, str]
    begin: Beginning | None
    trouble: str = ""

    def __str__(self) -> str:
        names = self.files[0].name
        if len(self.files) > 1:
            names += f" to {self.files[-1].name} ({len(self.files)} files)"
        if self.begin is None:
            return f"{names}: {self.trouble or 'no turn of a supervisor is in it'}"
        vehicle = self.begin.namespace or "no namespace"
        return f"{names}: vehicle {vehicle}, from {utc(self.begin.turn.wall)} UTC"


def recordings_of(
    paths: Iterable[Path], tell: Callable[[str], object] = lambda _: None
) -> list[RecordingFiles]:
    """All of them, of each file only its beginning read. A file that is given again, by whatever
    name, is left out, which tell is called with. RecordError: a named file cannot be read, or a
    folder has none."""
    found: list[RecordingFiles] = []
    known: dict[tuple[int, int], Path] = {}
    for path in paths:
        for file in files_of([path]):
            if (earlier := _known(file, known)) is not None:
                tell(f"{file} is the same file as {earlier}: read once")
                continue
            one = _begun(file) if path.is_dir() else _only(file, beginning(file))
            same = (other for other in reversed(found) if other.supervisor == one.supervisor)
            former = next(same, None)
            if former is not None and (not path.is_dir() or _continues(former, one)):
                former.files.append(file)
            else:
                found.append(one)
    return found


def chosen(
    paths: Iterable[Path], number: int | None, tell: Callable[[str], object]
) -> list[RecordingFiles]:
    """The recording with this number, from 1; without one all of them. tell: as recordings_of has
    it. ChuteError: none has it."""
    found = recordings_of(paths, tell)
    if number is None:
        return found
    if not 1 <= number <= len(found):
        raise ChuteError(f"--recording {number}: need a number of this list\n{listed(found)}")
    return [found[number - 1]]


def listed(found: Iterable[RecordingFiles]) -> str:
    """A numbered line for each."""
    return "\n".join(f"{number:4}  {one}" for number, one in enumerate(found, 1))


def _known(file: Path, known: dict[tuple[int, int], Path]) -> Path | None:
    """The name under which it is known already; from now on it is."""
    try:
        about = file.stat()
    except OSError:
        return None  # who reads it tells why not
    former = known.get((about.st_dev, about.st_ino))
    known.setdefault((about.st_dev, about.st_ino), file)
    return former


def _begun(file: Path) -> RecordingFiles:
    try:
        return _only(file, beginning(file))
    except RecordError as error:
        return RecordingFiles([file], (file, ""), None, str(error))


def _only(file: Path, begin: Beginning | None) -> RecordingFiles:
    name = _NAME.fullmatch(file.name)
    # Files that somebody named are told apart by what is in them.
    supervisor = name[1] if name else begin.namespace if begin else ""
    return RecordingFiles([file], (file.parent, supervisor), begin)


def _continues(former: RecordingFiles, one: RecordingFiles) -> bool:
    """A file of the same start, which was only begun because the last was full."""
    if former.begin is None or one.begin is None:
        return one.begin is None  # nothing in it says otherwise
    return not one.begin.is_start_after(former.begin)
