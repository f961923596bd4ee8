"""sim_upf as an executable: on a real bus, without ROS, with every mistake told in one line."""

import select
import sys
import time
from pathlib import Path

import pytest
from test_command_line import environment, start  # noqa: F401 (fixtures)

from chute_ros.links.upf.protocol.definitions import PARACHUTE_STATUS, TRIGGER_STATUS, Definitions
from chute_ros.links.upf.simulator import sim_upf
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.sim.autopilot_device import AutopilotDevice
from chute_ros.sim.vehicle_sense import VehicleSense
from chute_ros.tools.isolation import free_udp_ports
from chute_ros.transport.can_address import parse_can_address
from chute_ros.transport.can_wire import make_can_wire
from chute_ros.transport.data_types import load_data_types

MODULE = sim_upf.__name__
#: Named, so that ROS is not asked where the shipped ones are.
FOLDER = str(Path(__file__).parents[4] / "msg_defs" / "dsdl" / "flyfire")


@pytest.fixture
def bus():
    """Somebody who listens on a bus of his own: (connection, endpoint, hear)."""
    connection = f"mcast:0:{free_udp_ports(1)[0]}"
    wire = make_can_wire(parse_can_address(connection))
    wire.open()
    endpoint = Endpoint(Definitions(load_data_types(FOLDER, "test")).types, 10)

    def hear(name, seconds=20.0):
        """The next message of this type."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            select.select(wire.files(), [], [], 0.1)
            for data, _ in wire.read(wire.files()[0]):
                heard = endpoint.receive(data, time.monotonic())
                if heard is not None and heard.name == name:
                    return heard
        raise AssertionError(f"no {name} within {seconds:g} s")

    yield connection, endpoint, hear
    wire.close()


def options(connection, *more):
    return ("--connection", connection, "--dsdl-path", FOLDER, *more)


def test_it_speaks_on_the_bus_without_ros(bus, start):  # noqa: F811
    connection, _, hear = bus
    start(MODULE, *options(connection))
    assert hear(PARACHUTE_STATUS).source == 33
    assert hear(TRIGGER_STATUS).source == 34


def test_node_ids_and_errors_can_be_chosen(bus, start):  # noqa: F811
    connection, endpoint, hear = bus
    more = ("--controller-node-id", "40", "--no-trigger", "--error", "LOW_POWER")
    start(MODULE, *options(connection, *more))
    status = hear(PARACHUTE_STATUS)
    assert status.source == 40
    constants = endpoint.types.message(PARACHUTE_STATUS).constants
    while status.values["state"] != constants["STATE_ABNORMAL"]:
        status = hear(PARACHUTE_STATUS)
    assert status.values["error_flags"] & constants["ERROR_LOW_POWER"]


MISTAKES = [
    ("--parameter", "Enable Lite=false", "Enable Light"),
    (
        *("--parameter", "Enable Light=perhaps"),
        "--parameter 'Enable Light=perhaps': Enable Light cannot be 'perhaps': need true or",
    ),
    ("--parameter", "Static Node ID=many", "need a number"),
    (
        *("--parameter", "Static Node ID=999"),
        "--parameter 'Static Node ID=999': Static Node ID cannot be 999: need 0 to 125",
    ),
    ("--parameter", "Static Node ID=-1", "cannot be -1: need 0 to 125"),
    ("--parameter", "Parachute Status Interval(ms)=0", "cannot be 0: need 2 to 60000"),
    ("--parameter", "Parachute Status Interval(ms)=-5", "cannot be -5: need 2 to 60000"),
    ("--parameter", "Node Status Interval(ms)=0", "cannot be 0: need 2 to 1000"),
    ("--error", "NOTHING", "LOW_POWER"),
    ("--no-controller", "--no-trigger", "nothing to simulate"),
    ("--at", "1:explode", "need one of"),
    ("--at", "1:error=TIRED", "is no argument of error: need error=one of "),
    ("--minimum-height", "nan", "--minimum-height: m 'nan': need 0 to 10000"),
    ("--minimum-height", "-1", "--minimum-height: m '-1': need 0 to 10000"),
    ("--half", "2", "need 0 to 1"),
    ("--connection", "can0", "INTERFACE:CHANNEL"),
    ("--dsdl-path", "/nowhere", "/nowhere"),
]


@pytest.mark.parametrize(("option", "value", "told"), MISTAKES)
def test_a_mistake_is_told_in_one_line(option, value, told, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["sim_upf", "--dsdl-path", FOLDER, option, value])
    with pytest.raises(SystemExit) as ended:
        sim_upf.main()
    assert ended.value.code == 2
    assert told in capsys.readouterr().err.splitlines()[-1]


def test_it_feels_the_simulated_vehicle_and_opens_its_canopy():
    """Given an autopilot in hover: what is felt is its motion; once the parachute is out, it
    falls under a canopy. In virtual time, with the frames of both handed to and fro."""
    felt, out = [], []
    sense = VehicleSense(1, felt.append, lambda: bool(out))
    autopilot = AutopilotDevice(1, [])
    autopilot.update(0.0)
    autopilot.model.armed = True
    autopilot.model.height = autopilot.model.target_height = 50.0

    def run(begin, end):
        for step in range(int(begin * 100), int(end * 100)):
            now = step / 100.0
            for device, other in ((sense, autopilot), (autopilot, sense)):
                device.update(now)
                for data in device.take_output():
                    other.receive(data, now)

    run(0.0, 3.0)
    assert felt[-1].height == pytest.approx(50.0, abs=0.5)
    assert felt[-1].acceleration == pytest.approx(9.8, abs=0.3)
    assert len(felt) > 60, "it has asked for more than the few that come by themselves"
    assert autopilot.model.canopy == 0.0
    autopilot.model.motors_failed = True
    run(3.0, 3.5)
    assert felt[-1].acceleration < 3.0, "free fall"
    out.append(True)
    run(3.5, 6.0)
    assert autopilot.model.canopy == 1.0
