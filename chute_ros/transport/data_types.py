"""The DSDL files that a bus speaks: the standard ones, and those of the parachute."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from chute_ros.errors import NotBuiltError, ParameterError
from chute_ros.protocol.dronecan.data_types import DataTypes

_STANDARD = "uavcan."


def load_data_types(folder: str, named: str) -> DataTypes:
    """The standard types, and those in folder (empty: the ones that we ship).

    The folder's name is the namespace of its types: it must be "flyfire". ParameterError, with
    named for where the folder comes from, if it is not there or cannot be read.
    """
    # Here: the library reads all its own definitions when it is imported.
    import dronecan
    from dronecan.dsdl import DsdlException, parse_namespaces

    path = Path(folder).expanduser() if folder else _shipped()
    # As the parser takes it: not where a link points to.
    path = Path(os.path.abspath(path))
    if not path.is_dir():
        raise ParameterError(f"{named} is {folder!r}: there is no such folder")
    if path.name != "flyfire":
        if (path / "flyfire").is_dir():
            path = path / "flyfire"
        else:
            raise ParameterError(
                f"{named} is {folder!r}: the folder's name is the namespace of its types and must "
                "be flyfire, or it must hold a folder of this name"
            )
    standard = [one for name, one in dronecan.TYPENAMES.items() if name.startswith(_STANDARD)]
    try:
        own = parse_namespaces([str(path)], [str(_standard_folder(dronecan))])
        return DataTypes([*standard, *own])
    except (DsdlException, ParameterError) as error:
        raise ParameterError(f"{named} is {folder!r}: {error}") from None


def _standard_folder(library: Any) -> Path:
    """Where types of the vendor find the standard ones that they are made of."""
    return Path(library.__file__).parent / "dsdl_specs" / "uavcan"


def _shipped() -> Path:
    # Here: who names a folder needs no ROS.
    try:
        from ament_index_python.packages import get_package_share_directory

        folder = Path(get_package_share_directory("chute_msgs")) / "dsdl" / "flyfire"
    except (ImportError, LookupError):
        folder = Path()
    if folder.name != "flyfire" or not folder.is_dir():
        raise NotBuiltError(
            "the DroneCAN data types cannot be found: build chute_msgs and source the result, or "
            "name a folder that has them"
        )
    return folder
