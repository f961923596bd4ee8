"""DSDL data types in use: looked up by name or id, turned to payloads and back.

Values are plain: a structure maps its fields, a union its one field, an array of uint8 is bytes,
another one a sequence; nobody can change what was read. Source: DroneCAN specification, "Data
structure description language"; the parser and the bit layout are those of pydronecan.
"""

from __future__ import annotations

import math
import struct
from binascii import crc_hqx
from collections.abc import Iterable, Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from dronecan.dsdl import parser
from dronecan.transport import (
    ArrayValue,
    BaseValue,
    CompoundValue,
    PrimitiveValue,
    bits_from_bytes,
    bytes_from_bits,
)

from chute_ros.errors import MessageError, ParameterError

Values = Mapping[str, Any]
#: Payloads of a type that are remembered: devices say the same again and again.
_REMEMBERED = 64
_MISFITS = (AttributeError, IndexError, KeyError, TypeError, ValueError, OverflowError)


class DataType:
    """One message type, or one direction of a service type."""

    def __init__(self, dsdl_type: Any, mode: str | None) -> None:
        self.name: str = dsdl_type.full_name
        self.id: int = dsdl_type.default_dtid
        self.is_service = dsdl_type.kind == parser.CompoundType.KIND_SERVICE
        signature = struct.pack("<Q", dsdl_type.get_data_type_signature())
        #: Start of the CRC of a transfer with several frames.
        self.base_crc: int = crc_hqx(signature, 0xFFFF)
        self._type, self._mode = dsdl_type, mode
        if mode == "request":
            fields, constants = dsdl_type.request_fields, dsdl_type.request_constants
        elif mode == "response":
            fields, constants = dsdl_type.response_fields, dsdl_type.response_constants
        else:
            fields, constants = dsdl_type.fields, dsdl_type.constants
        #: Names of the fields in the order of the wire.
        self.fields: tuple[str, ...] = tuple(
            field.name for field in fields if field.type.category != field.type.CATEGORY_VOID
        )
        self.constants: dict[str, Any] = {one.name: one.value for one in constants}
        self._named: dict[str, dict[Any, str]] = {}
        self._decoded = lru_cache(maxsize=_REMEMBERED)(self._decode)

    def named(self, prefix: str) -> Mapping[Any, str]:
        """Value -> the first constant that has it, of those with this prefix."""
        if prefix not in self._named:
            some = [name for name in self.constants if name.startswith(prefix)]
            self._named[prefix] = {self.constants[name]: name for name in reversed(some)}
        return self._named[prefix]

    def encode(self, values: Values) -> bytes:
        """The payload; fields that are not given are 0. MessageError for a value or name that
        does not fit: the library would cut it to size without a word."""
        value = CompoundValue(self._type, _mode=self._mode)
        try:
            _fill(value, values)
        except _MISFITS as error:
            raise MessageError(f"{self.name} cannot carry {dict(values)}: {error}") from None
        return bytes(bytes_from_bits(value._pack()))

    def decode(self, payload: bytes) -> Values | None:
        """The values in payload; None if it is too short or makes no sense. Never raises."""
        return self._decoded(payload)

    def _decode(self, payload: bytes) -> Values | None:
        value = CompoundValue(self._type, _mode=self._mode)
        try:
            value._unpack(bits_from_bytes(payload))
            plain: Values = _plain(value)
        except (*_MISFITS, struct.error):
            return None
        return plain


class DataTypes:
    """The types that a bus speaks. ParameterError: two of them have the same id."""

    def __init__(self, dsdl_types: Iterable[Any]) -> None:
        self._by_name: dict[tuple[str, str | None], DataType] = {}
        self._by_id: dict[tuple[int, str | None], DataType] = {}
        for one in dsdl_types:
            service = one.kind == parser.CompoundType.KIND_SERVICE
            if one.default_dtid is None:
                continue
            for mode in ("request", "response") if service else (None,):
                made = DataType(one, mode)
                other = self._by_id.get((made.id, mode), made)
                if (other.name, other.base_crc) != (made.name, made.base_crc):
                    raise ParameterError(
                        f"data type id {made.id} belongs to {other.name} and to {made.name}: "
                        "one of the two must have another"
                    )
                self._by_name[one.full_name, mode] = made
                self._by_id[one.default_dtid, mode] = made

    def message(self, name: str) -> DataType:
        """The message type of this name; KeyError: there is none."""
        return self._by_name[name, None]

    def request(self, name: str) -> DataType:
        """The request of the service of this name; KeyError: there is none."""
        return self._by_name[name, "request"]

    def response(self, name: str) -> DataType:
        """The response of the service of this name; KeyError: there is none."""
        return self._by_name[name, "response"]

    def find(self, name: str, mode: str | None) -> DataType | None:
        """By name and "request", "response" or None; None: there is none."""
        return self._by_name.get((name, mode))

    def by_id(self, number: int, mode: str | None) -> DataType | None:
        """By data type id and "request", "response" or None; None: there is none."""
        return self._by_id.get((number, mode))


