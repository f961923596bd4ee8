"""What every flight of a process shares: the settings of supervisors, read once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from chute_ros.campaign.scenario import flown_vehicles, part
from chute_ros.links.registered import vehicles
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.profile_reader import read_profile


class Shipped:
    """folder: of the profiles."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._configs: dict[tuple[str, str], SupervisorConfig] = {}

    def config(self, vehicle: str, profile: str, standby: bool, rank: int) -> SupervisorConfig:
        """The settings of a supervisor."""
        key = (vehicle, profile)
        if key not in self._configs:
            told = vehicles()[vehicle].supervised
            text = (self._folder / f"{profile}.yaml").read_text(encoding="utf-8")
            plain = SupervisorConfig(
                required_links=told("required_links"),
                kill_links=told("kill_links"),
                deploy_links=told("deploy_links"),
                unmonitored_links=told("unmonitored_links", ()),
                deploy_ladder=tuple(Rung.parse(text) for text in told("deploy_ladder", ())),
            )
            self._configs[key] = replace(plain, profile=read_profile(text, profile, plain.links))
        return replace(self._configs[key], standby=standby, rank=rank)

    def read_all(self) -> None:
        """Now, before processes part that share it."""
        for link in {link for vehicle in flown_vehicles() for link in vehicle.links}:
            part(link).read()
