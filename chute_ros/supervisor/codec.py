"""Inputs, outputs, states and settings of the core as JSON text and back, to the last bit.

Every frozen dataclass becomes an object that names its class under "is" and holds the fields that
differ from their defaults; floats keep every bit (Python writes the shortest text that reads back
as the same number); NaN and the infinities are written as JSON's common extension does.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import json
import types
import typing
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, cast

from chute_ros.errors import RecordError

#: Metadata of a field whose own fields stand in the object that it is in.
INLINE: Mapping[str, bool] = MappingProxyType({"inline": True})
#: Under this name an object says which class it is.
CLASS = "is"
#: What a text raises that stands for nothing; OverflowError: no float holds its whole number.
_MISFITS = (
    ValueError,
    TypeError,
    KeyError,
    AttributeError,
    RecursionError,
    OverflowError,
)
#: What JSON has as well; most values are of these, and are what they stand for.
_SIMPLE = (float, int, str, bool)
_SIZED = (str, tuple, frozenset, MappingProxyType)


class Codec:
    """Reads and writes the classes that it was given, and those that their fields name."""

    def __init__(self, *classes: type, once: Mapping[str, type] = MappingProxyType({})) -> None:
        """once: names of former versions, which are still read."""
        self._classes: dict[str, type] = dict(once)
        for one in classes:
            self._learn(one)

    def to_json(self, value: object, whole: bool = False) -> str:
        """One line of JSON. whole: with the fields that have their defaults as well, which may be
        others in another version."""
        return json.dumps(self.plain(value, whole), separators=(",", ":"))

    def from_json(self, text: str, kind: Any = object) -> Any:
        """What to_json was given; RecordError says what does not fit. kind: what it must be."""
        try:
            return self.value(json.loads(text), kind)
        except _MISFITS as error:
            raise RecordError(f"cannot be read: {error} in {text[:80]!r}") from error

    def plain(self, value: object, whole: bool) -> Any:
        """value in terms of JSON."""
        if type(value) in _SIMPLE:
            return value
        if isinstance(value, enum.Enum):
            return value.value
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            return {CLASS: type(value).__name__, **self._told(value, whole)}
        if isinstance(value, Mapping):
            return [[self.plain(key, whole), self.plain(one, whole)] for key, one in value.items()]
        if isinstance(value, (set, frozenset)):
            return sorted(self.plain(one, whole) for one in value)
        if isinstance(value, (tuple, list)):
            return [self.plain(one, whole) for one in value]
        return value

    def _told(self, value: object, whole: bool) -> dict[str, Any]:
        told: dict[str, Any] = {}
        for field, inline in _fields(cast(type, type(value))):
            one = getattr(value, field.name)
            if inline:
                told |= self._told(one, whole)
            elif whole or not _is_default(field, one):
                told[field.name] = self.plain(one, whole)
        return told

    def value(self, plain: Any, kind: Any) -> Any:
        """The value of this type that plain stands for."""
        if type(plain) is kind and kind in _SIMPLE:
            if kind is str:
                plain.encode()  # JSON can write what is no text, and cannot be told on
            return plain
        if isinstance(plain, dict):
            made = self._object(plain)
            # A field of another class would be found out only where it is used.
            if kind is object or isinstance(made, kind):
                return made
        if isinstance(kind, type) and dataclasses.is_dataclass(kind):
            raise RecordError(f"{plain!r} is no {kind.__name__}")
        origin, arguments = _parts(kind)
        if origin in (types.UnionType, typing.Union):
            if plain is None and type(None) in arguments:
                return None
            return self.value(plain, next(one for one in arguments if one is not type(None)))
        if origin is tuple:
            kinds = arguments if arguments[-1] is not Ellipsis else arguments[:1] * len(plain)
            return tuple(self.value(one, k) for one, k in zip(plain, kinds, strict=True))
        if origin is frozenset:
            return frozenset(self.value(one, arguments[0]) for one in plain)
        if isinstance(origin, type) and issubclass(origin, Mapping):
            pairs = ((self.value(k, arguments[0]), self.value(v, arguments[1])) for k, v in plain)
            return MappingProxyType(dict(pairs))
        if isinstance(kind, type) and issubclass(kind, enum.Enum):
            return kind(plain)
        if kind is float and isinstance(plain, (int, float)):
            return float(plain)
        if kind in (float, int, str, bool) and not isinstance(plain, kind):
            raise RecordError(f"{plain!r} is no {kind.__name__}")
        return plain

    def _object(self, plain: dict[str, Any]) -> Any:
        name = plain[CLASS]
        if name not in self._classes:
            raise RecordError(f"class {name} is not known: written by another version")
        kind = self._classes[name]
        unknown = sorted(set(plain) - _names(kind) - {CLASS})
        if unknown:
            raise RecordError(f"{name} has no {', '.join(unknown)}: written by another version")
        return self._made(kind, plain)

    def _made(self, kind: type, plain: dict[str, Any]) -> Any:
        hints, told = _hints(kind), {}
        for field, inline in _fields(kind):
            if inline:
                told[field.name] = self._made(hints[field.name], plain)
            elif field.name in plain:
                told[field.name] = self.value(plain[field.name], hints[field.name])
        return kind(**told)

    def _learn(self, kind: Any) -> None:
        if dataclasses.is_dataclass(kind) and isinstance(kind, type):
            if kind.__name__ not in self._classes:
                self._classes[kind.__name__] = kind
                for hint in _hints(kind).values():
                    self._learn(hint)
            return
        for argument in typing.get_args(kind):
            self._learn(argument)


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    return typing.get_type_hints(kind)


@functools.cache
def _fields(kind: type) -> tuple[tuple[dataclasses.Field[Any], bool], ...]:
    """Each field, and whether its own stand in the object that it is in."""
    return tuple((field, field.metadata == INLINE) for field in dataclasses.fields(kind))


@functools.cache
def _names(kind: type) -> frozenset[str]:
    """The fields of an object of this class."""
    inner = [_names(_hints(kind)[field.name]) for field, inline in _fields(kind) if inline]
    return frozenset({field.name for field, inline in _fields(kind) if not inline}.union(*inner))


@functools.cache
def _parts(kind: Any) -> tuple[Any, tuple[Any, ...]]:
    """Of a type with others in it: tuple[int, str] is tuple, and those two."""
    return typing.get_origin(kind), typing.get_args(kind)


def _is_default(field: dataclasses.Field[Any], value: object) -> bool:
    """Exactly, and all that it holds: 0 and 0.0 and -0.0 and False are equal, and differ."""
    if field.default is not dataclasses.MISSING:
        default = field.default
    elif field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    else:
        return False
    if value is default or type(value) is not type(default):
        return value is default
    if isinstance(value, _SIZED) and isinstance(default, _SIZED) and len(value) != len(default):
        return False  # their texts may be long
    return repr(value) == repr(default)
