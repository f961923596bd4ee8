"""What holds for a link whatever comes: it never raises, never spins, and ends what it began."""

import math
import random

from hypothesis import given, settings
from hypothesis import strategies as st
from upf_link_bench import (
    CONTROLLER,
    LAYOUTS,
    START,
    TRIGGER,
    US,
    Bench,
    flying,
    landed,
    layout_of,
)

from chute_ros.links.upf.protocol import bus_requests
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.protocol.events import BusRequestFinished
from chute_ros.links.upf.protocol.link import UpfLink
from chute_ros.protocol.dronecan.can_frame import CanFrame, pack
from chute_ros.protocol.dronecan.transfer import Transfer, TransferKind, frames_of
from chute_ros.protocol.events import RequestFinished

LAYOUT = st.sampled_from(sorted(LAYOUTS))
NAMES = [
    "flyfire.ParachuteStatus",
    "flyfire.TriggerStatus",
    "flyfire.VehicleService",
    "flyfire.ParachuteService",
    "flyfire.TriggerService",
    "flyfire.TriggerLaunch",
    "flyfire.VehicleStatus",
    "uavcan.protocol.NodeStatus",
    "uavcan.protocol.GetNodeInfo",
    "uavcan.protocol.RestartNode",
    "uavcan.protocol.GetTransportStats",
    "uavcan.protocol.GlobalTimeSync",
    "uavcan.protocol.dynamic_node_id.Allocation",
    bus_requests.GET_SET,
    bus_requests.EXECUTE_OPCODE,
]
#: Texts of a parameter, from good to absurd.
TEXTS = st.sampled_from(["true", "false", "50", "-1", "nan", "9" * 40, "", "x" * 200])
ASKS = st.sampled_from(
    [
        lambda link, token, now, text: link.deploy(token, False, now),
        lambda link, token, now, text: link.deploy(token, True, now, 33),
        lambda link, token, now, text: link.arm(token, True, 0, now),
        lambda link, token, now, text: link.arm(token, False, 0, now),
        lambda link, token, now, text: link.service(token, "TYPE_TAKEOFF", 0, now),
        lambda link, token, now, text: link.service(token, "TYPE_LAND", 33, now),
        lambda link, token, now, text: link.service(token, "TYPE_DEPLOY", 0, now),
        lambda link, token, now, text: link.bus_request(
            token, 0, bus_requests.list_parameters, now
        ),
        lambda link, token, now, text: link.bus_request(token, 34, bus_requests.node_info, now),
        lambda link, token, now, text: link.disturb(token, 0, True, bus_requests.restart, now),
        lambda link, token, now, text: link.disturb(token, 0, False, bus_requests.restart, now),
        lambda link, token, now, text: link.set_parameter(token, 0, p.LIGHT, text, False, now),
        lambda link, token, now, text: link.set_parameter(
            token, 33, p.ENABLE_APS, text, False, now
        ),
        lambda link, token, now, text: link.set_parameter(token, 34, text, text, True, now),
    ]
)


@st.composite
def transfers(draw, layout):
    """The frames of a transfer to us whose payload is any bytes, or of a type's own length."""
    types = layout.types
    name = draw(st.sampled_from(NAMES))
    service = types.find(name, "request") is not None
    kind = (
        draw(st.sampled_from([TransferKind.REQUEST, TransferKind.RESPONSE]))
        if service
        else TransferKind.MESSAGE
    )
    data_type = types.find(name, kind.value)
    payload = draw(st.binary(max_size=40))
    if draw(st.booleans()):
        payload = (payload * 40)[: len(data_type.encode({}))]
    source = draw(st.sampled_from([CONTROLLER, TRIGGER]) | st.integers(1, 127))
    number = draw(st.integers(0, 3))
    transfer = Transfer(kind, data_type.id, source, US if service else 0, number, payload, 16)
    return [pack(frame) for frame in frames_of(transfer, data_type.base_crc, 0)]


