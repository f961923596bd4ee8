"""The environment variables that decide whom a process receives, as the user set them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from ament_index_python import get_resources

from chute_ros.ros.middleware import LEADS_ELSEWHERE, RANGE

#: Fast DDS has no ports for a higher domain.
_HIGHEST_DOMAIN = 232
_RANGES = ("OFF", "LOCALHOST", "SUBNET", "SYSTEM_DEFAULT")
_OLD_RANGE = "ROS_LOCALHOST_ONLY"
_DEFAULT_RANGE, _OLD_LOCALHOST = "SUBNET (the default)", f"LOCALHOST ({_OLD_RANGE})"


@dataclass(frozen=True)
class Surroundings:
    """Before set_up_middleware, which changes them. others: what else leads to other hosts;
    installed: the middlewares that there are."""

    domain: str
    discovery_range: str
    middleware: str
    distribution: str
    others: tuple[str, ...]
    installed: tuple[str, ...]

    def mistake(self) -> str:
        """Why no process can start in it; empty: one can."""
        domain = self.domain
        whole = domain.isascii() and domain.isdigit() and int(domain[:9]) <= _HIGHEST_DOMAIN
        if not whole:
            need = f"need a whole number from 0 to {_HIGHEST_DOMAIN}"
            return f"ROS_DOMAIN_ID is {domain[:40]!r}: {need}"
        if self.discovery_range not in (*_RANGES, _DEFAULT_RANGE, _OLD_LOCALHOST):
            need = f"need {', '.join(_RANGES[:-1])} or {_RANGES[-1]}"
            return f"{RANGE} is {self.discovery_range[:40]!r}: {need}"
        if self.installed and self.middleware not in self.installed:
            # ROS ends the process without asking.
            need = f"need one that is installed: {', '.join(self.installed)}"
            return f"RMW_IMPLEMENTATION is {self.middleware[:40]!r}: {need}"
        return ""

    def text(self) -> str:
        """In words."""
        parts = [
            f"ROS domain {self.domain}",
            f"discovery range {self.discovery_range}",
            self.middleware,
            *self.others,
        ]
        return ", ".join(parts)


def installed_middlewares() -> list[str]:
    """Their names, as RMW_IMPLEMENTATION takes them."""
    return sorted(get_resources("rmw_typesupport").keys() - {"rmw_implementation"})


def surroundings(environment: Mapping[str, str], installed: Collection[str]) -> Surroundings:
    """Of this environment."""
    given = environment.get(RANGE) or _DEFAULT_RANGE
    if environment.get(_OLD_RANGE) == "1":
        given = _OLD_LOCALHOST
    return Surroundings(
        environment.get("ROS_DOMAIN_ID") or "0",
        given,
        environment.get("RMW_IMPLEMENTATION") or "rmw_fastrtps_cpp",
        environment.get("ROS_DISTRO") or "",
        tuple(f"{name}={environment[name]}" for name in LEADS_ELSEWHERE if environment.get(name)),
        tuple(installed),
    )
