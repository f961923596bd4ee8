"""What a simulated vehicle consists of: its simulators, their wires and their control sockets."""

from __future__ import annotations

import os
import stat
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path

from chute_ros.errors import NotRegisteredError, ParameterError
from chute_ros.links.api import Sockets, VehicleKind
from chute_ros.links.registered import links, vehicles
from chute_ros.ros.private_files import make_folder
from chute_ros.ros.ros_home import ros_home


@dataclass(frozen=True)
class SimulatedVehicle:
    """name: one of vehicles(); folder: of the control sockets, which nobody else may enter."""

    name: str
    sockets: Sockets
    folder: Path

    @property
    def kind(self) -> VehicleKind:
        """What the links know of it."""
        return vehicles()[self.name]

    def connections(self) -> Mapping[str, str]:
        """Each node's parameter connection."""
        return {name: links()[name].connection(self.sockets) for name in self.kind.links}

    def simulators(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Each simulator's ROS package and its command, which begins with its executable."""
        return tuple(
            (links()[name].package, (*command, "--control", control_path(self.folder, command[0])))
            for name in self.kind.links
            for command in links()[name].simulators(self.kind, self.sockets)
        )


def simulators_of(name: str) -> tuple[str, ...]:
    """The executables of a vehicle's simulators."""
    nowhere = SimulatedVehicle(name, Sockets("", "", "", ""), Path())
    return tuple(command[0] for _, command in nowhere.simulators())


def simulator_module(executable: str) -> str:
    """The module of a simulator, for python -m. NotRegisteredError: it has none, or several."""
    found = {one.module for one in entry_points(group="console_scripts", name=executable)}
    if len(found) != 1:
        raise NotRegisteredError(
            f"simulator {executable} is {' and '.join(sorted(found)) or 'no module'}: need one "
            "module for it among the console_scripts of all packages"
        )
    return found.pop()


def control_path(folder: Path | str, simulator: str) -> str:
    """The control socket of a simulator."""
    return f"{folder}/{simulator}.sock"


def new_home() -> Path:
    """ROS_HOME of one run, for what its nodes keep. Of its own: a vehicle of a run before may be
    without its parachute, and a real one may have the same namespace. ParameterError: it cannot be
    made."""
    runs = ros_home() / "simulations"
    try:
        make_folder(runs)
        return Path(tempfile.mkdtemp(prefix=time.strftime("%Y%m%d_%H%M%S_"), dir=runs))
    except OSError as error:
        raise ParameterError(f"{runs}: {error.strerror or error}: set ROS_HOME") from None


def own_folder(path: Path) -> Path:
    """The folder, made for this user alone. ParameterError: it is there, and another user may
    write to it."""
    try:
        path.mkdir(mode=0o700, exist_ok=True)
    except OSError as error:
        raise ParameterError(f"{path}: {error.strerror}: need a folder for sockets") from None
    about = path.lstat()
    if about.st_uid != os.geteuid() or stat.S_IMODE(about.st_mode) & 0o077:
        raise ParameterError(f"{path} is not for this user alone: remove it, or chmod 700 {path}")
    return path
