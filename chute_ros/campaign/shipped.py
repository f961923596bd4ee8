"""What every flight of a process shares: the settings of supervisors and the tapes, read once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from chute_ros.campaign.scenario import flown_vehicles, part
from chute_ros.campaign.tapes import TapeFile, Tapes
from chute_ros.errors import RecordError
from chute_ros.links.registered import vehicles
from chute_ros.sim.tape import Tape
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.profile_reader import read_profile
from chute_ros.transport.regular_file import read_regular_text


class Shipped:
    """folder: of the profiles; tapes: of bodies; None: none are flown. RecordError: it is no file
    of tapes."""

    def __init__(self, folder: Path, tapes: TapeFile | None = None) -> None:
        self._folder = folder
        self.tapes = None if tapes is None else Tapes(tapes)
        self._configs: dict[tuple[str, str], SupervisorConfig] = {}

    def config(self, vehicle: str, profile: str, standby: bool, rank: int) -> SupervisorConfig:
        """The settings of a supervisor."""
        key = (vehicle, profile)
        if key not in self._configs:
            told = vehicles()[vehicle].supervised
            file = self.profile_file(profile)
            text = read_regular_text(file)
            plain = SupervisorConfig(
                required_links=told("required_links"),
                kill_links=told("kill_links"),
                deploy_links=told("deploy_links"),
                unmonitored_links=told("unmonitored_links", ()),
                deploy_ladder=tuple(Rung.parse(text) for text in told("deploy_ladder", ())),
            )
            self._configs[key] = replace(plain, profile=read_profile(text, str(file), plain.links))
        return replace(self._configs[key], standby=standby, rank=rank)

    def profile_file(self, kind: str) -> Path:
        """The profile by which a vehicle of this kind flies; kind: also the name of its file."""
        return self._folder / (kind if kind.endswith((".yaml", ".yml")) else f"{kind}.yaml")

    def tape(self, name: str) -> Tape:
        """The tape with this name. RecordError: there is none."""
        if self.tapes is None:
            raise RecordError(f"no file with the tape {name!r} was given (--tapes)")
        return self.tapes.named(name)

    def read_all(self) -> None:
        """Now, before processes part that share it."""
        for link in {link for vehicle in flown_vehicles() for link in vehicle.links}:
            part(link).read()
