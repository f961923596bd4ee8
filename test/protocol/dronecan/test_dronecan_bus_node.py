"""The vehicle's node: alive while its owner is, serves what is standard, tells of trouble."""

import math

import pytest
from dronecan_bench import (
    GET_NODE_INFO,
    GET_SET,
    NODE_STATUS,
    OPCODE,
    OWN,
    RESTART,
    START,
    STATS,
    UID,
    Bench,
    information,
    raw,
    shown,
    types,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from chute_ros.errors import ParameterError
from chute_ros.protocol.dronecan.bus_node import BusNode, BusNodeConfig
from chute_ros.protocol.dronecan.calls import Call
from chute_ros.protocol.dronecan.can_frame import CanFrame, pack
from chute_ros.protocol.dronecan.transfer import TransferKind
from chute_ros.protocol.events import Severity


def error(classes):
    return pack(CanFrame(classes, bytes(8), extended=False, error=True))


def test_golden_status_twice_a_second():
    bench = Bench().at(1.0)
    assert [t for t, _ in bench.said(NODE_STATUS)] == [0.0, 0.5, 1.0]
    assert shown(bench.frames) == [
        "1001550a#00000000000000c0",
        "1001550a#00000000000000c1",
        "1001550a#01000000000000c2",
    ]


def test_a_node_whose_owner_hangs_looks_dead_and_does_not_spin():
    bench = Bench(time_master=True).at(1.0)
    bench.node.owner_alive(START + 1.7)
    bench.at(10.0)
    assert [t for t, _ in bench.said(NODE_STATUS)] == [0.0, 0.5, 1.0, 1.5]
    assert bench.node.next_deadline() == math.inf
    bench.node.owner_alive(START + 11.2)
    bench.feed().at(12.0)
    assert [t for t, _ in bench.said(NODE_STATUS)][4:] == [10.0, 10.5, 11.0]


def test_a_status_that_was_due_when_the_owner_hung_is_not_waited_for():
    bench = Bench().at(0.2)
    bench.node.owner_alive(START + 0.6)
    # The loop comes round too late for the one at 0.5.
    bench.t = 0.7
    bench.feed()
    assert bench.node.next_deadline() == math.inf


def test_before_the_first_look_at_the_clock_it_is_as_young_as_can_be():
    node = BusNode(types(), BusNodeConfig(OWN, "org.test.us", UID))
    assert node.uptime(START) == 0


def test_a_node_that_could_not_answer_for_itself_is_refused():
    for name, value in (
        *(("node_id", 0), ("node_id", 128), ("name", ""), ("name", "ä" * 41)),
        *(("unique_id", bytes(15)), ("utc_offset", math.nan)),
    ):
        good = {"node_id": OWN, "name": "org.test.us", "unique_id": UID}
        with pytest.raises(ParameterError, match=f"^{name}"):
            BusNodeConfig(**{**good, name: value})


def test_it_says_who_it_is():
    bench = Bench().at(7.5).asked(33, GET_NODE_INFO)
    ((_, said),) = [one for one in bench.said(GET_NODE_INFO) if one[1]]
    assert said["status"]["uptime_sec"] == 7
    assert said["hardware_version"]["unique_id"] == UID
    assert said["name"] == b"org.test.us"
    assert (said["software_version"]["major"], said["software_version"]["minor"]) == (0, 1)


def test_it_tells_what_it_sent_and_received():
    bench = Bench().at(1.0).feed(raw(0x10FFFF21, "00c0")).asked(33, STATS)
    ((_, said),) = bench.said(STATS)
    assert said == {
        "transfers_tx": 3,
        "transfers_rx": 1,
        "transfer_errors": 1,
        "can_iface_stats": (),
    }


def test_it_has_no_parameters_and_neither_restarts_nor_saves_for_anybody():
    bench = Bench()
    bench.asked(33, RESTART, magic_number=0xACCE551B1E).asked(33, OPCODE, opcode=1)
    bench.asked(33, GET_SET, index=0).asked(33, GET_SET, 1, name=b"node_id")
    assert [said["ok"] for _, said in bench.said(RESTART)] == [False]
    assert [said["ok"] for _, said in bench.said(OPCODE)] == [False]
    for _, said in bench.said(GET_SET):
        assert said["name"] == b""
        assert said["value"] == {"empty": {}}


def test_the_answer_goes_to_who_asked_under_the_same_transfer_id():
    bench = Bench()
    bench.clear().asked(33, GET_SET, 9)
    (answer,) = [heard for _, heard in bench.sent if heard.name == GET_SET]
    assert (answer.kind, answer.transfer_id, answer.source) == (TransferKind.RESPONSE, 9, OWN)
    assert [frame[:8] for frame in shown(bench.frames)] == ["100b218a"]


def test_what_it_does_not_serve_and_a_status_of_nobody_are_nobodys():
    # What it does not serve is counted.
    bench = Bench().clear().asked(33, "uavcan.protocol.AccessCommandShell")
    assert bench.frames == []
    assert bench.node.counts == {"requests that this node does not serve": 1}
    # A status of nobody is nobodys.
    # Data type id 341 needs more than the two bits of an anonymous message.
    bench = Bench().feed(raw(0x10000100, "00c0"))
    assert bench.node.nodes.all() == []


def test_what_is_not_standard_is_handed_on():
    bench = Bench()
    bench.asked(33, "flyfire.VehicleService", magic_number=0x55504656, type=1)
    bench.hear(33, "flyfire.ParachuteStatus", state=2).hear(33, NODE_STATUS, uptime_sec=5)
    bench.speaker(33).respond_to(OWN, "flyfire.ParachuteService", 3, {"result": 1})
    bench.carry(33)
    assert [(one.kind, one.name) for one in bench.handed_on] == [
        (TransferKind.REQUEST, "flyfire.VehicleService"),
        (TransferKind.MESSAGE, "flyfire.ParachuteStatus"),
        (TransferKind.MESSAGE, NODE_STATUS),
        (TransferKind.RESPONSE, "flyfire.ParachuteService"),
    ]


def test_a_new_node_is_asked_who_it_is_until_it_answers():
    bench = Bench().hear(33, NODE_STATUS, uptime_sec=5)
    bench.at(0.3)
    first, second = bench.requests(GET_NODE_INFO)
    bench.answer(second, 33, **information(name="com.flyfire.upf"))
    assert bench.node.nodes.get(33).name == "com.flyfire.upf"
    assert bench.node.take_ended() == []
    assert first.transfer_id != second.transfer_id
    # What it answers ends a question; another node of this id may answer the next one.
    bench.at(0.9)
    assert len(bench.requests(GET_NODE_INFO)) == 2
    bench.at(1.0)
    third = bench.requests(GET_NODE_INFO)[-1]
    bench.answer(third, 33, **information(unique_id=bytes(16)))
    assert bench.node.troubles() == ["two nodes use node id 33: give one of them another"]


def test_a_node_that_does_not_answer_is_taken_as_it_is():
    bench = Bench()
    for tick in range(12):
        bench.at(tick * 1.0).hear(33, NODE_STATUS, uptime_sec=tick)
    assert len(bench.requests(GET_NODE_INFO)) == 15
    assert bench.node.nodes.all_discovered(bench.now)
    assert bench.node.counts["calls without an answer"] == 5


def bus_request(*calls):
    values = []
    for call in calls:
        values.append((yield call).values)
    return values


def test_an_bus_request_of_the_owner_ends_under_its_token():
    done = {"argument": 0, "ok": True}
    # A call that cannot be sent ends, and the bus request goes on.
    bad, good = Call(33, GET_SET, {"name": b"x" * 200}), Call(33, OPCODE, {"opcode": 0})
    for calls, results in (([good], [done]), ([bad, good, bad], [None, done, None])):
        bench = Bench()
        bench.node.begin("mine", bus_request(*calls), bench.now)
        bench.feed()
        (asked,) = bench.requests(OPCODE)
        bench.answer(asked, 33, ok=True)
        assert bench.node.take_ended() == [("mine", results)]
        assert bench.node.take_ended() == []


def story_of(bench, begins):
    """It was told once when it began, and once when it was over."""
    first, last = [one for one in bench.events if one.severity in (Severity.ERROR, Severity.INFO)]
    assert first.severity is Severity.ERROR
    assert first.text.startswith(begins)
    assert (last.severity, last.text) == (Severity.INFO, f"resolved: {first.text}")
    assert bench.node.troubles() == []


def test_trouble_two_nodes_under_one_id():
    bench = Bench()
    for tick in range(4):
        bench.at(tick * 1.0).hear(33, NODE_STATUS, uptime_sec=500 + tick)
        bench.at(tick + 0.5).hear(33, NODE_STATUS, uptime_sec=7 + tick)
    assert bench.node.troubles() == ["two nodes use node id 33: give one of them another"]
    # One of them goes.
    for tick in range(4, 36):
        bench.at(tick * 1.0).hear(33, NODE_STATUS, uptime_sec=500 + tick)
    story_of(bench, "two nodes use node id 33")


def test_trouble_two_nodes_that_were_switched_on_together_and_count_in_step():
    """Given two with the same uptimes and numbers, of which each is heard half a second after the
    other, and one whose frames come twice."""
    bench = Bench()
    for tick in range(12):
        for node_id, begin, again in ((33, tick, tick + 0.5), (40, tick + 0.6, tick + 0.65)):
            bench.speaker(node_id).broadcast(NODE_STATUS, {"uptime_sec": tick})
            frames = bench.speaker(node_id).take_output()
            bench.at(begin).feed(*frames).at(again).feed(*frames)
    assert bench.node.troubles() == ["two nodes use node id 33: give one of them another"]


def test_trouble_somebody_uses_our_node_id():
    bench = Bench().at(1.0).hear(OWN, NODE_STATUS, uptime_sec=9).at(2.0)
    bench.hear(OWN, NODE_STATUS, uptime_sec=10)
    assert bench.node.nodes.all() == []
    assert len(bench.notices()) == 1
    bench.at(6.9)
    assert len(bench.node.troubles()) == 1
    bench.at(8.0)
    story_of(bench, "another node uses our node id 10: set node_id to a free one")


def test_trouble_bus_off_and_back():
    bench = Bench().at(1.0).feed(error(0x40)).at(3.0).feed(error(0x40))
    assert "restart-ms 100" in bench.node.troubles()[0]
    bench.at(4.0).feed(error(0x100))
    story_of(bench, "the CAN controller is bus-off")
    assert bench.node.endpoint.bus_off_count == 2


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("status"), st.sampled_from([5, OWN, 33, 40]), st.integers(0, 20)),
        st.tuples(st.just("time"), st.sampled_from([5, OWN, 33])),
        st.tuples(st.just("allocation"), st.sampled_from([0, 5]), st.booleans()),
        st.tuples(st.just("alive"), st.floats(-1, 2)),
        st.tuples(st.just("bus_request")),
        st.tuples(st.just("wait"), st.floats(0, 4)),
        st.tuples(st.just("late"), st.floats(0, 4)),
    ),
    max_size=25,
)


