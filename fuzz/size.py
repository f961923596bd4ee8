"""How long the stores of an object are: to see that nothing grows with what is fed to it."""

from __future__ import annotations

import types
from collections import deque
from collections.abc import Iterator, Mapping, Set
from typing import Any

#: Texts and bytes have one entry for each so many.
_BYTES_EACH = 64
#: What an instance has in common with all others; the last by their names, as importing them here
#: would import them for every target.
_SHARED = (type, types.ModuleType, types.FunctionType, types.BuiltinFunctionType)
_SHARED_NAMES = ("DataTypes", "DataType", "Layout")
_PLAIN = (int, float, complex, bool, type(None))
_TEXTS = (str, bytes, bytearray)
_STORES = (Mapping, Set, list, tuple, deque)


def stores_of(root: object) -> dict[str, int]:
    """Where root holds something -> the entries of the longest store that is there. A store in a
    store is at the same place: one place has a class and a name of that."""
    seen: set[int] = set()
    waiting: list[tuple[str, Any]] = [(type(root).__name__, root)]
    longest: dict[str, int] = {}
    while waiting:
        place, one = waiting.pop()
        shared = isinstance(one, _SHARED) or type(one).__name__ in _SHARED_NAMES
        if shared or isinstance(one, _PLAIN) or id(one) in seen:
            continue
        seen.add(id(one))
        entries = 0
        if isinstance(one, _TEXTS):
            entries = len(one) // _BYTES_EACH
        else:
            waiting += _held_by(place, one)
            entries = len(one) if isinstance(one, _STORES) else 0
        longest[place] = max(longest.get(place, 0), entries)
    return longest


def _held_by(place: str, one: Any) -> Iterator[tuple[str, Any]]:
    """What hangs on this object directly, and at which place that is."""
    if isinstance(one, _STORES):
        yield from ((place, entry) for entry in one)
        if isinstance(one, Mapping):
            yield from ((place, entry) for entry in one.values())
    elif isinstance(one, types.MethodType):
        yield place, one.__self__
    kind_name = type(one).__name__
    if hasattr(one, "__dict__"):
        yield from ((f"{kind_name}.{name}", value) for name, value in vars(one).items())
    for kind in type(one).__mro__:
        slots = vars(kind).get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if name not in ("__dict__", "__weakref__") and hasattr(one, name):
                yield f"{kind_name}.{name}", getattr(one, name)
