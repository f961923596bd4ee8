"""The black box of a supervisor, with its files that are on this computer, as text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from chute_ros.plain_text import span_text
from chute_ros.tools.chute.diagnostic_tasks import Task
from chute_ros.tools.chute.words import age_text

BLACK_BOX = "black box"
#: The newest so many are shown.
_MOST_SHOWN = 5


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
        found = [(one, one.stat()) for one in reversed(ours[-_MOST_SHOWN:])]
    except OSError:
        return None
    return [BoxFile(str(one), about.st_size, now - about.st_mtime) for one, about in found]


@dataclass(frozen=True)
class Box:
    """One black box. files: None where its folder is not on this computer."""

    node: str
    recording: bool
    message: str
    file: str
    age: float
    files: Sequence[BoxFile] | None


def box_of(task: Task, files: Sequence[BoxFile] | None) -> Box:
    """By its task in the diagnostics."""
    file = task.values.get("file", "")
    return Box(task.node, task.level == "OK", task.message, file, task.age, files)


def box_lines(box: Box) -> list[str]:
    """For a terminal."""
    lines = [
        f"{box.node}: {box.message}, {age_text(box.age)}",
        f"  folder  {folder_of(box.file)}",
    ]
    if box.files is None:
        return [
            *lines,
            f"  the folder cannot be read on this computer: look on that of {box.node}",
        ]
    for one in box.files:
        size = f"{one.size / 1e6:.1f} MB"
        lines.append(f"  {size:>10}  written {span_text(max(0.0, one.age))} ago  {one.path}")
    return lines if box.files else [*lines, "  no files yet"]
