"""What holds for a link whatever comes: it never raises, never grows without end, never spins."""

import math
import struct

from hypothesis import given, settings
from hypothesis import strategies as st
from link_bench import START, Bench, ack, copter, heartbeat, landed, status

from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.protocol.devices import MOST_DEVICES
from chute_ros.links.mavlink.protocol.link import MavlinkLink
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.mavlink.frames import FrameEncoder

BYTE = st.integers(0, 255)
INTERESTING = ["HEARTBEAT", "PARACHUTE_STATUS", "COMMAND_ACK", "COMPONENT_INFORMATION_BASIC"]
INTERESTING += ["EXTENDED_SYS_STATE", "GLOBAL_POSITION_INT", "ATTITUDE", "ATTITUDE_QUATERNION"]
INTERESTING += ["SCALED_IMU", "HIGHRES_IMU", "SYS_STATUS", "SYSTEM_TIME", "ALTITUDE"]
KINDS = {kind.msgname: kind for kind in d.mavlink_map.values()}
FLOATS = st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -0.0, 1e38, -1e38, 1.0])


@st.composite
def messages(draw):
    """A message of the dialect whose payload is any bytes, often with odd floats in it."""
    name = draw(st.sampled_from(INTERESTING) | st.sampled_from(sorted(KINDS)))
    kind = KINDS[name]
    size = kind.unpacker.size
    payload = bytearray(draw(st.binary(min_size=size, max_size=size)))
    if size >= 4 and draw(st.booleans()):
        odd = struct.pack("<f", draw(FLOATS))
        payload = bytearray((odd * (size // 4 + 1))[:size])
    fields = list(kind.unpacker.unpack(bytes(payload)))
    values, position = [], 0
    arrays = zip(kind.lengths, kind.array_lengths, strict=True)
    for length, array_length in arrays:
        if array_length and isinstance(fields[position], bytes):
            values.append(fields[position])
            position += 1
        elif length > 1:
            values.append(fields[position : position + length])
            position += length
        else:
            values.append(fields[position])
            position += 1
    return kind(*[values[index] for index in kind.orders])


IDS = st.tuples(st.sampled_from([1, 1, 2, 255]) | BYTE, st.sampled_from([1, 161, 162, 0]) | BYTE)
KINDLY = st.sampled_from(
    [heartbeat(), status(), copter(True), copter(False), landed(), ack(208), ack(225), ack(400)]
)
FRAMES = st.lists(st.tuples(IDS, messages() | KINDLY, st.floats(0.0, 3.0)), max_size=12)
ASK = st.sampled_from(
    [
        lambda link, token, now: link.deploy(token, True, now),
        lambda link, token, now: link.kill(token, now),
        lambda link, token, now: link.arm(token, False, 0, now),
        lambda link, token, now: link.parachute_action(token, 0, "", now),
        lambda link, token, now: link.set_message_interval(token, 430, 9, "", now),
        lambda link, token, now: link.flight_block("why" if token % 2 else "", now),
        lambda link, token, now: link.owner_alive(now + 1.3),
    ]
)


@settings(max_examples=150, deadline=None)
@given(FRAMES, st.lists(ASK, max_size=12), st.floats(0.0, 1e6))
def test_random_frames_and_requests_never_raise_and_never_make_it_spin(frames, asks, start):
    link = MavlinkLink(MavlinkConfig())
    now = start
    for step, (ids, message, pause) in enumerate(frames):
        now += pause
        link.receive(FrameEncoder(*ids).encode(message, now), now)
        if step < len(asks):
            asks[step](link, step + 1, now)
        link.update(now)
        assert link.next_deadline() > now
        link.vehicle_state(now)
        link.doubts(now)
        for parachute in link.parachutes.all():
            parachute.status(now)
    assert link.received_count == len(frames)
    assert len(link.parachutes.all()) <= MOST_DEVICES
    assert len(link.autopilots.all()) <= MOST_DEVICES
    # All comes to an end, and each time it is woken there was something to do.
    for _ in range(1000):
        now = link.next_deadline()
        if now == math.inf:
            break
        link.update(now)
        assert link.next_deadline() > now
    assert now == math.inf


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.binary(max_size=400), st.sampled_from([None, "a", "b"])), max_size=8))
def test_random_bytes_never_raise(pieces):
    link = MavlinkLink(MavlinkConfig())
    for step, (data, stream) in enumerate(pieces):
        link.receive(data, START + step * 0.1, stream)
        link.update(START + step * 0.1)


def test_flood_of_made_up_devices_does_not_grow_it():
    bench = Bench(autopilot_component_id=0, autopilot_message_rate=10.0)
    for component in range(2, 190):
        bench.hear((1, component), heartbeat(), copter())
    for system in range(2, 256):
        bench.hear((system, 161), heartbeat(), copter(), status())
    assert len(bench.link.parachutes.all()) == MOST_DEVICES
    assert len(bench.link.autopilots.all()) == MOST_DEVICES
    assert len(bench.link.doubts(bench.now)) == 3
    for stream in range(100):
        bench.link.receive(b"\xfd\x09", bench.now, stream)
    assert bench.at(60.0).link.next_deadline() == math.inf


@settings(max_examples=200, deadline=None)
@given(st.floats(0.0, 1e6))
def test_every_deadline_of_a_parachute_is_served_whatever_the_rounding(start):
    link = MavlinkLink(MavlinkConfig())
    encoder = FrameEncoder(1, 161)
    link.receive(encoder.encode(heartbeat(), start), start)
    link.receive(encoder.encode(status(), start), start)
    woken = []
    while (now := link.next_deadline()) != math.inf:
        link.update(now)
        assert link.next_deadline() > now
        woken.append(now - start)
    assert [round(seconds, 3) for seconds in woken] == [2.5, 3.5, 5.0]
