"""How a simulated device tells its errors in the data types in use.

As bits of error_flags with a constant ERROR_* each, as in the types that we ship, or as a field
error_* each, as in those of a vendor.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from chute_ros.links.upf.protocol.definitions import Definitions

_FLAGS = "error_flags"
#: Name of an error -> (field that tells it, its value there).
Places = Mapping[str, tuple[str, int]]


def error_places(definitions: Definitions, message: str) -> Places:
    """Every error that a message type can tell."""
    kind = definitions.types.message(message)
    places: dict[str, tuple[str, int]] = {}
    if _FLAGS in kind.fields:
        for name, bit in kind.constants.items():
            if name.startswith("ERROR_"):
                places[name.removeprefix("ERROR_")] = (_FLAGS, bit)
    for field in kind.fields:
        if field.startswith("error_") and field != _FLAGS:
            places.setdefault(field.removeprefix("error_").upper(), (field, 1))
    return places


def told_errors(places: Places, errors: Collection[str]) -> dict[str, int]:
    """Fields of the message that tell these errors, as far as there are places for them."""
    told: dict[str, int] = {}
    for name, (field, value) in places.items():
        told[field] = told.get(field, 0) | (value if name in errors else 0)
    return told
