"""The parameters of the black box."""

from __future__ import annotations

from dataclasses import dataclass

from chute_ros.settings import Settings, parameter


@dataclass(frozen=True)
class BlackBoxSettings(Settings):
    """Where the black box writes, and how much."""

    black_box: bool = parameter(True, "record all inputs and all decisions in files")
    black_box_folder: str = parameter(
        "", "folder for the recordings; empty: chute_ros/black_box under ROS_HOME (~/.ros)"
    )
    black_box_file_limit: int = parameter(
        64, "a new file begins after this size (about an hour)", 1, 4000, "MB"
    )
    black_box_most_files: int = parameter(
        32, "the oldest files are deleted if there are more than this", 2, 10000
    )
