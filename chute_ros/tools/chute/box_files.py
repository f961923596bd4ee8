"""The files of a black box that are on this computer."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

#: The newest so many are shown.
MOST_SHOWN = 5


@dataclass(frozen=True)
class BoxFile:
    """One file. size: bytes; age: since it was written last, s."""

    path: str
    size: int
    age: float


def folder_of(file: str) -> Path:
    """The folder of a black box, by the path that it reports: of its newest file, or the folder
    itself before the first."""
    path = Path(file)
    return path.parent if path.suffix == ".mcap" else path


def newest_files(file: str, now: float) -> list[BoxFile] | None:
    """The newest files of the same node, the newest first; None: the folder is not here, or may
    not be read. now: Unix s."""
    folder = folder_of(file)
    # NODE_NUMBER_TIME.mcap: the number orders them, whatever the clock showed.
    own = Path(file).name.rpartition("_")[0].rpartition("_")[0]
    try:
        names = [one for one in folder.iterdir() if one.suffix == ".mcap"]
        ours = sorted(one for one in names if not own or one.name.startswith(f"{own}_"))
        found = [(one, one.stat()) for one in reversed(ours[-MOST_SHOWN:])]
    except OSError:
        return None
    return [BoxFile(str(one), about.st_size, now - about.st_mtime) for one, about in found]
