"""One node's place on the bus: what is for it, what it sends, and what the bus says of itself."""

import math

import pytest
from dronecan_bench import ALLOCATION, GET_SET, NODE_STATUS, TIME, raw, shown, types

from chute_ros.errors import MessageError
from chute_ros.protocol.dronecan.can_frame import CanFrame, pack
from chute_ros.protocol.dronecan.endpoint import Endpoint
from chute_ros.protocol.dronecan.transfer import TransferKind

LAUNCH = {"magic_number": 0x5550464C, "node_id": 34}


def endpoint(node_id=10):
    return Endpoint(types(), node_id)


def carry(sender, receiver, now=0.0):
    """What receiver hears of all that sender has to send."""
    heard = [receiver.receive(frame, now) for frame in sender.take_output()]
    return [one for one in heard if one is not None]


def error(classes):
    return pack(CanFrame(classes, bytes(8), extended=False, error=True))


def test_a_message_is_heard_by_everybody():
    vehicle, trigger = endpoint(), endpoint(34)
    vehicle.broadcast("flyfire.TriggerLaunch", LAUNCH, priority=0)
    (heard,) = carry(vehicle, trigger)
    assert (heard.kind, heard.name, heard.source) == (
        TransferKind.MESSAGE,
        "flyfire.TriggerLaunch",
        10,
    )
    assert heard.values == LAUNCH
    assert (vehicle.sent_count, trigger.received_count) == (1, 1)


def test_golden_messages_count_their_transfer_ids_by_type():
    vehicle = endpoint()
    vehicle.broadcast("flyfire.TriggerLaunch", LAUNCH, priority=0)
    vehicle.broadcast(NODE_STATUS, {"uptime_sec": 7})
    for _ in range(32):
        vehicle.broadcast("flyfire.TriggerLaunch", LAUNCH, priority=0)
    sent = shown(vehicle.take_output())
    assert sent[:3] == [
        "0006810a#4c46505544c0",
        "1001550a#07000000000000c0",
        "0006810a#4c46505544c1",
    ]
    assert sent[-2:] == ["0006810a#4c46505544df", "0006810a#4c46505544c0"]
    assert vehicle.take_output() == []


def test_a_message_that_cannot_be_sent_costs_no_transfer_id():
    vehicle = endpoint()
    with pytest.raises(MessageError):
        vehicle.broadcast("flyfire.TriggerLaunch", {"node_id": 128})
    assert vehicle.take_output() == []
    vehicle.broadcast("flyfire.TriggerLaunch", LAUNCH)
    assert shown(vehicle.take_output()) == ["1006810a#4c46505544c0"]
    assert vehicle.sent_count == 1


def test_a_request_and_its_response():
    vehicle, parachute, bystander = endpoint(), endpoint(33), endpoint(34)
    vehicle.request(33, GET_SET, 5, {"index": 3}, 16)
    frames = vehicle.take_output()
    assert shown(frames) == ["100ba18a#0300c5"]
    assert bystander.receive(frames[0], 0.0) is None
    asked = parachute.receive(frames[0], 0.0)
    assert (asked.kind, asked.source, asked.transfer_id) == (TransferKind.REQUEST, 10, 5)
    parachute.respond(asked, {"name": b"Enable APS", "value": {"boolean_value": 1}})
    (answer,) = carry(parachute, vehicle)
    assert (answer.kind, answer.source, answer.transfer_id) == (TransferKind.RESPONSE, 33, 5)
    assert answer.values["name"] == b"Enable APS"


def test_a_node_without_an_id_listens_and_asks_for_one_but_for_nothing_else():
    device, vehicle = endpoint(0), endpoint()
    vehicle.broadcast(NODE_STATUS, {"uptime_sec": 7})
    assert len(carry(vehicle, device)) == 1
    part = {"first_part_of_unique_id": True, "unique_id": b"\0\1\2\3\4\5"}
    device.broadcast(ALLOCATION, part)
    (heard,) = carry(device, vehicle)
    assert (heard.source, heard.values) == (0, {"node_id": 0, **part})
    for send in (
        lambda: device.request(33, GET_SET, 0, {}, 16),
        lambda: device.respond_to(33, GET_SET, 0, {}),
        lambda: device.broadcast(NODE_STATUS, {}),
        lambda: device.broadcast(ALLOCATION, {"unique_id": bytes(7)}),
    ):
        with pytest.raises(MessageError):
            send()
    assert device.take_output() == []


def test_two_nodes_that_ask_for_an_id_at_once_differ_in_their_identifier():
    frames = []
    for last in range(50):
        device = endpoint(0)
        device.broadcast(ALLOCATION, {"unique_id": bytes((1, 2, 3, 4, 5, last))})
        frames += shown(device.take_output())
    assert len({frame.split("#")[0] for frame in frames}) == 50


def test_a_payload_that_is_too_short_is_counted_under_its_type():
    vehicle = endpoint()
    assert vehicle.receive(raw(0x10015521, "0700c0"), 0.0) is None
    assert vehicle.counts == {f"{NODE_STATUS} too short": 1}
    assert vehicle.received_count == 1


def test_somebody_else_under_our_node_id_is_noticed_and_not_heard():
    vehicle, double = endpoint(), endpoint()
    assert math.isnan(vehicle.own_id_heard)
    double.broadcast(TIME, {})
    assert carry(double, vehicle, 5.0) == []
    assert vehicle.own_id_heard == 5.0
    assert vehicle.received_count == 0


def test_bus_off_until_the_controller_restarts_or_somebody_is_heard():
    vehicle = endpoint()
    for now, (classes, off) in enumerate(((0x40, True), (0x04, True), (0x100, False))):
        vehicle.receive(error(classes), float(now))
        assert vehicle.bus_off is off, now
    assert vehicle.bus_off_count == 1
    assert vehicle.counts == {"error frames of the bus": 1}
    vehicle.receive(error(0x40), 5.0)
    assert vehicle.bus_off
    vehicle.receive(raw(0x10015521, "07000000000000c0"), 5.1)
    assert not vehicle.bus_off
