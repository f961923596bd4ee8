"""Bytes to frames: good ones come through, damaged ones cost only themselves, nothing raises."""

import struct

import pytest
from device_bench import crc
from hypothesis import given, settings
from hypothesis import strategies as st

from chute_ros.errors import MessageError
from chute_ros.protocol.mavlink import frames
from chute_ros.protocol.mavlink.dialect import dialect as d
from chute_ros.protocol.mavlink.frames import FrameDecoder, FrameEncoder

#: HEARTBEAT of a parachute (type 37) from 1/161, sequence 0, by MAVLink version.
GOLDEN = {
    1: bytes.fromhex("fe090001a100000000002508000303f8c3"),
    2: bytes.fromhex("fd0900000001a100000000000000250800030373a6"),
}


def heartbeat(version=2, sequence=0):
    """A parachute's HEARTBEAT put together by hand from the layout of the developer guide."""
    payload = struct.pack("<IBBBBB", 0, 37, 8, 0, 3, 3)
    if version == 2:
        head = struct.pack("<BBBBBB", len(payload), 0, 0, sequence, 1, 161) + b"\0\0\0"
        mark = b"\xfd"
    else:
        head = struct.pack("<BBBBB", len(payload), sequence, 1, 161, 0)
        mark = b"\xfe"
    body = head + payload
    return mark + body + struct.pack("<H", crc(body + b"\x32"))


def names(found):
    return [frame.message.get_type() for frame in found]


def test_the_encoder_packs_the_bytes_that_the_guide_prescribes():
    message = d.MAVLink_heartbeat_message(37, 8, 0, 0, 3, 3)
    assert FrameEncoder(1, 161).encode(message, 0.0) == heartbeat()
    assert {version: heartbeat(version) for version in (1, 2)} == GOLDEN


def test_the_encoder_counts_its_frames_and_begins_again_after_255():
    encoder = FrameEncoder(1, 191)
    message = d.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
    sequences = [encoder.encode(message, 0.0)[4] for _ in range(257)]
    assert sequences == [*range(256), 0]


def test_a_value_that_a_field_cannot_carry_is_the_callers_mistake():
    for message in (
        *(d.MAVLink_heartbeat_message(value, 8, 0, 0, 3, 3) for value in (256, -1, "x", 1.5)),
        *(
            d.MAVLink_attitude_quaternion_cov_message(0, values, 0, 0, 0, [0.0] * 9)
            for values in ([], [0.0] * 3, None)
        ),
    ):
        with pytest.raises(MessageError, match=f"{message.get_type()} cannot be packed"):
            FrameEncoder(1, 1).encode(message, 0.0)


def test_both_versions_are_read_also_several_frames_of_one_datagram():
    for version in (1, 2):
        (frame,) = FrameDecoder().feed_datagram(heartbeat(version, sequence=7), 0.0)
        assert (frame.device, frame.sequence, frame.version) == ("1/161", 7, version)
        assert frame.message.type == d.MAV_TYPE_PARACHUTE
        assert not frame.signed
    decoder = FrameDecoder()
    assert len(decoder.feed_datagram(heartbeat() + heartbeat(1) + heartbeat(), 0.0)) == 3
    assert not decoder.counts


def test_a_datagram_that_ends_inside_a_frame_is_counted_and_does_not_spoil_the_next():
    decoder = FrameDecoder()
    assert decoder.feed_datagram(heartbeat()[:-3], 0.0) == []
    assert decoder.counts[frames.TRUNCATED] == 1
    assert len(decoder.feed_datagram(heartbeat(), 0.0)) == 1


def test_noise_or_one_damaged_frame_costs_only_itself():
    decoder = FrameDecoder()
    assert len(decoder.feed_datagram(b"\x00\xfd" + heartbeat(), 0.0)) == 1
    assert decoder.counts
    for at in range(1, len(heartbeat())):
        damaged = bytearray(heartbeat())
        damaged[at] ^= 0xFF
        decoder = FrameDecoder()
        found = decoder.feed(bytes(damaged) + heartbeat() * 14, 0.0)
        found += decoder.feed(b"", 1.0) + decoder.update(2.0)
        assert len(found) == 14, at
        assert sum(decoder.counts.values()) > 0
    damaged = heartbeat()[:-1] + bytes([heartbeat()[-1] ^ 1])
    decoder = FrameDecoder()
    assert decoder.feed_datagram(damaged, 0.0) == []
    assert decoder.counts[frames.BAD_CHECKSUM] == 1


def test_a_message_that_the_dialect_does_not_know_is_passed_over_whole():
    inside = heartbeat()
    head = struct.pack("<BBBBBB", len(inside), 0, 0, 0, 1, 1) + (54321).to_bytes(3, "little")
    stranger = b"\xfd" + head + inside + struct.pack("<H", crc(head + inside + b"\x07"))
    decoder = FrameDecoder()
    assert decoder.feed_datagram(stranger + heartbeat(sequence=9), 0.0)[0].sequence == 9
    assert decoder.counts[frames.UNKNOWN_MESSAGE] == 1


def test_flags_that_we_do_not_know_forbid_reading_the_frame():
    raw = bytearray(heartbeat())
    raw[2] = 0x02
    decoder = FrameDecoder()
    assert decoder.feed_datagram(bytes(raw), 0.0) == []
    assert decoder.counts[frames.UNKNOWN_FLAGS] == 1


def test_a_false_start_mark_does_not_hold_back_the_true_frames_for_long():
    decoder = FrameDecoder()
    false_start = b"\xfd\xff\x00\x00\x00\x01\x01\x4c\x00\x00"
    found = decoder.feed(false_start + heartbeat(), 10.0)
    if not found:
        assert decoder.next_deadline() == 10.0 + frames.LONGEST_FRAME_TIME
        found = decoder.update(10.0 + frames.LONGEST_FRAME_TIME)
    assert names(found) == ["HEARTBEAT"]


