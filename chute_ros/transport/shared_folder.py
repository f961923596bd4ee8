"""Folder of the wire contracts that chute_msgs installs."""

from __future__ import annotations

from pathlib import Path

from chute_ros.errors import NotBuiltError


def shared_folder(name: str, what: str) -> Path:
    """The folder of this name in the share of chute_msgs; NotBuiltError, naming what, if it is
    not there."""
    # Here: who names a folder of his own needs no ROS.
    try:
        from ament_index_python.packages import get_package_share_directory

        folder = Path(get_package_share_directory("chute_msgs")) / name
    except (ImportError, LookupError):
        folder = Path()
    if folder == Path() or not folder.is_dir():
        raise NotBuiltError(
            f"{what} cannot be found: build chute_msgs and source the result, or name a folder "
            "that has them"
        )
    return folder
