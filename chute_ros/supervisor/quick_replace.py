"""dataclasses.replace as quick as a decision needs it.

The library's own runs __init__ over every field of a frozen class, one by one: with the forty of
State that was a third of each update. For classes whose instances hold their fields and nothing
else, and check nothing when they are made.
"""

from __future__ import annotations

import functools
import platform
from dataclasses import fields
from typing import TYPE_CHECKING

# In the first case so that the names and types of the changes are checked all the same.
if TYPE_CHECKING:
    from dataclasses import replace as replace
elif platform.python_implementation() == "PyPy":
    # PyPy, which can fly the campaign, copies a __dict__ slowly, and attributes that are named in
    # the code at once: so for each class that code is written, as for its __init__.

    def replace(instance, /, **changes):
        """A copy with these fields changed."""
        copy = _copier(type(instance))(instance)
        for name, value in changes.items():
            object.__setattr__(copy, name, value)
        return copy

    @functools.cache
    def _copier(kind):
        copied = [f"    put(copy, {field.name!r}, one.{field.name})" for field in fields(kind)]
        code = ["def copier(one):", "    copy = new(kind)", *copied, "    return copy"]
        scope = {"kind": kind, "new": object.__new__, "put": object.__setattr__}
        exec("\n".join(code), scope)
        return scope["copier"]
else:

    def replace(instance, /, **changes):
        """A copy with these fields changed."""
        copy = object.__new__(type(instance))
        copy.__dict__.update(instance.__dict__, **changes)
        return copy
