"""DSDL types whose fields are numbers at fixed places, read and written without the library.

What a UPF parachute tells many times a second is of this kind, and the library goes over it bit by
bit, as text. It stays the judge of everything else, and of what does not fit.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from dronecan.dsdl import parser

_MISFITS = (AttributeError, TypeError, ValueError, OverflowError)
_FLOATS = {16: struct.Struct("<e"), 32: struct.Struct("<f"), 64: struct.Struct("<d")}
_F32_BITS = struct.Struct("<I")
#: Of a float of 32 bits; and what infinity is of one of 16, in its places.
_SIGN, _INFINITE, _INFINITE_F16 = 0x8000_0000, 0x7F80_0000, 0x0F80_0000
_DROPPED, _HALF_A_STEP = 0xFFF, 0x1000


@dataclass(frozen=True)
class _Number:
    """So many bits, the first of which is bit start. kind: of the library's primitives."""

    kind: int
    start: int
    bits: int
    low: float
    high: float

    def read(self, wire: int) -> float:
        """The value of these bits in the order of the wire."""
        if self.kind == parser.PrimitiveType.KIND_FLOAT:
            value: float = _FLOATS[self.bits].unpack(wire.to_bytes(self.bits // 8, "big"))[0]
            return value
        number = _from_wire(wire, self.bits)
        if self.kind == parser.PrimitiveType.KIND_BOOLEAN:
            return bool(number)
        if self.kind == parser.PrimitiveType.KIND_SIGNED_INT and number >> (self.bits - 1):
            return number - (1 << self.bits)
        return number

    def write(self, value: Any) -> int:
        """The bits of a value in the order of the wire. One of _MISFITS: the library must say
        what is to be done with it."""
        if not self.low <= value <= self.high:
            raise ValueError(value)
        if self.kind == parser.PrimitiveType.KIND_BOOLEAN:
            return int(bool(value))
        if self.kind != parser.PrimitiveType.KIND_FLOAT:
            return _to_wire(value.__index__() & ((1 << self.bits) - 1), self.bits)
        if self.bits == 16:
            return _to_wire(f16_bits(value), 16)
        return int.from_bytes(_FLOATS[self.bits].pack(value), "big")


class FlatLayout:
    """fields: (name, the library's type) in the order of the wire."""

    def __init__(self, fields: Iterable[tuple[str, Any]]) -> None:
        self._numbers: dict[str, _Number] = {}
        #: Bits of all; and up to the end of the last number: padding behind it may be missing.
        self._size = self._need = 0
        for name, kind in fields:
            if isinstance(kind, parser.PrimitiveType):
                self._numbers[name] = _Number(
                    kind.kind, self._size, kind.bitlen, *number_range(kind)
                )
                self._need = self._size + kind.bitlen
            self._size += kind.bitlen

    def decode(self, payload: bytes) -> dict[str, Any] | None:
        """The values; None: it is too short."""
        size = 8 * len(payload)
        if size < self._need:
            return None
        whole = int.from_bytes(payload, "big")
        return {
            name: one.read(whole >> (size - one.start - one.bits) & ((1 << one.bits) - 1))
            for name, one in self._numbers.items()
        }

    def encode(self, values: Mapping[str, Any]) -> bytes | None:
        """The payload; None: something does not fit, or only the library knows whether it does."""
        length = (self._size + 7) // 8
        whole = 0
        for name, value in values.items():
            one = self._numbers.get(name)
            if one is None:
                return None
            try:
                whole |= one.write(value) << (8 * length - one.start - one.bits)
            except _MISFITS:
                return None
        return whole.to_bytes(length, "big")


def flat_layout(fields: Iterable[Any], is_union: bool) -> FlatLayout | None:
    """The layout of the library's fields; None: they are not all numbers at fixed places."""
    known = [(field.name, field.type) for field in fields]
    flat = all(isinstance(kind, (parser.PrimitiveType, parser.VoidType)) for _, kind in known)
    return FlatLayout(known) if flat and not is_union else None


def number_range(kind: Any) -> tuple[float, float]:
    """The library's own is off by one for signed integers of more than 53 bits."""
    if kind.kind == kind.KIND_FLOAT:
        low, high = kind.value_range
        return low, high
    if kind.kind == kind.KIND_SIGNED_INT:
        half = 1 << (kind.bitlen - 1)
        return -half, half - 1
    return 0, (1 << kind.bitlen) - 1


def _from_wire(wire: int, bits: int) -> int:
    """The lowest byte comes first, and what is left of the highest last."""
    if bits <= 8:
        return wire
    count, rest = divmod(bits, 8)
    low = (wire >> rest).to_bytes(count, "big")
    return (wire & ((1 << rest) - 1)) << 8 * count | int.from_bytes(low, "little")


def _to_wire(number: int, bits: int) -> int:
    if bits <= 8:
        return number
    count, rest = divmod(bits, 8)
    low = (number & ((1 << 8 * count) - 1)).to_bytes(count, "big")
    return int.from_bytes(low, "little") << rest | number >> 8 * count


def f16_bits(value: float) -> int:
    """The sixteen bits of a float, rounded as libuavcan does it: half a step away from zero."""
    bits: int
    (bits,) = _F32_BITS.unpack(_FLOATS[32].pack(value))
    sign, bits = (bits & _SIGN) >> 16, bits & ~_SIGN
    if bits >= _INFINITE:
        return sign | (0x7FFF if bits > _INFINITE else 0x7C00)
    (cut,) = _FLOATS[32].unpack(_F32_BITS.pack(bits & ~_DROPPED))
    # The exponents of the two differ by this; what is too small loses bits here.
    (bits,) = _F32_BITS.unpack(_FLOATS[32].pack(math.ldexp(cut, 15 - 127)))
    return sign | min(bits + _HALF_A_STEP, _INFINITE_F16) >> 13
