"""The layouts of $TELEM: which fields, in which order. Each is a file in msg_defs/telem.

Source: Umbilical Reference, section 3; the other layouts were found in the field.
"""

from __future__ import annotations

import math
import platform
import re
import struct
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.protocol.fields import TYPES, FieldType, Value, convert, problem_of

if TYPE_CHECKING or platform.python_implementation() != "PyPy":
    from orjson import loads
else:  # orjson is not for PyPy, which can fly the campaign
    from json import loads

#: The layout of the reference, which is preferred where a line does not tell.
REFERENCE_LAYOUT = "telem57_airbrake_state"

#: What JSON's numbers are written with, but for exponents.
_PLAIN = b"-0123456789.,"
#: Characters of a line that is surely read exactly, whoever reads it: of a number of more than 768
#: digits that lies between two floats, some readers take the wrong one.
_MOST_AT_ONCE = 768

#: Fields that every layout must have, because what is decided rests on them.
NEEDED = (
    "flight_mode",
    "altitude",
    "sv_open",
    "mav_open",
    "ssa_drogue_deployed",
    "ssa_main_deployed",
    "ms_since_boot_cfc",
)
#: Those of them that are whole numbers.
_WHOLE = tuple(name for name in NEEDED if name != "altitude")
#: What a file may say, of itself and of each field.
_KEYS = ("name", "target_floats", "target_fields", "heartbeat_in_flight", "fields")
_FIELD_KEYS = ("name", "type", "unit", "expected")


@dataclass(frozen=True)
class Field:
    """One field. expected: (lowest, highest) that it is meant to hold, None: whatever fits."""

    name: str
    kind: FieldType
    unit: str
    expected: tuple[float, float] | None = None


@dataclass(frozen=True)
class Problem:
    """Why a line is no record: reason to count under, detail for a person."""

    reason: str
    detail: str


class Layout:
    """One layout. target_floats: of the set-target command; target_fields: what shows it.
    heartbeat_in_flight: its firmware wants <H> in flight as well."""

    def __init__(
        self,
        name: str,
        fields: tuple[Field, ...],
        target_floats: int,
        target_fields: tuple[str, ...],
        heartbeat_in_flight: bool = False,
    ) -> None:
        self.name, self.fields, self.target_floats = name, fields, target_floats
        self.target_fields, self.heartbeat_in_flight = target_fields, heartbeat_in_flight
        self.index = {field.name: number for number, field in enumerate(fields)}
        self._sure = re.compile(",".join(field.kind.sure_pattern for field in fields))
        self._ranges = struct.Struct("<" + "".join(f.kind.code for f in fields))
        self._typed = struct.Struct("<" + "".join(f.kind.code.replace("f", "d") for f in fields))
        flags = [i for i, field in enumerate(fields) if field.kind.highest == 1]
        # Twice, as of one alone itemgetter makes no tuple.
        self._flags = itemgetter(*flags, *flags) if flags else None
        self._expected = [(i, f.expected) for i, f in enumerate(fields) if f.expected is not None]

    @property
    def count(self) -> int:
        """Fields of a line."""
        return len(self.fields)

    def decode(self, body: str) -> tuple[Value, ...] | Problem:
        """The values of a line (without "$TELEM," and its end), or why it is no record."""
        # First all at once, which is the usual case; only then field by field for the reason.
        if (values := self._at_once(body)) is not None:
            return values
        texts = body.split(",")
        if self._sure.fullmatch(body):
            return self._converted(texts)
        if len(texts) != self.count:
            text = f"{len(texts)} fields where {self.name} has {self.count}"
            return Problem("field count", text)
        for field, text in zip(self.fields, texts, strict=True):
            reason = problem_of(field.kind, text)
            if reason:
                shown = text if len(text) <= 50 else f"{text[:47]}..."
                return Problem(reason, f"{field.name} ({field.kind.name}) is {shown!r}")
        return self._converted(texts)

    def is_as_expected(self, values: tuple[Value, ...]) -> bool:
        """Every field holds what it is meant to: tells layouts of one count apart."""
        return all(low <= values[i] <= high for i, (low, high) in self._expected)

    def _at_once(self, body: str) -> tuple[Value, ...] | None:
        """The values, by compiled code; None: not all are JSON's numbers within their ranges."""
        if len(body) > _MOST_AT_ONCE or not body.isascii():
            return None
        raw = body.encode()
        # JSON has exponents, blanks and lists, too; and a zero loses its sign there.
        if raw.translate(None, _PLAIN) or b"-0," in raw or raw.endswith(b"-0"):
            return None
        try:
            values = loads(b"[%b]" % raw)
            self._ranges.pack(*values)
        except (ValueError, OverflowError, struct.error):
            return None
        if self._flags is not None and max(self._flags(values)) > 1:
            return None
        # A float without a fraction is an int in JSON: through the structure each gets its type.
        return self._typed.unpack(self._typed.pack(*values))

    def _converted(self, texts: list[str]) -> tuple[Value, ...]:
        return tuple(convert(f.kind, text) for f, text in zip(self.fields, texts, strict=True))


