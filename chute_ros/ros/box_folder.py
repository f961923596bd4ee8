"""Files of a black box: their names, their order, and the ones to delete."""

from __future__ import annotations

import datetime
import re
from pathlib import Path

from chute_ros.ros.private_files import make_folder
from chute_ros.ros.ros_home import ros_home
from chute_ros.transport.given_path import given_path


class BoxFolder:
    """path: the folder; empty: one under ROS_HOME. name: of the recording node, by which the files
    of several vehicles on one host are told apart. most_files: how many of them are kept."""

    def __init__(self, path: str, name: str, most_files: int) -> None:
        named = "parameter black_box_folder"
        self.path = given_path(path, named) if path else ros_home() / "black_box"
        self._name = name.strip("/").replace("/", ".")
        self._most_files = most_files
        self._pattern = re.compile(re.escape(self._name) + r"_(\d{6,})_[0-9TZ]+\.mcap")

    def next_path(self, wall: int) -> Path:
        """The name of a new file. wall: the time, Unix ns. What orders them is their number: the
        clock of a computer without a battery begins anew with each start."""
        make_folder(self.path)
        number = max((number for number, _ in self._numbered()), default=0) + 1
        when = datetime.datetime.fromtimestamp(wall // 10**9, datetime.timezone.utc)
        return self.path / f"{self._name}_{number:06d}_{when:%Y%m%dT%H%M%SZ}.mcap"

    def prune(self) -> None:
        """Remove the oldest of those that are too many."""
        for _, path in sorted(self._numbered())[: -self._most_files]:
            path.unlink(missing_ok=True)

    def _numbered(self) -> list[tuple[int, Path]]:
        matches = ((self._pattern.fullmatch(one.name), one) for one in self.path.iterdir())
        return [(int(match[1]), one) for match, one in matches if match]
