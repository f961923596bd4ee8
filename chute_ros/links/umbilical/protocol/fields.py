"""One field of a $TELEM line: text to value, exactly as its type allows.

Source: Umbilical Reference, section 3 (types). The flight computer prints as Rust does: whole
numbers without leading zeros, floats without an exponent, NaN, inf and -inf by these names.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

Value = int | float

#: From here on a number rounds to infinity as a 32-bit float (IEEE 754).
_F32_LIMIT = 3.4028235677973366e38
_F64_LIMIT = 1.7976931348623157e308

_WHOLE = r"(?:0|-?[1-9][0-9]{0,9})"
_FLOAT = r"(?:-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?|-?inf|NaN)"
#: All that a whole record is written with.
_WRITTEN_WITH = b"-0123456789.,Nainf"
_NOT_FINITE = ("NaN", "inf", "-inf")


@dataclass(frozen=True)
class FieldType:
    """A type by its Rust name (bool01: 0 or 1), with its inclusive range."""

    name: str
    #: As struct has it, which knows its range.
    code: str
    is_whole: bool
    lowest: float
    highest: float

    @property
    def pattern(self) -> str:
        """A regular expression for what is printed; the range is checked apart."""
        return _WHOLE if self.is_whole else _FLOAT

    @property
    def sure_pattern(self) -> str:
        """One for what is printed and so short that it is in range: most of what comes."""
        digits = len(str(int(self.highest))) - 1
        if not self.is_whole:
            return _FLOAT.replace("[0-9]*", f"[0-9]{{0,{digits - 1}}}", 1)
        if not digits:
            return f"[0-{self.highest}]"
        sign = "-?" if self.lowest < 0 else ""
        return f"(?:0|{sign}[1-9][0-9]{{0,{digits - 1}}})"


TYPES: dict[str, FieldType] = {
    one.name: one
    for one in (
        FieldType("bool01", "B", True, 0, 1),
        FieldType("u8", "B", True, 0, 2**8 - 1),
        FieldType("u32", "I", True, 0, 2**32 - 1),
        FieldType("i8", "b", True, -(2**7), 2**7 - 1),
        FieldType("i32", "i", True, -(2**31), 2**31 - 1),
        FieldType("f32", "f", False, -_F32_LIMIT, _F32_LIMIT),
        FieldType("f64", "d", False, -_F64_LIMIT, _F64_LIMIT),
    )
}

_DIGITS = re.compile(r"-?[0-9]+")
_DECIMAL = re.compile(r"-?[0-9]+(?:\.[0-9]+)?")
_EXPONENT = re.compile(r"-?[0-9.]+[eE][+-]?[0-9]+")


def may_be_record(body: bytes) -> bool:
    """Nothing is in it but what a whole record is written with."""
    return not body.translate(None, _WRITTEN_WITH)


def problem_of(kind: FieldType, text: str) -> str:
    """Why text is no value of this type; empty: it is one."""
    if not text:
        return "empty field"
    if text != text.strip():
        return "padded field"
    if kind.is_whole and text == "-0":
        return "not a number"
    if re.fullmatch(kind.pattern, text):
        return "" if in_range(kind, convert(kind, text), text) else "out of range"
    if (_DIGITS if kind.is_whole else _DECIMAL).fullmatch(text):
        # Too many digits, or zeros in front.
        digits = text.lstrip("-")
        return "leading zero" if digits.startswith("0") else "out of range"
    if kind.is_whole and _DECIMAL.fullmatch(text):
        return "not a whole number"
    return "exponent" if _EXPONENT.fullmatch(text) else "not a number"


def convert(kind: FieldType, text: str) -> Value:
    """The value of a text that the pattern allows."""
    return int(text) if kind.is_whole else float(text)


def in_range(kind: FieldType, value: Value, text: str) -> bool:
    """The type can hold it."""
    # A number that is too large for Python reads as infinity, which only its name may mean.
    return kind.lowest <= value <= kind.highest or text in _NOT_FINITE
