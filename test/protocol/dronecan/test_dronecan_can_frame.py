"""Frames as the sixteen bytes of Linux's struct can_frame, byte by byte."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.errors import MessageError
from chute_ros.protocol.dronecan.can_frame import (
    ERROR_BUS_OFF,
    ERROR_RESTARTED,
    SIZE,
    CanFrame,
    pack,
    unpack,
)

# Written out by hand from include/uapi/linux/can.h: id with flags, length, padding, data.
STANDARD, ERROR = {"extended": False}, {"extended": False, "error": True}
GOLDEN = [
    (0x1001550A, b"\x01\x02\x03\xc0", {}, "0a550190 04 000000 010203c000000000"),
    (0x1FFFFFFF, b"\xff" * 8, {}, "ffffff9f 08 000000 ffffffffffffffff"),
    (0x123, b"\xab", STANDARD, "23010000 01 000000 ab00000000000000"),
    (0x7FF, b"", {**STANDARD, "remote": True}, "ff070040 00 000000 0000000000000000"),
    (1, b"", {"remote": True}, "010000c0 00 000000 0000000000000000"),
    (ERROR_BUS_OFF, bytes(8), ERROR, "40000020 08 000000 0000000000000000"),
    (ERROR_RESTARTED, bytes(8), ERROR, "00010020 08 000000 0000000000000000"),
    (0x1FFFFFFF, b"", ERROR, "ffffff3f 00 000000 0000000000000000"),
]
NO_FRAME = {
    "nine bytes of data": "0a550190 09 000000 0000000000000000",
    "255 bytes of data": "0a550190 ff 000000 0000000000000000",
    "standard identifier of 12 bits": "00080000 00 000000 0000000000000000",
    "remote with 29 bits": "ffffff5f 00 000000 0000000000000000",
    "nothing": "",
    "fifteen bytes": "0a550190 00 000000 00000000000000",
    "seventeen bytes": "0a550190 00 000000 000000000000000000",
}


def test_a_frame_is_these_bytes_and_these_bytes_are_the_frame():
    for identifier, content, flags, data in GOLDEN:
        frame, data = CanFrame(identifier, content, **flags), bytes.fromhex(data)
        assert len(data) == SIZE
        assert pack(frame) == data
        assert unpack(data) == frame


def test_what_is_no_frame_is_none():
    for story, data in NO_FRAME.items():
        assert unpack(bytes.fromhex(data)) is None, story


@pytest.mark.parametrize(
    ("identifier", "data", "flags"),
    [
        (0x20000000, b"", {}),
        (-1, b"", {}),
        (0x800, b"", STANDARD),
        (0x20000000, b"", ERROR),
        (1, bytes(9), {}),
    ],
)
def test_a_frame_that_cannot_be_is_the_callers_mistake(identifier, data, flags):
    with pytest.raises(MessageError, match="need"):
        CanFrame(identifier, data, **flags)


@given(st.binary(min_size=SIZE, max_size=SIZE) | st.binary(max_size=20))
def test_any_bytes_are_a_frame_or_none_and_come_back_but_for_what_means_nothing(data):
    frame = unpack(data)
    if frame is None:
        return
    length = data[4]
    assert pack(frame) == data[:5] + bytes(3) + data[8 : 8 + length] + bytes(8 - length)
    assert unpack(pack(frame)) == frame


@given(
    st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.booleans(), st.booleans(), st.booleans()
)
def test_every_frame_survives(identifier, data, extended, remote, error):
    if not (extended or error):
        identifier &= 0x7FF
    frame = CanFrame(identifier, data, extended, remote, error)
    assert len(pack(frame)) == SIZE
    assert unpack(pack(frame)) == frame
