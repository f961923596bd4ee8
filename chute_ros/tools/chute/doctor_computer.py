"""What can be wrong with this computer and its environment."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from importlib.metadata import distributions
from pathlib import Path

from chute_ros.ros.own_version import own_version
from chute_ros.ros.ros_home import ros_home
from chute_ros.tools.chute.finding import NOTE, OK, WRONG, DoctorFinding
from chute_ros.tools.chute.surroundings import Surroundings

_FAST_DDS = "rmw_fastrtps_cpp"
#: Above, the ports of ROS meet those that Linux gives to other programs.
_HIGHEST_QUIET_DOMAIN = 101
#: The shared memory of ROS nodes of a vehicle, and a black box for some hours, bytes.
LEAST_SHARED, LEAST_DISK = 32_000_000, 1_000_000_000
#: What the nodes import that speaks on a wire or writes a file.
_PACKAGES = (
    "chute_msgs",
    "rclpy",
    "pymavlink",
    "dronecan",
    "python-can",
    "pyserial",
    "mcap",
    "PyYAML",
    "orjson",
)


def environment_findings(around: Surroundings) -> list[DoctorFinding]:
    """The variables that decide whom a process receives."""
    if mistake := around.mistake():
        remedy = "export what is allowed, the same for all nodes of a vehicle, or unset it"
        return [DoctorFinding(WRONG, mistake, remedy)]
    found = [DoctorFinding(OK, f"environment: {around.text()}")]
    if int(around.domain) > _HIGHEST_QUIET_DOMAIN:
        text = f"ROS_DOMAIN_ID is {around.domain}: its ports may be taken by other programs"
        found.append(DoctorFinding(NOTE, text, f"use 0 to {_HIGHEST_QUIET_DOMAIN}"))
    if around.middleware != _FAST_DDS:
        text = f"RMW_IMPLEMENTATION is {around.middleware}: it receives no nodes of another one"
        remedy = f"use the same for all; the settings of chute_ros are for {_FAST_DDS}"
        found.append(DoctorFinding(NOTE, text, remedy))
    return found


def versions(around: Surroundings, fast_dds: tuple[int, int, int] | None) -> dict[str, str | None]:
    """For a report of a fault; None: there is none, or it does not tell. fast_dds: that this
    process has loaded."""
    return {
        "chute_ros": own_version(),
        "ROS": around.distribution or None,
        "Python": platform.python_version(),
        "middleware": around.middleware,
        "Fast DDS": None if fast_dds is None else ".".join(map(str, fast_dds)),
        **{name: _installed(name) for name in _PACKAGES},
        "system": platform.platform(),
    }


def version_finding(of_computer: Mapping[str, str | None]) -> DoctorFinding:
    """The first things that a report of a fault needs."""
    shown = ("chute_ros", "ROS", "Python", "Fast DDS")
    parts = [f"{name} {of_computer[name]}" for name in shown if of_computer[name]]
    return DoctorFinding(OK, f"versions: {', '.join(parts)}")


def _installed(package: str) -> str | None:
    found = next(iter(distributions(name=package)), None)
    return None if found is None else found.version


def shared_memory_finding(folder: Path = Path("/dev/shm")) -> DoctorFinding:
    """Where Fast DDS keeps what nodes on one computer share."""
    remedy = "mount -t tmpfs tmpfs /dev/shm; a container needs --ipc=host or --shm-size=256m"
    return _room(folder, "shared memory", LEAST_SHARED, remedy)


def disk_finding(folder: Path | None) -> DoctorFinding:
    """folder: of the black box, None: where it is by default."""
    folder = folder or ros_home() / "black_box"
    # One that is missing is made where the one above it may be written.
    folder = next(one for one in (folder, *folder.parents) if one.exists())
    remedy = "remove old files, or set black_box_folder to a folder on another disk"
    return _room(folder, "black box", LEAST_DISK, remedy)


def _room(folder: Path, name: str, least: int, remedy: str) -> DoctorFinding:
    if not folder.is_dir():
        return DoctorFinding(WRONG, f"{name}: {folder} is no folder", remedy)
    if not os.access(folder, os.W_OK | os.X_OK):
        return DoctorFinding(WRONG, f"{name}: {folder} may not be written by this user", remedy)
    about = os.statvfs(folder)
    free = about.f_bavail * about.f_frsize
    text = f"{name}: {free / 1e9:.1f} GB free in {folder}"
    if free < least:
        return DoctorFinding(WRONG, f"{text}, need {least / 1e9:g} GB", remedy)
    return DoctorFinding(OK, text)
