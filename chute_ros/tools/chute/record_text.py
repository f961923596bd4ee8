"""The black box of a supervisor as text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from chute_ros.plain_text import span_text
from chute_ros.tools.chute.box_files import BoxFile, folder_of
from chute_ros.tools.chute.diagnostic_tasks import Task
from chute_ros.tools.chute.words import age_text

BLACK_BOX = "black box"


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
