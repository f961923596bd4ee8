"""The parameters of mavlink_parachute."""

from __future__ import annotations

from dataclasses import dataclass

from chute_ros.links.mavlink.runtime import MavlinkSettings
from chute_ros.settings import Settings, nested, parameter, parameters_of
from chute_ros.transport.address import FORMS, parse_address


@dataclass(frozen=True)
class MavlinkParameters(Settings):
    """All parameters of the node; first those of its connection."""

    connection: str = parameter(
        "udppair:127.0.0.1:14541:127.0.0.1:14540", f"address of the MAVLink network: {FORMS}"
    )
    signing_key_file: str = parameter(
        "",
        "file with the MAVLink signing key (32 bytes or 64 hexadecimal digits); empty: no signing",
    )
    signing_link_id: int = parameter(0, "link id in the signatures of this node", 0, 255)
    runtime: MavlinkSettings = nested(MavlinkSettings())

    def __post_init__(self) -> None:
        super().__post_init__()
        parse_address(self.connection)


PARAMETERS = parameters_of(MavlinkParameters)
