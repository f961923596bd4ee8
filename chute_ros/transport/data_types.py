"""The DSDL files that a bus speaks: the standard ones, and those of the parachute."""

from __future__ import annotations

import os
from pathlib import Path

from chute_ros.errors import ParameterError
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.transport.given_path import given_path
from chute_ros.transport.shared_folder import shared_folder

_STANDARD = "uavcan."


def load_data_types(folder: str, named: str) -> DataTypes:
    """The standard types, and those in folder (empty: the ones that we ship).

    The folder's name is the namespace of its types: it must be "flyfire". ParameterError, with
    named for where the folder comes from, if it is not there or cannot be read.
    """
    # Here: the library reads all its own definitions when it is imported.
    import dronecan
    from dronecan.dsdl import DsdlException, parse_namespaces

    path = (
        given_path(folder, named)
        if folder
        else shared_folder("dsdl/flyfire", "the DroneCAN data types")
    )
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
    for file in sorted(path.rglob("*")):
        # The library would wait for a FIFO for ever.
        if not (file.is_file() or file.is_dir()):
            raise ParameterError(f"{named} is {folder!r}: {file} is no regular file")
    standard = [one for name, one in dronecan.TYPENAMES.items() if name.startswith(_STANDARD)]
    # Where types of the vendor find the standard ones that they are made of.
    specs = Path(dronecan.__file__).parent / "dsdl_specs" / "uavcan"
    try:
        own = parse_namespaces([str(path)], [str(specs)])
        return DataTypes([*standard, *own])
    except (DsdlException, ParameterError) as error:
        raise ParameterError(f"{named} is {folder!r}: {error}") from None
