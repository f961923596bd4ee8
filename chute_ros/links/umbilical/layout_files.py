"""The files that say how $TELEM lines are laid out."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
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


def add_layout_options(options: ArgumentParser) -> None:
    """Options of a command that takes one layout."""
    options.add_argument(
        "--layout",
        default=REFERENCE_LAYOUT,
        metavar="NAME",
        help=f"of the $TELEM line (default: {REFERENCE_LAYOUT})",
    )
    options.add_argument(
        "--telem-path", default="", metavar="FOLDER", help="with other layouts (*.yaml)"
    )


def chosen_layout(chosen: Namespace) -> Layout:
    """The layout that these options name; ParameterError if there is none."""
    layouts = {layout.name: layout for layout in load_layouts(chosen.telem_path, "--telem-path")}
    if chosen.layout not in layouts:
        raise ParameterError(f"--layout {chosen.layout!r}: need one of {', '.join(layouts)}")
    return layouts[chosen.layout]


def _load(file: Path, named: str) -> Layout:
    try:
        content = plain_yaml.load(read_regular_text(file))
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise ParameterError(f"{named}: {file}: cannot be read: {error}") from None
    return layout_from(content, str(file))