@dataclass
class Record:
    """One $TELEM line, which nobody changes. received: monotonic s."""

    layout: Layout
    values: tuple[Value, ...]
    received: float

    def __contains__(self, name: str) -> bool:
        return name in self.layout.index

    def __getitem__(self, name: str) -> Value:
        return self.values[self.layout.index[name]]

    def number(self, name: str) -> float:
        """The field's value; NaN: not in the layout."""
        return float(self[name]) if name in self else float("nan")


def layout_from(content: Mapping[str, Any], where: str) -> Layout:
    """The layout in a file's content; ParameterError, with where, if there is a mistake in it."""
    try:
        _known(content, _KEYS)
        fields = tuple(_field(one) for one in content["fields"])
        layout = Layout(
            _word(content["name"]),
            fields,
            _whole_number(content["target_floats"]),
            tuple(_word(one) for one in content["target_fields"]),
            _switch(content.get("heartbeat_in_flight", False)),
        )
    except (LookupError, OverflowError, TypeError, ValueError) as error:
        raise ParameterError(f"{where}: no layout of $TELEM: {error!r}") from None
    missing = [name for name in (*NEEDED, *layout.target_fields) if name not in layout.index]
    if missing:
        raise ParameterError(f"{where}: the layout lacks {', '.join(missing)}")
    broken = [name for name in _WHOLE if not layout.fields[layout.index[name]].kind.is_whole]
    if broken:
        raise ParameterError(f"{where}: {', '.join(broken)} must be of a whole number's type")
    if len(layout.index) != layout.count:
        raise ParameterError(f"{where}: a field is named twice")
    if layout.target_floats not in (2, 4):
        raise ParameterError(f"{where}: target_floats is {layout.target_floats}: need 2 or 4")
    if len(layout.target_fields) not in (0, layout.target_floats):
        raise ParameterError(f"{where}: target_fields must be as many as target_floats, or none")
    return layout


def _field(content: Mapping[str, Any]) -> Field:
    if _word(content["type"]) not in TYPES:
        raise ValueError(f"type {content['type']}: need one of {', '.join(TYPES)}")
    _known(content, _FIELD_KEYS)
    expected = content.get("expected")
    limits = None if expected is None else _limits(expected)
    name, unit = _word(content["name"]), _word(content["unit"])
    return Field(name, TYPES[_word(content["type"])], unit, limits)


def _known(content: Mapping[str, Any], names: Collection[str]) -> None:
    """A name that is misspelt would be left out without a word."""
    if unknown := [str(name) for name in content if name not in names]:
        raise ValueError(f"there is no {unknown[0][:40]}: need one of {', '.join(names)}")


def _whole_number(content: Any) -> int:
    if isinstance(content, bool) or not isinstance(content, int):
        raise TypeError(f"target_floats is {content!r:.40}: need a whole number")
    return content


def _limits(content: Any) -> tuple[float, float]:
    low, high = (float(one) for one in content)
    if not -math.inf < low <= high < math.inf:
        raise ValueError(f"expected is {low:g} to {high:g}: need the lowest and the highest")
    return low, high


def _word(content: Any) -> str:
    """One word or number; not a list, which the file's aliases may make endless."""
    if not isinstance(content, (str, int, float)):
        raise TypeError(f"a word is needed, not a {type(content).__name__}")
    return str(content)


def _switch(content: Any) -> bool:
    if not isinstance(content, bool):
        raise TypeError(f"heartbeat_in_flight is {content!r}: need true or false")
    return content
