"""dataclasses.replace as quick as a decision needs it.

The library's own runs __init__ over every field of a frozen class, one by one: with the forty of
State that was a third of each update. For classes whose instances hold their fields and nothing
else, and check nothing when they are made.
"""

from __future__ import annotations

import platform
from typing import TYPE_CHECKING

# In the first case so that the names and types of the changes are checked all the same. PyPy,
# which can fly the campaign, compiles __init__, but copies a __dict__ five times as slowly.
if TYPE_CHECKING or platform.python_implementation() == "PyPy":
    from dataclasses import replace as replace
else:

    def replace(instance, /, **changes):
        """A copy with these fields changed."""
        copy = object.__new__(type(instance))
        copy.__dict__.update(instance.__dict__, **changes)
        return copy
