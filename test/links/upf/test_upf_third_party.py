"""upf_can and its simulated devices, as the dronecan library with its own driver sees them."""

import contextlib
import json
import os
import secrets
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from chute_msgs.msg import ActionReport, SafetyRequest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from node_bench import stamped
from upf_bench import PATIENT, Devices, Network, tasks, vehicle_state

from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import NODE_ID
from chute_ros.model import Action, Outcome
from chute_ros.ros import qos

SCRIPT = Path(__file__).with_name("upf_third_party.py")
DSDL = Path(__file__).parents[3] / "msg_defs" / "dsdl" / "flyfire"
#: For a process that imports, parses and speaks slowly, s.
SLOW = 90.0


class ThirdParty:
    """The program, in a session of its own: its driver forks a process that must not be left."""

    def __init__(self, bench, bus, story):
        self.bench = bench
        self.process = subprocess.Popen(
            [sys.executable, str(SCRIPT), str(DSDL), str(bus), story],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        os.set_blocking(self.process.stdout.fileno(), False)
        self._text = b""

    def said(self):
        """The objects that it wrote so far."""
        self._text += self.process.stdout.read() or b""
        lines = self._text.split(b"\n")[:-1]
        return [json.loads(line) for line in lines]

    def await_end(self):
        """All that it has seen."""
        self.bench.until(lambda: self.said() is not None and self.ended(), "it ends", SLOW)
        assert self.process.returncode == 0, self.process.stderr.read().decode()
        return self.said()

    def ended(self):
        return self.process.poll() is not None

    def kill(self):
        """It and what it has forked."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self.process.stdout.close()
        self.process.stderr.close()
        end = time.monotonic() + SLOW
        while members(self.process.pid):
            assert time.monotonic() < end, "a process is left"


def members(session):
    """Processes of a session that still run."""
    found = []
    for folder in Path("/proc").iterdir():
        with contextlib.suppress(OSError, IndexError):
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            if folder.name.isdigit() and int(fields[3]) == session and fields[0] != "Z":
                found.append(folder.name)
    return found


@pytest.fixture
def bus():
    """The driver has one port for all: a bus that nobody else has drawn."""
    return 20 + secrets.randbelow(230)


@pytest.fixture
def network(bench, bus, tmp_path):
    return Network(
        bench,
        connection=f"mcast:{bus}",
        allocation_table_file=str(tmp_path / "ids.json"),
        vehicle_service_timeout=60.0,
        vehicle_state_age=60.0,
        **PATIENT,
    )


@pytest.fixture
def party(bench, bus):
    """Starts a story."""
    started = []

    def start(story):
        started.append(ThirdParty(bench, bus, story))
        return started[-1]

    yield start
    for one in started:
        one.kill()


def test_it_sees_all_three_nodes_and_reads_what_ours_says(bench, network, party):
    devices = Devices(network)
    message = vehicle_state(
        bench,
        landed_state=2,
        landed_state_age=0.0,
        height=42.5,
        height_age=0.0,
        vertical_speed=-1.5,
        vertical_speed_age=0.0,
    )
    bench.publish(message, "vehicle/state")
    bench.until(lambda: network.link._vehicle._state.height == 42.5, "it is heard")
    seen = party("watch").await_end()
    nodes = {one.pop("node"): one for one in seen if "node" in one}
    assert nodes.keys() >= {NODE_ID, 33, 34}
    assert nodes[NODE_ID]["name"] == "org.chute_ros.upf_can"
    assert nodes[NODE_ID]["unique_id"] == network.link.config.unique_id.hex()
    for node_id, one in ((33, devices.controller), (34, devices.trigger)):
        assert nodes[node_id]["name"] == one.settings.name
        assert nodes[node_id]["unique_id"] == one.settings.unique_id.hex()
    (status,) = (one for one in seen if "health" in one)
    assert (status["health"], status["mode"]) == (0, 0)
    assert status["uptime"] >= 0
    assert (status["state"], status["height"], status["vz"]) == (2, 42.5, -1.5)
    assert status["connected"]
    assert abs(status["time"] * 1e-6 - time.time()) < 3600.0, "UTC, as our clock has it"
    (stats,) = (one for one in seen if "transfers_tx" in one)
    assert stats["transfers_tx"] > 5
    assert stats["transfers_rx"] > 5
    assert {"restart": False} in seen, "nobody on the bus restarts a safety node"


def test_its_parameter_editor_works_with_the_simulated_controller(bench, network, party):
    devices = Devices(network)
    started = devices.controller.booted_at
    before = dict(devices.controller.values)
    seen = party("edit").await_end()
    (listed,) = (one["listed"] for one in seen if "listed" in one)
    assert [name for name, _, _ in listed] == list(before)
    kinds = {bool: "boolean_value", int: "integer_value"}
    assert [union for _, union, _ in listed] == [kinds[type(one)] for one in before.values()]
    assert [value for _, _, value in listed] == [int(one) for one in before.values()]
    assert [one["set"] for one in seen if "set" in one] == [
        [p.AUTO_SAVE, "boolean_value", 0],
        [p.LIGHT, "boolean_value", 0],
    ]
    assert {"saved": True} in seen
    assert [one["restart"] for one in seen if "restart" in one] == [False, True]
    assert devices.controller.booted_at > started
    assert {"get": [p.LIGHT, "boolean_value", 0]} in seen, "it was kept over the restart"


def test_its_kill_switch_is_answered_once_the_motors_are_off(bench, network, party):
    asked = bench.follow(SafetyRequest, "safety/request")
    one = party("kill")
    bench.until(lambda: asked or one.ended(), "the supervisor is asked", SLOW)
    assert (asked[-1].request, asked[-1].device) == (SafetyRequest.KILL, "60")
    assert one.said() == [{"bad": True}], "not answered yet"
    report = ActionReport(
        action=int(Action.KILL), outcome=int(Outcome.CONFIRMED), link="mavlink_parachute"
    )
    bench.publish(stamped(bench.client, report), "safety/action", qos.DECISION)
    assert one.await_end() == [{"bad": True}, {"success": True}]


@pytest.mark.parametrize("allocator", [True, "auto"])
def test_beside_its_allocator_ours_is_silent_and_says_so(bench, bus, tmp_path, party, allocator):
    """An error where ours was switched on, and as it is meant to be by default."""
    path = tmp_path / "ids.json"
    network = Network(
        bench,
        connection=f"mcast:{bus}",
        allocator=allocator,
        allocation_table_file=str(path),
        **PATIENT,
    )
    diagnostics = bench.follow(DiagnosticArray, "/diagnostics")
    one = party("allocate")
    bench.until(lambda: network.link.bus.nodes.get(60) or one.ended(), "it is heard", SLOW)
    trigger = network.trigger(**{p.STATIC_NODE_ID: 0})
    network.plug(trigger)
    bench.until(lambda: trigger.node_id or one.ended(), "it is given a node id", SLOW)
    assert trigger.node_id
    assert not path.exists(), "not by us"
    said = "node 60 gives out node ids"

    def told():
        found = tasks(diagnostics).get("node ids" if allocator == "auto" else "link")
        wanted = said if allocator == "auto" else f"{said} as well"
        return found and wanted in found.message and found

    task = bench.until(told, "diagnostics say so")
    if allocator == "auto":
        assert (task.level, task.message) == (DiagnosticStatus.OK, said)
        assert said not in tasks(diagnostics)["link"].message
    else:
        assert task.level == DiagnosticStatus.ERROR
