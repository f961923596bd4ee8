"""How much an object holds: to see that nothing grows with what is fed to it."""

from __future__ import annotations

import types
from collections import deque
from collections.abc import Mapping, Set
from typing import Any

#: Texts and bytes count one more for each so many.
_BYTES_EACH = 64
#: What an instance has in common with all others; the last by their names, as importing them here
#: would import them for every target.
_SHARED = (type, types.ModuleType, types.FunctionType, types.BuiltinFunctionType)
_SHARED_NAMES = ("DataTypes", "DataType", "Layout")
_PLAIN = (int, float, complex, bool, type(None))
_TEXTS = (str, bytes, bytearray)


def size_of(root: object) -> int:
    """The objects that root holds, each counted once."""
    seen: set[int] = set()
    waiting: list[Any] = [root]
    total = 0
    while waiting:
        one = waiting.pop()
        shared = isinstance(one, _SHARED) or type(one).__name__ in _SHARED_NAMES
        if shared or isinstance(one, _PLAIN) or id(one) in seen:
            continue
        seen.add(id(one))
        total += 1
        if isinstance(one, _TEXTS):
            total += len(one) // _BYTES_EACH
        else:
            waiting += _held_by(one)
            total += len(one) if isinstance(one, (Mapping, Set, list, tuple, deque)) else 0
    return total


def _held_by(one: Any) -> list[Any]:
    """What hangs on this object directly."""
    held: list[Any] = []
    if isinstance(one, Mapping):
        held += [*one.keys(), *one.values()]
    elif isinstance(one, (Set, list, tuple, deque)):
        held += one
    elif isinstance(one, types.MethodType):
        held.append(one.__self__)
    held += vars(one).values() if hasattr(one, "__dict__") else ()
    for kind in type(one).__mro__:
        slots = vars(kind).get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if name not in ("__dict__", "__weakref__") and hasattr(one, name):
                held.append(getattr(one, name))
    return held
