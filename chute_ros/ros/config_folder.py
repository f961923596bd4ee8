"""Folder of the files that are shipped beside the code."""

from __future__ import annotations

from pathlib import Path

#: Beside the package in the repository, and in its share folder once installed.
_BESIDE = Path(__file__).resolve().parents[2] / "config"


def config_folder() -> Path:
    """The folder config of the repository, or of the installed package."""
    if _BESIDE.is_dir():
        return _BESIDE
    from ament_index_python.packages import get_package_share_directory

    return Path(get_package_share_directory("chute_ros")) / "config"
