"""docs/evidence/hosts.md: each part is written by itself, and keeps its place among the others."""

from __future__ import annotations

from chute_ros.tools import pages
from chute_ros.tools.machine import machine

_HEAD = """\
# Several hosts

Written by `make hosts`; each part can be written alone (`make hosts PARTS=fleet`). The numbers
belong to the machine that made them: {machine}.

Each host is a network namespace of its own; a switch in user space (`faults/switch.py`) joins
them, whose cables are cut, slowed, made lossy, one-way or rid of multicast. All processes are the
real ones. The rules for a user are in [fleet.md](../guide/fleet.md).
"""
#: Heading and explanation of each part.
PARTS = {
    "supervisors": """\
## Two supervisors

The vehicle, with `mavlink_parachute`, an autopilot and a parachute, is one host; two supervisors
with `hot_standby` are the two others. In flight a cable is disturbed, then a motor fails. Times:
from the disturbance to the takeover; from the motor's failure to the kill on the wire and to the
parachute's own "deployed"; from the repair until one leads and the other follows. In each story:
one deploy was acted on, after the kill, and none by the order of an older leader.
""",
    "ground": """\
## Vehicle and ground station

The vehicle, with its nodes, autopilot and parachute, is one host; the ground station, a node that
sees `safety/state`, `parachute/status` and `/diagnostics` and calls the services under `safety/`,
is the other, and its cable is disturbed. Times: from the operator's call (if a motor fails: from
the failure) to the release or the kill on the wire; from the call to the answer, the last answer
if there are several; from the repair, or from the start of a second ground station, until the
vehicle's state is seen. In each story: at most one deploy was acted on, after the kill.
""",
    "discovery": """\
## Discovery servers

Two vehicles on a host with a discovery server of its own, and ground stations on another, with
another; no multicast passes between the two. All have `ROS_DISCOVERY_SERVER` set as
[fleet.md](../guide/fleet.md) says, unless a row names another value. Times: from the start of that
ground station, from the server's death or return, from the motor's failure, from the healing.
""",
    "fleet": """\
## A fleet

Vehicles on hosts of five each, under one ground station on a host of its own; where there are
discovery servers, no multicast passes. Each vehicle has a `mavlink_parachute` and a
`safety_supervisor`; one process a host simulates the autopilots and parachutes. "slowed":
`heartbeat_rate` and `autopilot_message_rate` 2 instead of 10, and limits to fit. While all fly,
10 s are measured: processor (100 % is one core), memory, the load of the ground station's cable,
and how often its view of a vehicle was silent for more than 1.5 s ("gaps"). Then a motor of one
vehicle fails, and the operator deploys another (of several): no other may kill or deploy, and the
ground station must see just that. "all seen": from the start of another ground station until it
has every vehicle's state. "updates late": of all supervisors, since their start, and how many of
them reported it in `/diagnostics`. "busy": 16 processes that only compute run beside the fleet,
from 10 s before the motor's failure to the end.
""",
    "packet": """\
## One packet too much

Fast DDS 2.14.5, which the wheels of Jazzy have, takes memory for as long as there is any for one
packet of 68 bytes (CVE-2025-64438; [security.md](../guide/security.md) explains it and its fix). A
stranger on the vehicle's network listens for its nodes and sends the packet once, in flight, or to
each process that is started in place of one that it has ended. A process that ends is restarted
after 0.5 s, as by `launch/vehicle.launch.py`. Times: from the (last) packet to the end of the
process, and until its flight continues; from the motor's failure to the parachute's own
"deployed". "keep to the host": `ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST`.
""",
}


def with_part(page: str, part: str, table: str, load: float) -> str:
    """The page with this part written anew; the others as page has them, if it has them."""
    text = f"{PARTS[part]}\nLoad before the run: {load:.1f} (of the last minute).\n\n{table}"
    return f"{_HEAD.format(machine=machine())}\n{pages.with_part(page, 'part', part, text, PARTS)}"
