"""make hosts: writes docs/hosts.md. As root: python3 -m faults [PART OF A STORY'S NAME ...]"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from bench.report import load, machine
from faults import two_supervisors
from faults.network import Network, why_not

PAGE = Path(__file__).resolve().parent.parent / "docs" / "hosts.md"
_PAGE = """\
# Several hosts

Written by `make hosts`. The numbers belong to the machine that made them:
{machine}. {load}

Each host is a network namespace of its own; a switch in user space (`faults/switch.py`) joins
them, whose cables are cut, slowed, made lossy or one-way. All processes are the real ones.

## Two supervisors

The vehicle, with `mavlink_parachute`, an autopilot and a parachute, is one host; two supervisors
with `hot_standby` are the two others. In flight a cable is spoilt, then a motor fails. Times: from
the spoiling to the takeover; from the motor's failure to the kill on the wire and to the
parachute's own "deployed"; from the healing until one leads and the other follows. In each story:
one deploy was acted on, after the kill, and none by the order of an older leader.

{supervisors}
"""


def main() -> None:
    """Fly them; exit code 1 if something went wrong."""
    if reason := why_not():
        sys.exit(f"hosts: {reason}")
    os.environ |= {
        "ROS_DOMAIN_ID": "0",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        # Shared memory does not care about a network that is cut.
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    }
    before = load()
    with Network(two_supervisors.HOSTS) as network:
        network.enter(two_supervisors.VEHICLE)
        every = two_supervisors.fly_all(network, tuple(sys.argv[1:]))
    text = two_supervisors.table(every)
    print(text)
    if not sys.argv[1:]:
        PAGE.write_text(_PAGE.format(machine=machine(), load=before, supervisors=text))
    if any(told.wrong for told in every):
        sys.exit("hosts: not everything went as it must")


if __name__ == "__main__":
    main()
