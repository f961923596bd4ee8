"""The parameters of the black box."""

from __future__ import annotations

from chute_ros.settings import Parameter

PARAMETERS = (
    Parameter("black_box", True, "record all inputs and all decisions in files"),
    Parameter(
        "black_box_folder",
        "",
        "where they go; empty: under ROS_HOME (~/.ros)/chute_ros/black_box",
    ),
    Parameter(
        "black_box_file_limit", 64, "a new file begins after this, MB (about an hour)", 1, 4000
    ),
    Parameter(
        "black_box_most_files", 32, "the oldest files go where there are more of them", 2, 10000
    ),
)
