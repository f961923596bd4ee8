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
GOLDEN = [
    pytest.param(
        CanFrame(0x1001550A, b"\x01\x02\x03\xc0"),
        "0a550190 04 000000 010203c000000000",
        id="extended_data_frame",
    ),
    pytest.param(
        CanFrame(0x1FFFFFFF, b"\xff" * 8), "ffffff9f 08 000000 ffffffffffffffff", id="all_ones"
    ),
    pytest.param(
        CanFrame(0x123, b"\xab", extended=False),
        "23010000 01 000000 ab00000000000000",
        id="standard_data_frame",
    ),
    pytest.param(
        CanFrame(0x7FF, b"", extended=False, remote=True),
        "ff070040 00 000000 0000000000000000",
        id="standard_remote_frame",
    ),
    pytest.param(
        CanFrame(1, b"", remote=True),
        "010000c0 00 000000 0000000000000000",
        id="extended_remote_frame",
    ),
    pytest.param(
        CanFrame(ERROR_BUS_OFF, bytes(8), extended=False, error=True),
        "40000020 08 000000 0000000000000000",
        id="bus_off",
    ),
    pytest.param(
        CanFrame(ERROR_RESTARTED, bytes(8), extended=False, error=True),
        "00010020 08 000000 0000000000000000",
        id="controller_restarted",
    ),
    pytest.param(
        CanFrame(0x1FFFFFFF, b"", extended=False, error=True),
        "ffffff3f 00 000000 0000000000000000",
        id="error_with_every_class",
    ),
]


@pytest.mark.parametrize(("frame", "data"), GOLDEN)
def test_a_frame_is_these_bytes_and_these_bytes_are_the_frame(frame, data):
    data = bytes.fromhex(data)
    assert len(data) == SIZE
    assert pack(frame) == data
    assert unpack(data) == frame


@pytest.mark.parametrize(
    "data",
    [
        pytest.param("0a550190 09 000000 0000000000000000", id="nine_bytes_of_data"),
        pytest.param("0a550190 ff 000000 0000000000000000", id="255_bytes_of_data"),
        pytest.param("00080000 00 000000 0000000000000000", id="standard_identifier_of_12_bits"),
        pytest.param("ffffff5f 00 000000 0000000000000000", id="remote_with_29_bits"),
        pytest.param("", id="nothing"),
        pytest.param("0a550190 00 000000 00000000000000", id="fifteen_bytes"),
        pytest.param("0a550190 00 000000 000000000000000000", id="seventeen_bytes"),
    ],
)
def test_what_is_no_frame_is_none(data):
    assert unpack(bytes.fromhex(data)) is None


@pytest.mark.parametrize(
    ("identifier", "data", "flags"),
    [
        (0x20000000, b"", {}),
        (-1, b"", {}),
        (0x800, b"", {"extended": False}),
        (0x20000000, b"", {"extended": False, "error": True}),
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
