"""The relays of the soak see every kill and deploy, and what they make up is none."""

import random

import pytest

from chute_ros.protocol.dronecan.can_frame import unpack
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.protocol.mavlink.frames import FrameEncoder
from chute_ros.transport.data_types import load_data_types
from faults.soak_relay import DEPLOY, KILL
from faults.soak_relay_can import nonsense, stranger
from faults.soak_relay_mavlink import mavlink_order


def frame(command, *params):
    values = [*params, *[0.0] * (7 - len(params))]
    message = dialect.MAVLink_command_long_message(1, 1, command, 0, *values)
    return FrameEncoder(1, 191).encode(message, 1.0)


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (frame(dialect.MAV_CMD_DO_FLIGHTTERMINATION, 1.0), KILL),
        (frame(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, 21196.0), KILL),
        (frame(dialect.MAV_CMD_DO_PARACHUTE, float(dialect.PARACHUTE_RELEASE)), DEPLOY),
    ],
)
def test_a_kill_and_a_deploy_are_seen(data, what):
    assert mavlink_order(data)[0] == what


@pytest.mark.parametrize(
    "data",
    [
        frame(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0.0),
        frame(dialect.MAV_CMD_DO_PARACHUTE, float(dialect.PARACHUTE_ENABLE)),
        frame(dialect.MAV_CMD_REQUEST_MESSAGE, 430.0),
        b"",
        b"\xfd" * 40,
    ],
)
def test_nothing_else_is_taken_for_one(data):
    assert mavlink_order(data) is None


def test_the_valid_flood_of_a_bus_is_heard_and_the_invalid_one_never():
    types, chance = load_data_types("", "dsdl_path"), random.Random(1)
    ear = Endpoint(types, 10)
    heard = ear.receive(stranger(chance), 1.0)
    assert (heard.name, heard.source) == ("uavcan.protocol.NodeStatus", 99)
    for number in range(5000):
        data = nonsense(chance)
        assert unpack(data) is not None
        assert ear.receive(data, 2.0 + number / 1000.0) is None
