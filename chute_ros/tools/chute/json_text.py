"""Results as JSON: one object, with null for a number that is not known."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any


def json_text(value: Any) -> str:
    """One line; every character that is not ASCII is escaped, also those that move a cursor."""
    return json.dumps(_plain(value), allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, 3) if math.isfinite(value) else None
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {
            field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)
        }
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    return value
