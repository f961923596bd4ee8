"""make hosts: writes docs/evidence/hosts.md. As root:

    python3 -m faults [PART ...] [--only WORDS ...]

PART: supervisors, ground, discovery, fleet, packet; none: all. --only: the stories whose names
contain one of these, and nothing is written.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from faults import ground_station_flight, packet, two_supervisors
from faults import ground_station_stories as ground
from faults.ending import take_down_when_ended
from faults.fleet_discovery import search_all
from faults.fleet_discovery import table as discovery_table
from faults.fleet_stories import fly_all as fly_fleets
from faults.fleet_stories import table as fleet_table
from faults.hosts_page import PARTS, with_part
from faults.network import Network, why_not

PAGE = Path(__file__).resolve().parent.parent / "docs" / "evidence" / "hosts.md"
Names = tuple[str, ...]
#: A part's table, and whether everything in it was as it must be.
Outcome = tuple[str, bool]


def _on_hosts(part: Any, names: Names) -> Outcome:
    """The stories of a module, on its hosts."""
    with Network(part.HOSTS) as network:
        network.enter(part.VEHICLE)
        every = part.fly_all(network, names)
    return part.table(every), not any(told.wrong for told in every)


def _ground(names: Names) -> Outcome:
    with Network(ground_station_flight.HOSTS) as network:
        network.enter(ground_station_flight.VEHICLE)
        every = ground.fly_all(network, names)
    return ground.table(every), not any(seen.wrong for _, seen in every)


def _discovery(_: Names) -> Outcome:
    steps = search_all()
    return discovery_table(steps), not any(step.wrong for step in steps)


def _fleet(names: Names) -> Outcome:
    every = fly_fleets(names)
    return fleet_table(every), not any(flown.wrong for flown in every)


_RUN: dict[str, Callable[[Names], Outcome]] = {
    "supervisors": partial(_on_hosts, two_supervisors),
    "ground": _ground,
    "discovery": _discovery,
    "fleet": _fleet,
    "packet": partial(_on_hosts, packet),
}


def main() -> None:
    """Run them; exit code 1 if something went wrong."""
    options = argparse.ArgumentParser("faults")
    options.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}")
    options.add_argument("--only", nargs="+", default=(), metavar="WORDS")
    chosen = options.parse_args()
    for part in chosen.parts:
        if part not in PARTS:
            sys.exit(f"hosts: part {part!r} is not known: need one of {', '.join(PARTS)}")
    if reason := why_not():
        sys.exit(f"hosts: {reason}")
    os.environ |= {
        "ROS_DOMAIN_ID": "0",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        # Shared memory does not care about a network that is cut.
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    }
    take_down_when_ended("hosts")
    wrong = []
    for part in chosen.parts or PARTS:
        before = os.getloadavg()[0]
        text, good = _RUN[part](tuple(chosen.only))
        print(text)
        if not chosen.only:
            page = PAGE.read_text() if PAGE.exists() else ""
            PAGE.write_text(with_part(page, part, text, before))
        if not good:
            wrong.append(part)
    if wrong:
        sys.exit(f"hosts: wrong results: {', '.join(wrong)}")


if __name__ == "__main__":
    main()