def _fill(value: Any, values: Values) -> None:
    """Set the fields of a compound value of the library."""
    if value._is_union and len(values) > 1:
        raise ValueError("a union has one field")
    for name, one in values.items():
        if name not in value._fields:
            raise ValueError(f"there is no field {name}")
        if value._is_union:
            value._union_field = name
        _set(name, value._fields[name], one)


def _set(name: str, field: Any, one: Any) -> None:
    """Set one field, or one item of an array."""
    if isinstance(field, PrimitiveValue):
        _check_range(name, field._type, one)
        field.value = one
    elif isinstance(field, CompoundValue):
        if not isinstance(one, Mapping):
            raise TypeError(f"{name} is {one!r}, need its fields by name")
        _fill(field, one)
    elif isinstance(field, ArrayValue):
        _set_array(name, field, one)
    else:
        raise ValueError(f"{name} is padding")


def _set_array(name: str, field: Any, items: Any) -> None:
    kind, most = field._type, field._type.max_size
    if isinstance(items, (bytes, bytearray)) != _is_bytes(kind) or isinstance(items, str):
        raise TypeError(f"{name} is {items!r}, need {'bytes' if _is_bytes(kind) else 'a list'}")
    fixed = kind.mode == kind.MODE_STATIC
    if len(items) > most or (fixed and len(items) < most):
        need = most if fixed else f"at most {most}"
        raise ValueError(f"{name} has {len(items)} items, need {need}")
    made = []
    for item in items:
        made.append(field.new_item())
        _set(name, made[-1], item)
    # The library's own insert takes plain numbers, and would cut them to size.
    field._ArrayValue__items = made


def _is_bytes(kind: Any) -> bool:
    item = kind.value_type
    return (
        isinstance(item, parser.PrimitiveType)
        and item.kind == item.KIND_UNSIGNED_INT
        and item.bitlen == 8
    )


def _check_range(name: str, kind: Any, value: Any) -> None:
    low, high = _range(kind)
    if not low <= value <= high and not (kind.kind == kind.KIND_FLOAT and _fits(kind, value)):
        raise ValueError(f"{name} is {value}, need {low} to {high}")


def _range(kind: Any) -> tuple[float, float]:
    """The library's own is off by one for signed integers of more than 53 bits."""
    if kind.kind == kind.KIND_FLOAT:
        low, high = kind.value_range
        return low, high
    if kind.kind == kind.KIND_SIGNED_INT:
        half = 1 << (kind.bitlen - 1)
        return -half, half - 1
    return 0, (1 << kind.bitlen) - 1


def _fits(kind: Any, value: float) -> bool:
    """NaN always; infinity where the library does not make the largest number of it."""
    infinite_too = kind.cast_mode == kind.CAST_MODE_TRUNCATED
    return math.isnan(value) or (infinite_too and math.isinf(value))


def _plain(value: Any) -> Any:
    """A value of the library as plain Python."""
    if isinstance(value, CompoundValue):
        fields = value._fields
        names = [value._union_field] if value._is_union else list(fields)
        told = {name: _plain(fields[name]) for name in names if not name.startswith("_void_")}
        return MappingProxyType(told)
    if isinstance(value, ArrayValue):
        if len(value) > value._type.max_size:
            raise ValueError("more items than the type has")
        if _is_bytes(value._type):
            return value.to_bytes()
        return tuple([_plain(one) if isinstance(one, BaseValue) else one for one in value])
    return value.value
