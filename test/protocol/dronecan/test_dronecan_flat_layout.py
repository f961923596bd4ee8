"""Types that are read and written without the library: never otherwise than it does it."""

from __future__ import annotations

import copy
import math
import struct
from typing import Any

import pytest
from dronecan.transport import f16_from_f32, f32_from_f16
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.errors import MessageError
from chute_ros.protocol.dronecan.data_types import DataType
from chute_ros.protocol.dronecan.flat_layout import f16_bits
from chute_ros.transport.data_types import load_data_types

_TYPES = load_data_types("", "the data types")
_FLAT = [one for one in _TYPES._by_name.values() if one._flat is not None]

numbers = st.one_of(
    st.booleans(),
    st.integers(-(2**63), 2**64),
    st.integers(-300, 300),
    st.floats(),
    st.floats(-70000.0, 70000.0),
)


def by_library(one: DataType) -> DataType:
    """The same type, read and written by the library alone."""
    slow = copy.copy(one)
    slow._flat = None
    return slow


def encoded(one: DataType, values: dict[str, Any]) -> bytes | str:
    try:
        return one.encode(values)
    except MessageError as error:
        return str(error)


def test_what_comes_often_is_flat() -> None:
    names = {one.name for one in _FLAT}
    often = {"ParachuteStatus", "TriggerStatus", "VehicleStatus"}
    assert {f"flyfire.{name}" for name in often} | {"uavcan.protocol.NodeStatus"} <= names
    assert "uavcan.protocol.param.GetSet" not in names, "it has a union and an array"


@given(st.sampled_from(_FLAT), st.binary(max_size=40))
def test_it_reads_as_the_library_does(one: DataType, payload: bytes) -> None:
    slow = by_library(one)
    values = one.decode(payload)
    # By their texts: NaN is not itself, and True is 1.
    assert repr(values) == repr(slow.decode(payload))
    if values is not None:
        assert encoded(one, values) == encoded(slow, values)


@given(st.data())
def test_it_writes_as_the_library_does_and_refuses_with_its_words(data: st.DataObject) -> None:
    one = data.draw(st.sampled_from([one for one in _FLAT if one.fields]))
    names = st.sampled_from((*one.fields, "no_such_field"))
    values = data.draw(st.dictionaries(names, numbers, max_size=len(one.fields)))
    assert encoded(one, values) == encoded(by_library(one), values)


def test_every_half_is_read_as_the_library_does() -> None:
    for bits in range(0x10000):
        read = struct.unpack("<e", bits.to_bytes(2, "little"))[0]
        assert repr(read) == repr(f32_from_f16(bits))


@given(st.one_of(st.floats(width=32), st.floats(-66000.0, 66000.0), st.floats(-1e-4, 1e-4)))
def test_a_half_is_rounded_as_the_library_does(value: float) -> None:
    assert f16_bits(value) == f16_from_f32(value)


@pytest.mark.parametrize("value", [0.0, -0.0, math.nan, math.inf, -math.inf, 65519.9, 3e-8, 1e-40])
def test_the_ends_of_a_half(value: float) -> None:
    assert f16_bits(value) == f16_from_f32(value)