def finished(events):
    """The tokens of all ends."""
    ends = [one.finished.token for one in events if isinstance(one, RequestFinished)]
    return ends + [one.token for one in events if isinstance(one, BusRequestFinished)]


@settings(max_examples=150)
@given(st.data(), LAYOUT)
def test_any_transfers_and_requests_never_raise_and_never_make_it_spin(data, name):
    layout = layout_of(name)
    # Each VehicleStatus is a turn of the loop below.
    link = UpfLink(UpfConfig(vehicle_status_rate=1.0), layout.types)
    now = START
    events, tokens = [], []
    for step in range(data.draw(st.integers(1, 12))):
        now += data.draw(st.floats(0.0, 3.0))
        link.owner_alive(now + 1.0)
        for frame in data.draw(transfers(layout)):
            link.receive(frame, now)
        if data.draw(st.booleans()):
            tokens.append(step)
            data.draw(ASKS)(link, step, now, data.draw(TEXTS))
        link.vehicle(data.draw(st.sampled_from([flying(), landed()])), now)
        link.supervisor_said(data.draw(st.booleans()), {"33"}, now)
        link.update(now)
        assert link.next_deadline() > now
        link.take_output()
        events += link.take_events()
        link.devices.picture(now)
    for _ in range(3000):
        now = min(link.next_deadline(), now + 1.0)
        link.owner_alive(now + 1.0)
        link.update(now)
        assert link.next_deadline() > now
        link.take_output()
        events += link.take_events()
        if set(finished(events)) >= set(tokens) and now > START + 60.0:
            break
    assert sorted(finished(events)) == tokens


@settings(max_examples=200)
@given(st.lists(st.binary(max_size=24) | st.binary(min_size=16, max_size=16)), LAYOUT)
def test_any_bytes_never_raise(pieces, name):
    link = UpfLink(UpfConfig(), layout_of(name).types)
    for step, piece in enumerate(pieces):
        now = START + step * 0.1
        link.receive(piece, now)
        link.update(now)
        assert link.next_deadline() > now
        link.take_output()
        link.take_events()


@settings(max_examples=100)
@given(
    st.lists(
        st.tuples(st.integers(0, 2**29 - 1), st.binary(max_size=8)).map(
            lambda one: pack(CanFrame(*one))
        ),
        max_size=20,
    ),
    LAYOUT,
)
def test_any_frames_never_raise(frames, name):
    link = UpfLink(UpfConfig(), layout_of(name).types)
    for step, frame in enumerate(frames):
        link.receive(frame, START + step * 0.01)
        link.update(START + step * 0.01)
        link.take_events()


@settings(max_examples=15)
@given(
    LAYOUT,
    st.integers(0, 2**32),
    st.sampled_from([0.0, 0.1, 0.4, 0.8, 1.0]),
    st.lists(st.tuples(ASKS, TEXTS, st.floats(0.0, 0.6)), min_size=1, max_size=6),
)
def test_every_request_ends_exactly_once_whatever_is_lost(name, seed, loss, asks):
    dice = random.Random(seed)
    story = Bench(layout_of(name)).at(2.0)
    story.loses = lambda from_link, data: dice.random() < loss
    for token, (ask, text, pause) in enumerate(asks):
        ask(story.link, token, story.now, text)
        story.after(pause)
    story.after(12.0)
    assert sorted(finished(story.events)) == list(range(len(asks)))


@settings(max_examples=50)
@given(LAYOUT, st.lists(st.floats(0.0, 5.0), max_size=20))
def test_owner_that_hangs_now_and_then_never_makes_it_spin(name, pauses):
    link = UpfLink(UpfConfig(), layout_of(name).types)
    now = START
    for pause in pauses:
        link.owner_alive(now + 1.0)
        link.update(now)
        now += pause
        link.update(now)
        assert link.next_deadline() > now
    link.update(now + 2.0)
    assert link.next_deadline() == math.inf