def test_the_longest_frame_is_read_from_the_slowest_line():
    """240 bytes of payload, one by one at 9,600 baud, ten bits each."""
    head = bytes([240, 0, 0, 0, 1, 191]) + (390).to_bytes(3, "little")
    body = head + bytes(239) + b"\x01"
    extra = d.mavlink_map[390].crc_extra
    checksum = d.x25crc(body + bytes([extra])).crc.to_bytes(2, "little")
    raw = b"\xfd" + body + checksum
    decoder, found = FrameDecoder(), []
    for number in range(len(raw)):
        found += decoder.feed(raw[number : number + 1], number * 10 / 9600)
    assert names(found) == ["ONBOARD_COMPUTER_STATUS"]


def test_a_frame_in_two_parts_after_a_quiet_spell_is_read():
    decoder = FrameDecoder()
    raw = heartbeat()
    decoder.feed(raw, 0.0)
    assert decoder.feed(raw[:8], 60.0) == []
    assert names(decoder.feed(raw[8:], 60.1)) == ["HEARTBEAT"]


@given(st.data())
def test_any_split_of_a_stream_gives_the_same_frames_as_the_whole(data):
    noise = st.binary(max_size=12)
    parts = data.draw(
        st.lists(st.one_of(noise, st.just(heartbeat()), st.just(heartbeat(1))), max_size=8)
    )
    stream = b"".join(parts)
    whole = FrameDecoder()
    expected = [f.version for f in whole.feed(stream, 0.0) + whole.update(1.0)]
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    split = FrameDecoder()
    found = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        found += split.feed(stream[start:end], 0.0)
    found += split.update(1.0)
    assert [f.version for f in found] == expected
    assert split.counts == whole.counts


LONG_START = b"\xfd\xff\0\0\0\1\1\0\0\0"
FALSE_STARTS = st.sampled_from([LONG_START, b"\xfd", b"\xfe\xff\0\1"]) | st.binary(max_size=9)


@given(st.lists(st.tuples(st.none() | FALSE_STARTS, st.floats(0, 0.1)), max_size=30))
def test_no_true_frame_is_held_back_for_longer_than_the_longest_frame_takes(pieces):
    """None stands for a true frame."""
    decoder, now, held = FrameDecoder(), 0.0, {}
    for number, (false_start, pause) in enumerate(pieces):
        until = now + pause
        while (now := decoder.next_deadline()) <= until:
            for frame in decoder.update(now):
                del held[frame.sequence]
            assert decoder.next_deadline() > now
        now = until
        data = heartbeat(2, number) if false_start is None else false_start
        if false_start is None:
            held[number] = now
        for frame in decoder.feed(data, now):
            del held[frame.sequence]
        if decoder.counts[frames.UNKNOWN_MESSAGE]:
            return  # Passed over whole with what is in it: one false start in 256.
        assert all(now < put + frames.LONGEST_FRAME_TIME for put in held.values())


def test_a_frame_longer_than_its_message_is_read_only_of_version_2():
    # A version 1 frame longer than its message is none.
    body = struct.pack("<BBBBB", 10, 0, 1, 161, 0) + bytes(10)
    raw = b"\xfe" + body + struct.pack("<H", crc(body + b"\x32"))
    decoder = FrameDecoder()
    assert decoder.feed_datagram(raw, 0.0) == []
    assert decoder.counts == {frames.NOISE: len(raw)}
    # A version 2 frame longer than its message is read without the newer fields.
    payload = struct.pack("<IBBBBB", 0, 37, 8, 0, 3, 3) + b"newer"
    body = struct.pack("<BBBBBB", len(payload), 0, 0, 0, 1, 161) + b"\0\0\0" + payload
    raw = b"\xfd" + body + struct.pack("<H", crc(body + b"\x32"))
    (frame,) = FrameDecoder().feed_datagram(raw, 0.0)
    assert frame.message.type == d.MAV_TYPE_PARACHUTE


@settings(max_examples=300)
@given(st.lists(st.binary(max_size=300), max_size=10))
def test_no_bytes_ever_raise_or_pile_up(chunks):
    decoder = FrameDecoder()
    now = 0.0
    for chunk in chunks:
        decoder.feed(chunk, now)
        decoder.feed_datagram(chunk, now)
        assert len(decoder._buffer) < 280
        now += 0.1
        decoder.update(now)
        assert decoder.next_deadline() > now


KINDS = sorted(d.mavlink_map)


def value_for(kind, data):
    """A random value for each field of a message class, NaN and infinity included."""
    values = []
    for name, type_ in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        index = kind.ordered_fieldnames.index(name)
        length = kind.array_lengths[index]
        if type_ == "char":
            values.append(data.draw(st.binary(max_size=max(length, 1))))
            continue
        if type_ in ("float", "double"):
            one = st.floats(width=32)
        else:
            bits = int("".join(filter(str.isdigit, type_)))
            low = 0 if type_.startswith("u") else -(2 ** (bits - 1))
            one = st.integers(low, low + 2**bits - 1)
        if length:
            values.append(data.draw(st.lists(one, min_size=length, max_size=length)))
        else:
            values.append(data.draw(one))
    return values


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_every_message_that_can_be_packed_is_read_back(data):
    kind = d.mavlink_map[data.draw(st.sampled_from(KINDS))]
    message = kind(*value_for(kind, data))
    raw = FrameEncoder(3, 4).encode(message, 0.0)
    (frame,) = FrameDecoder().feed_datagram(raw, 0.0)
    assert frame.message.get_type() == kind.msgname
    assert FrameEncoder(3, 4).encode(frame.message, 0.0) == raw
