"""What every flight of a process shares: profiles, settings, data types and layouts, read once."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path

from chute_ros.campaign.device_nodes import MAVLINK_NODE, UMBILICAL_NODE, UPF_NODE
from chute_ros.campaign.scenario import Vehicle
from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.protocol.dronecan.data_types import DataTypes
from chute_ros.supervisor.config import TRIGGER, Rung, SupervisorConfig
from chute_ros.supervisor.profile_reader import read_profile
from chute_ros.transport.data_types import load_data_types

_UPF_LADDER = (Rung(UPF_NODE), Rung(UPF_NODE, TRIGGER))
#: As config/*_vehicle.yaml has them: links that are required, that kill, that deploy; the ladder.
_VEHICLES = {
    Vehicle.MAVLINK: ((MAVLINK_NODE,), (MAVLINK_NODE,), (MAVLINK_NODE,), ()),
    Vehicle.UPF: ((MAVLINK_NODE, UPF_NODE), (MAVLINK_NODE,), (UPF_NODE,), _UPF_LADDER),
    Vehicle.BOTH: (
        *((MAVLINK_NODE, UPF_NODE), (MAVLINK_NODE,), (MAVLINK_NODE, UPF_NODE)),
        (Rung(MAVLINK_NODE), *_UPF_LADDER),
    ),
    Vehicle.ROCKET: ((UMBILICAL_NODE,), (UMBILICAL_NODE,), (UMBILICAL_NODE,), ()),
}


class Shipped:
    """folder: of the profiles."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._configs: dict[tuple[Vehicle, str], SupervisorConfig] = {}

    def config(self, vehicle: Vehicle, profile: str, standby: bool, rank: int) -> SupervisorConfig:
        """The settings of a supervisor."""
        key = (vehicle, profile)
        if key not in self._configs:
            required, kill, deploy, ladder = _VEHICLES[vehicle]
            text = (self._folder / f"{profile}.yaml").read_text(encoding="utf-8")
            plain = SupervisorConfig(required, kill, deploy, ladder)
            self._configs[key] = replace(plain, profile=read_profile(text, profile, plain.links))
        return replace(self._configs[key], standby=standby, rank=rank)

    def read_all(self) -> None:
        """Now, before processes part that share it."""
        for part in (self.definitions, self.layouts):
            assert part is not None

    @functools.cached_property
    def types(self) -> DataTypes:
        """Of the CAN bus."""
        return load_data_types("", "the data types")

    @functools.cached_property
    def definitions(self) -> Definitions:
        """Of the UPF parachute."""
        return Definitions(self.types)

    @functools.cached_property
    def layouts(self) -> list[Layout]:
        """Of $TELEM."""
        return load_layouts("", "the layouts")
