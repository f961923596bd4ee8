"""The files that say how $TELEM lines are laid out."""

from __future__ import annotations

from pathlib import Path

import yaml

from chute_ros import plain_yaml
from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.protocol.layouts import REFERENCE_LAYOUT, Layout, layout_from
from chute_ros.transport.given_path import given_path
from chute_ros.transport.regular_file import read_regular_text
from chute_ros.transport.shared_folder import shared_folder


def load_layouts(folder: str, named: str) -> list[Layout]:
    """The layouts in folder (empty: the ones that we ship), the reference's first.

    ParameterError, with named for where the folder comes from, if it has none or one is wrong.
    """
    path = given_path(folder, named) if folder else shared_folder("telem", "the layouts of $TELEM")
    files = sorted(path.glob("*.yaml"))
    if not files:
        raise ParameterError(f"{named} is {folder!r}: there is no layout (*.yaml) in this folder")
    layouts = [_load(file, named) for file in files]
    names = [layout.name for layout in layouts]
    if len(set(names)) != len(names):
        raise ParameterError(f"{named} is {folder!r}: two layouts have one name: {names}")
    return sorted(layouts, key=lambda layout: layout.name != REFERENCE_LAYOUT)


def _load(file: Path, named: str) -> Layout:
    try:
        content = plain_yaml.load(read_regular_text(file))
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise ParameterError(f"{named}: {file}: cannot be read: {error}") from None
    return layout_from(content, str(file))
