"""A path as a person gives it, in a parameter or an option."""

from __future__ import annotations

from pathlib import Path

from chute_ros.errors import ParameterError


def given_path(path: str, named: str) -> Path:
    """path, with ~ and ~user as a shell reads them. ParameterError, with named for where the path
    comes from, if there is no such user."""
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise ParameterError(f"{named} is {path!r}: {error}") from None
