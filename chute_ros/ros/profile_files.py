"""Profiles of rules: the shipped ones by name, the user's by path."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from chute_ros.errors import ParameterError, ProfileError
from chute_ros.ros.config_folder import config_folder
from chute_ros.supervisor.profile_reader import read_profile
from chute_ros.supervisor.rules import Profile
from chute_ros.transport.given_path import given_path
from chute_ros.transport.regular_file import read_regular_text


def load_profile(named: str, links: Sequence[str]) -> Profile:
    """The profile with this name or path; links: those that the supervisor follows.

    ParameterError if there is none; ProfileError lists what is wrong in it, with lines.
    """
    if not named:
        raise ParameterError(f"parameter profile is empty: need one of {_shipped()}, or a path")
    is_path = "/" in named or named.endswith((".yaml", ".yml"))
    path = given_path(named, "parameter profile") if is_path else _folder() / f"{named}.yaml"
    try:
        text = read_regular_text(path)
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise ParameterError(
            f"parameter profile is {named!r}: {path} cannot be read ({error}); need one of "
            f"{_shipped()}, or the path of a file"
        ) from None
    try:
        return read_profile(text, str(path), links)
    except ProfileError as error:
        raise ProfileError(f"parameter profile is {named!r}:\n{error}") from None


def _shipped() -> str:
    return ", ".join(sorted(file.stem for file in _folder().glob("*.yaml")))


def _folder() -> Path:
    return config_folder() / "profiles"
