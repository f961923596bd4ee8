"""Who is where in a fleet, and how what happened to it is read."""

import subprocess
import sys
from pathlib import Path

import pytest

from faults.discovery_server import PORT, DiscoveryServers
from faults.fleet import first_times, host_of, hosts_for
from faults.fleet_load import usage
from faults.fleet_stories import SIZES, gaps
from faults.network import Network

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "guide" / "fleet.md"
SAID = """\
100.500000 3 ARMED
101.250000 3 MOTOR FAILURE at 40.0 m
102.000000 13 CANOPY at 40.0 m
102.100000 3 FLIGHT TERMINATION at 36.1 m
102.200000 3 CANOPY at 35.2 m
102.300000 3 CANOPY at 35.0 m
"""


@pytest.mark.parametrize(("count", "hosts"), [(1, 1), (5, 1), (6, 2), (20, 4)])
def test_five_vehicles_share_a_host(count, hosts):
    assert len(hosts_for(count)) == 1 + hosts
    assert {host_of(n) for n in range(1, count + 1)} == set(hosts_for(count)[1:])


def test_what_a_vehicle_did_is_told_apart_from_what_others_did():
    assert first_times(SAID, "CANOPY") == {13: 102.0, 3: 102.2}
    assert first_times(SAID, "FLIGHT TERMINATION") == {3: 102.1}


def test_who_falls_and_who_is_deployed_are_two_vehicles():
    for size in SIZES:
        assert size.fails != size.deployed
        assert 1 <= size.fails <= size.count
        assert size.deployed <= size.count


def test_the_guide_has_a_user_set_what_the_runs_have_set(tmp_path):
    servers = DiscoveryServers(Network(hosts_for(1)), tmp_path)
    guide = GUIDE.read_text()
    for set_for in (servers.of_vehicles, servers.of_ground):
        ((name, value),) = set_for.items()
        assert f'export {name}="{value}"' in guide
    for number, address in enumerate(("127.0.0.1", "10.77.0.1")):
        assert f"fast-discovery-server -i {number} -l {address} -p {PORT} " in guide


def test_a_picture_that_was_silent_for_too_long_is_a_gap():
    told = [
        {"at": at, "vehicle": vehicle}
        for at, vehicle in [(0.5, "/drone1"), (1.5, "/drone1"), (2.2, "/drone2"), (3.6, "/drone1")]
    ]
    assert gaps(told, since=0.0) == 2, "drone2 came late at first, drone1 once later"


def test_a_child_is_counted_as_what_its_command_says(await_until):
    assert usage()["switch"].processes == 0
    command = [sys.executable, "-c", "input()", "-m", "faults.switch"]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as child:
        await_until(lambda: usage()["switch"].processes == 1, "the child is counted")
        await_until(lambda: usage()["switch"].memory > 1.0, "it has memory")
        child.kill()
    assert usage()["switch"].processes == 0
