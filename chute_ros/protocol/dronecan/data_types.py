"""DSDL data types in use: looked up by name or id, turned to payloads and back.

Values are plain: a structure is a dict of its fields, a union a dict of its one field, an array of
uint8 bytes, another array a list. Source: DroneCAN specification, "Data structure description
language"; the parser and the bit layout are those of pydronecan.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from typing import Any

from dronecan.dsdl import common, parser
from dronecan.transport import CompoundValue, bits_from_bytes, bytes_from_bits

from chute_ros.errors import MessageError

Values = Mapping[str, Any]
_FLOAT_EXTREMES = ("nan", "inf", "-inf")
_MISFITS = (AttributeError, IndexError, KeyError, TypeError, ValueError, OverflowError)


class DataType:
    """One message type, or one direction of a service type."""

    def __init__(self, dsdl_type: Any, mode: str | None) -> None:
        self.name: str = dsdl_type.full_name
        self.id: int = dsdl_type.default_dtid
        self.is_service = dsdl_type.kind == parser.CompoundType.KIND_SERVICE
        signature = struct.pack("<Q", dsdl_type.get_data_type_signature())
        #: Start of the CRC of a transfer with several frames.
        self.base_crc: int = common.crc16_from_bytes(signature)
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

    def encode(self, values: Values) -> bytes:
        """The payload; fields that are not given are 0. MessageError for a value or name that
        does not fit: the library would cut it to size without a word."""
        value = CompoundValue(self._type, _mode=self._mode)
        try:
            _fill(value, values)
        except (
            AttributeError,
            IndexError,
            KeyError,
            TypeError,
            ValueError,
            OverflowError,
        ) as error:
            raise MessageError(f"{self.name} cannot carry {dict(values)}: {error}") from None
        return bytes(bytes_from_bits(value._pack()))

    def decode(self, payload: bytes) -> dict[str, Any] | None:
        """The values in payload; None if it is too short or makes no sense. Never raises."""
        value = CompoundValue(self._type, _mode=self._mode)
        try:
            value._unpack(bits_from_bytes(payload))
            plain: dict[str, Any] = _plain(value)
        except (*_MISFITS, struct.error):
            return None
        return plain


class DataTypes:
    """The types that a bus speaks."""

    def __init__(self, dsdl_types: Iterable[Any]) -> None:
        self._by_name: dict[tuple[str, str | None], DataType] = {}
        self._by_id: dict[tuple[int, str | None], DataType] = {}
        for one in dsdl_types:
            service = one.kind == parser.CompoundType.KIND_SERVICE
            if one.default_dtid is None:
                continue
            for mode in ("request", "response") if service else (None,):
                made = DataType(one, mode)
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
    for name, one in values.items():
        field = value._fields[name]
        if isinstance(one, Mapping):
            if value._is_union:
                value._union_field = name
            _fill(field, one)
        elif isinstance(one, (bytes, bytearray)):
            if value._is_union:
                value._union_field = name
            if len(one) > field._type.max_size:
                raise ValueError(f"{name}: {len(one)} bytes, need at most {field._type.max_size}")
            field.from_bytes(one)
        else:
            _check_range(name, field._type, one)
            setattr(value, name, one)


def _check_range(name: str, kind: Any, value: Any) -> None:
    if not isinstance(kind, parser.PrimitiveType) or kind.kind == kind.KIND_BOOLEAN:
        return
    low, high = kind.value_range
    if kind.kind == kind.KIND_FLOAT:
        if not low <= value <= high and str(float(value)) not in _FLOAT_EXTREMES:
            raise ValueError(f"{name} is {value}, need {low:g} to {high:g}")
    elif kind.cast_mode == kind.CAST_MODE_SATURATED and not low <= value <= high:
        raise ValueError(f"{name} is {value}, need {low} to {high}")


def _plain(value: Any) -> Any:
    """A value of the library as plain Python."""
    if isinstance(value, CompoundValue):
        fields = value._fields
        names = [value._union_field or next(iter(fields))] if value._is_union else list(fields)
        return {name: _plain(fields[name]) for name in names if not name.startswith("_void_")}
    if hasattr(value, "to_bytes"):
        kind = value._type.value_type
        if isinstance(kind, parser.PrimitiveType) and kind.bitlen == 8:
            return value.to_bytes()
        return [_plain(one) if hasattr(one, "_type") else one for one in value]
    return value.value
