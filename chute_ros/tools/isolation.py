"""Keeps a simulation to itself: a ROS domain of its own, this host only, ports free right now.

A simulation must never fire a real vehicle, nor a real one confuse a simulation.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
from collections.abc import Iterator

from domain_coordinator import domain_id

from chute_ros.ros.middleware import LEADS_ELSEWHERE


@contextlib.contextmanager
def isolated_ros() -> Iterator[str]:
    """Set this process's (and its children's) ROS environment; yields a namespace of its own.

    The domain is reserved among all who ask in this way on this host; the namespace keeps us
    apart even from someone who chose the same domain by hand.
    """
    with domain_id(selector=lambda: secrets.randbelow(100) + 1) as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        stay_on_this_host()
        yield f"/sim_{secrets.token_hex(4)}"


def free_tcp_port() -> int:
    """A port of 127.0.0.1 that nobody uses at this moment."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def stay_on_this_host() -> None:
    """Let this process and its children meet nobody on other hosts through ROS."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    for name in LEADS_ELSEWHERE:
        os.environ.pop(name, None)


def free_udp_ports(count: int) -> list[int]:
    """Ports of 127.0.0.1 that nobody uses at this moment."""
    ports = []
    with contextlib.ExitStack() as stack:
        for _ in range(count):
            one = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            one.bind(("127.0.0.1", 0))
            ports.append(one.getsockname()[1])
    return ports
