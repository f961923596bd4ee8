"""The version of chute_ros that is installed."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def own_version() -> str:
    """As in package.xml; in words where it was not installed."""
    try:
        return version("chute_ros")
    except PackageNotFoundError:
        return "not installed"