@settings(max_examples=100)
@given(STEPS)
def test_its_next_deadline_is_never_in_the_past_and_all_comes_to_rest(steps):
    bench = Bench(allocator=True, time_master=True)
    bench.node.owner_alive(bench.now + 1.0)
    for step, *what in steps:
        if step == "status":
            bench.hear(what[0], NODE_STATUS, uptime_sec=what[1])
        elif step == "time":
            bench.hear(what[0], "uavcan.protocol.GlobalTimeSync")
        elif step == "allocation":
            part = {"unique_id": UID[:6], "first_part_of_unique_id": what[1]}
            bench.hear(what[0], "uavcan.protocol.dynamic_node_id.Allocation", **part)
        elif step == "alive":
            bench.node.owner_alive(bench.now + what[0])
            bench.feed()
        elif step == "bus_request":
            bench.node.begin("mine", bus_request(Call(33, OPCODE, {})), bench.now)
            bench.feed()
        elif step == "wait":
            bench.at(bench.t + what[0])
        else:
            # The loop was held up, and looks only now.
            bench.t += what[0]
            bench.feed()
        assert bench.node.next_deadline() > bench.now
    bench.at(bench.t + 60.0)
    assert bench.node.next_deadline() == math.inf
    assert bench.node.nodes.all() == []
    assert bench.node.troubles() == []


@given(st.lists(st.binary(min_size=16, max_size=16) | st.binary(max_size=20), max_size=30))
def test_any_bytes_never_raise(pieces):
    bench = Bench(allocator=True, time_master=True)
    for step, data in enumerate(pieces):
        bench.node.receive(data, START + step / 10)
        bench.node.update(START + step / 10)
