"""What controller and trigger do as nodes: parameters, memory, who they are, restarts, time."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from upf_device_bench import CONTROLLER, NODE_STATUS, TRIGGER, Story, Vehicle, ready

from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.simulator.trigger import TRIGGER_PARAMETERS
from chute_ros.protocol.dronecan import time_sync
from chute_ros.protocol.dronecan.can_frame import pack
from chute_ros.protocol.dronecan.transfer import Transfer, TransferKind, frames_of

NUMBERS = [one.name for one in p.PARAMETERS if one.kind is int]
STATUS = names.PARACHUTE_STATUS


def value(story, name, server=CONTROLLER):
    """The value of a parameter, as it is read."""
    return p.value_of(story.get(name, server)["value"])


# GetSet


def test_what_is_of_the_wrong_kind_is_not_taken():
    for wrong in ("text", True, 250.5, math.nan, 1e30, -1e30):
        story = ready()
        before = value(story, p.NODE_STATUS_INTERVAL)
        assert story.set(p.NODE_STATUS_INTERVAL, wrong) == before, wrong
    assert story.set(p.NODE_STATUS_INTERVAL, 500.0) == 500, "a whole number as a real"
    for wrong in ("false", 2, -1, 0.5, math.nan):
        story = ready()
        assert story.set(p.ENABLE_APS, wrong) is True, wrong
        assert story.controller.switch(p.ENABLE_APS)
    for number, taken in ((0, False), (1, True), (0.0, False)):
        assert ready().set(p.ENABLE_APS, number) is taken, "a switch as a number"


def test_a_name_counts_more_than_an_index():
    answer = ready().call(bus_requests.GET_SET, {"index": 3, "name": p.LIGHT.encode()})
    assert answer["name"].decode() == p.LIGHT


def test_the_trigger_has_its_own_parameters():
    story = ready()
    for name, value in TRIGGER_PARAMETERS.items():
        assert p.value_of(story.get(name, TRIGGER)["value"]) == value
    assert story.get(p.ENABLE_APS, TRIGGER)["name"] == b""
    story.set(p.LIGHT, False, TRIGGER)
    assert p.value_of(story.get(p.LIGHT)["value"]) is True


# Effects


def test_static_node_id_counts_from_the_next_start():
    story = ready()
    story.set(p.STATIC_NODE_ID, 77)
    story.run(1.0)
    assert story.get(p.STATIC_NODE_ID), "it is still there"
    assert not story.heard(STATUS, 77)
    story.restart()
    story.forget()
    story.run(1.2)
    assert story.heard(STATUS, 77)
    assert story.heard(NODE_STATUS, 77)
    assert not story.heard(STATUS, CONTROLLER)
    assert p.value_of(story.get(p.STATIC_NODE_ID, 77)["value"]) == 77


def test_an_interval_counts_at_once():
    for name, message, interval in (
        (p.NODE_STATUS_INTERVAL, NODE_STATUS, 0.2),
        (p.PARACHUTE_STATUS_INTERVAL, STATUS, 0.5),
    ):
        story = ready()
        story.set(name, round(interval * 1000))
        story.forget()
        story.run(10.0)
        assert len(story.heard(message)) == pytest.approx(10.0 / interval, abs=2), name
    # A shorter one does not wait for the longer one to end.
    story = ready(values={p.PARACHUTE_STATUS_INTERVAL: 60000})
    story.set(p.PARACHUTE_STATUS_INTERVAL, 100)
    story.forget()
    assert len(story.run(1.0).heard(STATUS)) >= 9


# Memory


def test_erase_brings_back_what_was_delivered():
    story = ready()
    story.set(p.ENABLE_APS, False)
    story.set(p.PARACHUTE_STATUS_INTERVAL, 1000)
    story.set(p.STATIC_NODE_ID, 77)
    assert story.opcode(bus_requests.OPCODE_ERASE)
    assert p.value_of(story.get(p.ENABLE_APS)["value"]) is True
    story.forget()
    story.run(1.0)
    assert len(story.heard(STATUS)) >= 9
    story.restart()
    assert p.value_of(story.get(p.STATIC_NODE_ID)["value"]) == CONTROLLER


# Who it is, and how it is


def test_transport_stats_count_transfers_and_errors():
    story = ready()
    first = story.call(bus_requests.TRANSPORT_STATS, {})
    story.run(1.0)
    story.bus.receive(b"\x00" * 15, story.now)
    second = story.call(bus_requests.TRANSPORT_STATS, {})
    assert second["transfers_tx"] - first["transfers_tx"] >= 10
    assert second["transfers_rx"] - first["transfers_rx"] >= 10
    assert second["transfer_errors"] - first["transfer_errors"] == 1


# Restarts


def test_services_that_it_does_not_have_are_not_answered():
    story = ready()
    values = story.definitions.request(names.TRIGGER_SERVICE, "TYPE_LAUNCH")
    assert story.call(names.TRIGGER_SERVICE, values, CONTROLLER) is None
    assert not story.trigger.fired


# Silence


def test_a_mute_one_speaks_but_neither_obeys_nor_answers():
    story = ready()
    story.bus.act("mute")
    story.forget()
    assert story.ask("TAKEOFF") is None
    assert story.call(bus_requests.GET_NODE_INFO, {}) is None
    story.run(1.0)
    assert len(story.heard(STATUS)) >= 9
    assert story.states() == [story.state]
    story.bus.act("unmute")
    assert story.ask("TAKEOFF") == "SUCCESS"


def test_a_silent_one_says_nothing_until_it_speaks_again():
    story = ready()
    story.bus.act("silent")
    story.forget()
    assert story.call(bus_requests.GET_NODE_INFO, {}) is None
    story.run(3.0)
    assert story.vehicle.messages == {}
    story.bus.act("speak")
    story.run(0.2)
    assert story.heard(STATUS)


def test_a_reboot_ends_silence_without_saying_what_was_not_said():
    story = ready()
    story.bus.act("silent")
    story.run(3.0)
    story.forget()
    story.bus.act("reboot")
    story.run(0.1)
    assert [message.values["uptime_sec"] for message in story.heard(NODE_STATUS)] == [0]


# The time of the bus


def test_it_follows_the_time_of_the_master_with_the_lowest_id():
    """Given two masters at t+0, 1, 2 ...: the one with the lower id says it is 5000 s later."""
    story = ready()
    masters = {id_: Vehicle(story.definitions, id_, speaks=False) for id_ in (20, 10)}
    sent = {}
    for _ in range(4):
        for id_, offset in ((20, 9000.0), (10, 5000.0)):
            stamp = round((sent[id_] + offset) * 1e6) if id_ in sent else 0
            values = {"previous_transmission_timestamp_usec": stamp}
            masters[id_].endpoint.broadcast(time_sync.MESSAGE, values)
            for frame in masters[id_].endpoint.take_output():
                story.bus.receive(frame, story.now)
            sent[id_] = story.now
        story.run(1.0)
    for node in (story.controller, story.trigger):
        assert node.clock.master == 10
        assert node.clock.offset == pytest.approx(5000.0, abs=1e-6)


def test_without_a_master_it_does_not_know_the_time():
    assert math.isnan(ready().controller.clock.offset)


# Whatever comes


KNOWN = [
    *((TransferKind.MESSAGE, name) for name in (names.VEHICLE_STATUS, names.TRIGGER_STATUS)),
    *((TransferKind.MESSAGE, name) for name in (names.TRIGGER_LAUNCH, time_sync.MESSAGE)),
    *((TransferKind.REQUEST, name) for name in (names.PARACHUTE_SERVICE, names.TRIGGER_SERVICE)),
    *(
        (TransferKind.REQUEST, name)
        for name in (bus_requests.GET_SET, bus_requests.EXECUTE_OPCODE)
    ),
    *(
        (TransferKind.REQUEST, name)
        for name in (bus_requests.RESTART_NODE, bus_requests.GET_NODE_INFO)
    ),
    (TransferKind.RESPONSE, names.VEHICLE_SERVICE),
    (TransferKind.MESSAGE, "uavcan.protocol.dynamic_node_id.Allocation"),
]
TRANSFERS = st.tuples(
    st.sampled_from(KNOWN),
    st.integers(1, 127),
    st.sampled_from([CONTROLLER, TRIGGER]),
    st.integers(0, 31),
    st.binary(max_size=120),
)


@settings(max_examples=100, deadline=None)
@given(transfers=st.lists(TRANSFERS, max_size=20), dynamic=st.booleans())
def test_whatever_comes_it_goes_on(transfers, dynamic):
    own = {p.STATIC_NODE_ID: 0} if dynamic else {}
    story = Story(values=own, trigger_values=own).run(0.1)
    types = story.definitions.types
    for (kind, name), source, server, number, payload in transfers:
        data_type = types.find(name, kind.value)
        to = 0 if kind is TransferKind.MESSAGE else server
        transfer = Transfer(kind, data_type.id, source, to, number, payload)
        for frame in frames_of(transfer, data_type.base_crc):
            story.bus.receive(pack(frame), story.now)
        story.bus.update(story.now)
        story.now += 0.05
    for _ in range(20):
        story.bus.update(story.now)
        following = story.bus.next_deadline()
        assert story.now < following < math.inf
        story.now = following
