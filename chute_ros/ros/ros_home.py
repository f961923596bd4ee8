"""Folder of the files that outlive a node."""

from __future__ import annotations

import os
from pathlib import Path


def ros_home() -> Path:
    """Our folder under ROS_HOME (~/.ros if that is not set)."""
    return Path(os.environ.get("ROS_HOME") or Path.home() / ".ros") / "chute_ros"
