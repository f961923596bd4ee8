"""The parameters of upf_can, and the settings that they do not give."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.runtime import UpfSettings
from chute_ros.settings import Settings, nested, parameter, parameters_of
from chute_ros.transport.can_address import CAN_FORMS, parse_can_address


@dataclass(frozen=True)
class UpfParameters(Settings):
    """All parameters of the node; first those of its connection and files."""

    connection: str = parameter("mcast:0", f"address of the CAN bus: {CAN_FORMS}")
    bitrate: int = parameter(
        0, "bit rate of the bus; 0: as the interface is set up", 0, 8_000_000, "bit/s"
    )
    dsdl_path: str = parameter(
        "", "folder flyfire with the vendor's own data types (*.uavcan); empty: the shipped ones"
    )
    allocation_table_file: str = parameter(
        "",
        "file for the node ids that were given out; empty: in chute_ros under ROS_HOME (~/.ros)",
    )
    runtime: UpfSettings = nested(UpfSettings())

    def __post_init__(self) -> None:
        super().__post_init__()
        parse_can_address(self.connection, self.bitrate)


PARAMETERS = parameters_of(UpfParameters)


def config_from(
    link: UpfConfig, table: Mapping[bytes, int], node_name: str, utc_offset: float
) -> UpfConfig:
    """The settings of the protocol. node_name: fully qualified; utc_offset: UTC minus monotonic
    time, s."""
    return replace(
        link, unique_id=_unique_id(node_name), allocation_table=table, utc_offset=utc_offset
    )


def _unique_id(node_name: str) -> bytes:
    """Sixteen bytes that are the same at each start, and of this node on this machine alone."""
    machine = Path("/etc/machine-id")
    text = machine.read_text() if machine.is_file() else ""
    return sha256(f"chute_ros {text} {node_name}".encode()).digest()[:16]
