"""The parameters of umbilical."""

from __future__ import annotations

from dataclasses import dataclass

from chute_ros.links.umbilical.protocol.config import UmbilicalConfig
from chute_ros.settings import Settings, nested, parameter, parameters_of
from chute_ros.transport.address import SERIAL_FORMS


@dataclass(frozen=True)
class UmbilicalParameters(Settings):
    """All parameters of the node; those of its files first."""

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
    link: UmbilicalConfig = nested(UmbilicalConfig())
    publish_vehicle_state: bool = parameter(
        False,
        "publish vehicle/state from telemetry: for a vehicle without an autopilot on another link",
    )


PARAMETERS = parameters_of(UmbilicalParameters)
