"""Reads the password of the panel from its file."""

from __future__ import annotations

from pathlib import Path

from chute_ros.errors import ParameterError
from chute_ros.transport.regular_file import read_regular, why_not_secret

SHORTEST = 10


def password_from(name: str) -> str | None:
    """None for an empty name. ParameterError: the file cannot be used, with what to do."""
    if not name:
        return None
    path = Path(name).expanduser()
    try:
        about, data = read_regular(path)
        text = data.decode("utf-8").rstrip("\r\n")
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError(f"parameter password_file: {path}: {error}") from None
    if why := why_not_secret(path, about):
        raise ParameterError(f"parameter password_file: {why}")
    if len(text) < SHORTEST or "\n" in text:
        raise ParameterError(
            f"parameter password_file: {path} has no password: need one line of {SHORTEST} "
            "characters or more"
        )
    return text
