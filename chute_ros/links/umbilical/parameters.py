"""The parameters of umbilical."""

from __future__ import annotations

from dataclasses import dataclass

from chute_ros.links.umbilical.runtime import UmbilicalSettings
from chute_ros.settings import Settings, nested, parameter, parameters_of
from chute_ros.transport.address import SERIAL_FORMS, parse_serial_address


@dataclass(frozen=True)
class UmbilicalParameters(Settings):
    """All parameters of the node; first those of its connection and files."""

    connection: str = parameter(
        "usb:c0de:cafe",
        f"serial port of the flight computer, by path, by-id path or USB ids: {SERIAL_FORMS}",
    )
    telem_path: str = parameter(
        "", "folder with your own $TELEM layouts (*.yaml); empty: the shipped layouts"
    )
    dump_folder: str = parameter(
        "", "folder for dumps; empty: chute_ros/dumps under ROS_HOME (~/.ros)"
    )
    runtime: UmbilicalSettings = nested(UmbilicalSettings())

    def __post_init__(self) -> None:
        super().__post_init__()
        parse_serial_address(self.connection)


PARAMETERS = parameters_of(UmbilicalParameters)
