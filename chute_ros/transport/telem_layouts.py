"""The files that say how $TELEM lines are laid out."""

from __future__ import annotations

from pathlib import Path

import yaml

from chute_ros.errors import NotBuiltError, ParameterError
from chute_ros.protocol.umbilical.layouts import REFERENCE_LAYOUT, Layout, layout_from


def load_layouts(folder: str, named: str) -> list[Layout]:
    """The layouts in folder (empty: the ones that we ship), the reference's first.

    ParameterError, with named for where the folder comes from, if it has none or one is wrong.
    """
    path = Path(folder).expanduser() if folder else _shipped()
    files = sorted(path.glob("*.yaml"))
    if not files:
        raise ParameterError(f"{named} is {folder!r}: there is no layout (*.yaml) in this folder")
    layouts = [_load(file) for file in files]
    names = [layout.name for layout in layouts]
    if len(set(names)) != len(names):
        raise ParameterError(f"{named} is {folder!r}: two layouts have one name: {names}")
    return sorted(layouts, key=lambda layout: layout.name != REFERENCE_LAYOUT)


def _load(file: Path) -> Layout:
    try:
        content = yaml.safe_load(file.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ParameterError(f"{file}: cannot be read: {error}") from None
    return layout_from(content, str(file))


def _shipped() -> Path:
    # Here: who names a folder needs no ROS.
    try:
        from ament_index_python.packages import get_package_share_directory

        folder = Path(get_package_share_directory("chute_msgs")) / "telem"
    except (ImportError, LookupError):
        folder = Path()
    if folder.name != "telem" or not folder.is_dir():
        raise NotBuiltError(
            "the layouts of $TELEM cannot be found: build chute_msgs and source the result, or "
            "name a folder that has them"
        )
    return folder
