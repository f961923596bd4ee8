"""Our node and nodes of the dronecan library on one bus: each understands the other."""

import json
import subprocess
import sys

import pytest
from dronecan_bench import FLYFIRE, REFERENCE, UID

PROGRAM = REFERENCE.with_name("dronecan_second_party.py")
OTHER = bytes(range(100, 116)).hex()


@pytest.fixture(scope="module")
def came():
    """Story -> what each party saw: see the program."""
    done = subprocess.run(
        [sys.executable, PROGRAM, FLYFIRE], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


def test_the_librarys_node_monitor_finds_us_and_we_find_it(came):
    seen = came["who is there"]
    assert seen["seen_by_the_library"] == [10, "org.test.us", UID.hex(), 2]
    assert seen["seen_by_us"] == [50, "org.test.library", OTHER, 2]
    assert seen["counts"] == {}


def test_its_requests_are_served_or_refused(came):
    served = came["what is served"]
    assert "transfers_tx=2, transfers_rx=1, transfer_errors=0" in served["stats"]
    assert "ok=False" in served["restart"]
    assert "ok=False" in served["opcode"]
    assert "(value=uavcan.protocol.param.Value(empty=" in served["parameter"]
    assert served["shell"] is None


def test_it_answers_our_requests_and_its_parachute_is_heard(came):
    assert came["what we ask"]["list"] == [
        ["parameter 0", {"integer_value": 0}],
        ["parameter 1", {"integer_value": -1}],
        ["parameter 2", {"integer_value": -2}],
        ["", {"empty": {}}],
    ]
    kind, name, source, values = came["what we ask"]["heard"]
    assert (kind, name, source) == ("MESSAGE", "flyfire.ParachuteStatus", 50)
    assert (values["state"], values["height_of_home"]) == (4, 12.5)
    assert (values["is_vehicle_connected"], values["is_enable_auto_launch"]) == (True, False)


def test_it_hears_the_time_of_the_bus(came):
    first, second, third = came["time"]
    assert first == 0
    assert third - second == pytest.approx(1e6, abs=2e4)


def test_node_ids_are_given_by_either_allocator_to_either_device(came):
    # A device made of the library gets a node id of ours.
    story = came["our allocator"]
    assert story["sent"] == [0, 6, 12]
    # It wants 33, which is the controller's as delivered, as 34 is the trigger's.
    assert story["given"] == [[10, 35]]
    assert story["table"] == [[OTHER, 35]]
    # A device made of ours gets a node id of the librarys allocator.
    assert came["their allocator"] == [[bytes(range(200, 216)).hex(), 125]]
    # The librarys allocator is another one.
    (notice,) = came["two allocators"]
    assert notice.startswith("node 50 gives out node ids as well")
