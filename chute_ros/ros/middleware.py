"""Transport of Fast DDS between our processes, unless the user sets another.

Over UDP, on one host too: what a process left in shared memory that was killed, or that ran out of
descriptors, kept processes that were started after it from hearing some of the others for 20 s and
more, until a supervisor that was back in flight did not see what it had to deploy for (`make soak`
showed it). And what a network loses is sent again at once.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from chute_ros.ros.config_folder import config_folder

#: Where Fast DDS looks for settings, and what is shipped for it: from version 3 (Kilted) on, and
#: in version 2.
_SETTINGS = ("FASTDDS_DEFAULT_PROFILES_FILE", "fastdds")
_SETTINGS_2 = ("FASTRTPS_DEFAULT_PROFILES_FILE", "fastrtps")
_WITH_VERSION_2 = ("humble", "iron", "jazzy")
_TRANSPORTS = ("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
#: Who may hear a process.
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_OLD_RANGE, _PEERS = "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS"
#: What a ground station sets to meet a vehicle, on other hosts as well, whatever the range is: a
#: simulation must have none of it.
LEADS_ELSEWHERE = (_PEERS, "ROS_DISCOVERY_SERVER", _SETTINGS[0], _SETTINGS_2[0])


def set_up_middleware() -> None:
    """Before rclpy.init, for this process and those that it starts. Another middleware does not
    look at it."""
    if any(name in os.environ for name, _ in (_SETTINGS, _SETTINGS_2)):
        return
    os.environ.setdefault(*_TRANSPORTS)
    # Version 3 reads the old variable as well, and does not understand the old file.
    old = os.environ.get("ROS_DISTRO") in _WITH_VERSION_2
    variable, name = _SETTINGS_2 if old else _SETTINGS
    if _keeps_to_this_host():
        # rmw_fastrtps adds shared memory to LOCALHOST, whatever the settings say; this file keeps
        # to this host as well.
        name += "_localhost"
        os.environ[RANGE] = "SUBNET"
        os.environ.pop(_OLD_RANGE, None)
    os.environ[variable] = str(config_folder() / f"{name}.xml")


def _keeps_to_this_host() -> bool:
    if os.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp") != "rmw_fastrtps_cpp":
        return False
    only = os.environ.get(_OLD_RANGE) == "1" or os.environ.get(RANGE) == "LOCALHOST"
    # Peers elsewhere that are named are to be heard all the same.
    return only and not os.environ.get(_PEERS)


#: In each line of Fast DDS that is kept, the first version without a published hole by which one
#: packet ends a process (release notes of eProsima/Fast-DDS, read on 2026-11-27; the holes:
#: safety_case/supply.yaml).
CURED = ((2, 6, 12), (2, 14, 7), (3, 2, 5))
#: The newest line that had none then.
_NEWEST_OPEN = (3, 6)
_LIBRARY = re.compile(r"\S*/libfast(?:rtps|dds)\.so\.\d+\.\d+[.\d]*")


def fast_dds(maps: Path = Path("/proc/self/maps")) -> tuple[int, int, int] | None:
    """The version of Fast DDS that this process has loaded; None: none, or it does not tell."""
    try:
        found = _LIBRARY.search(maps.read_text(errors="replace"))
        if found is None:
            return None
        # Loaded is a copy or a link named by two numbers; the file of all three lies beside it.
        loaded = Path(found[0])
        names = [loaded.name, *(one.name for one in loaded.parent.glob(f"{loaded.name}.*"))]
    except OSError:
        return None
    versions = [name.rpartition(".so.")[2].split(".") for name in names]
    whole = [one for one in versions if len(one) == 3 and all(map(str.isdigit, one))]
    return (int(whole[0][0]), int(whole[0][1]), int(whole[0][2])) if whole else None


def is_cured(version: tuple[int, int, int]) -> bool:
    """Is no hole of this version published by which one packet ends a process?"""
    lines = {cured[:2]: cured for cured in CURED}
    line = version[:2]
    return version >= lines[line] if line in lines else line > _NEWEST_OPEN


def is_local() -> bool:
    """Do this process's settings, set_up_middleware's, keep it to this host?"""
    return any(
        os.environ.get(variable, "").endswith(f"/{name}_localhost.xml")
        for variable, name in (_SETTINGS, _SETTINGS_2)
    )
