"""One field's text to its value: what Rust prints is taken, all else has its reason."""

import math

import pytest
from umbilical_lines import BY_NAME, as_rust_prints, body

from chute_ros.links.umbilical.protocol.fields import TYPES, convert, problem_of
from chute_ros.links.umbilical.protocol.layouts import Problem

#: 340282350000000000000000000000000000000 is how Rust prints the largest f32.
F32_MAX = "34028235" + "0" * 31
F64_MAX = "17976931348623157" + "0" * 292
#: Type: what it takes, written as the flight computer writes it.
TAKEN = {
    "bool01": {"0": 0, "1": 1},
    "u8": {"0": 0, "7": 7, "255": 255},
    "u32": {"0": 0, "10": 10, "4294967295": 4294967295},
    "i8": {"-128": -128, "-1": -1, "0": 0, "127": 127},
    "i32": {"-2147483648": -2147483648, "0": 0, "2147483647": 2147483647},
    "f32": {F32_MAX: 3.4028235e38, f"-{F32_MAX}": -3.4028235e38},
    "f64": {F64_MAX: 1.7976931348623157e308, f"-{F64_MAX}": -1.7976931348623157e308},
}
#: Type: what is a number, but just too large for it, or too small.
TOO_FAR = {
    "bool01": ["2", "-1"],
    "u8": ["256", "-1", "1000"],
    "u32": ["4294967296", "-1", "99999999999", "9" * 5000],
    "i8": ["128", "-129"],
    "i32": ["2147483648", "-2147483649", "-" + "9" * 5000],
    "f32": ["34028236" + "0" * 31, "-34028236" + "0" * 31, "1" + "0" * 39, "9" * 5000],
    "f64": ["17976931348623159" + "0" * 292, "1" + "0" * 309, "-" + "9" * 5000],
}
WHOLE = ["bool01", "u8", "u32", "i8", "i32"]
FLOATS = ["f32", "f64"]


FIELDS = [(layout, field) for layout in BY_NAME.values() for field in layout.fields]


def reason(kind, text):
    return problem_of(TYPES[kind], text)


def test_the_types_are_those_of_the_reference_and_a_flag():
    assert sorted(TYPES) == sorted(TAKEN)


PRINTED = {
    "inf": math.inf,
    "-inf": -math.inf,
    "25": 25.0,
    "0": 0.0,
    "-76.4878": -76.4878,
    "0." + "0" * 44 + "1": 1e-45,
    "-0." + "0" * 37 + "11754944": -1.1754944e-38,
    "0." + "0" * 400 + "1": 0.0,
    "16777216": 16777216.0,
    "0.1": 0.1,
    "1.0": 1.0,
}


def test_a_type_takes_its_lowest_and_its_highest_and_nothing_beyond():
    for kind, taken in TAKEN.items():
        for text, value in taken.items():
            assert (reason(kind, text), convert(TYPES[kind], text)) == ("", value), kind
        for text in TOO_FAR[kind]:
            assert reason(kind, text) == "out of range", (kind, text)


def test_a_float_is_read_as_it_is_printed():
    for kind in FLOATS:
        for text, value in PRINTED.items():
            assert (reason(kind, text), convert(TYPES[kind], text)) == ("", value)
        assert reason(kind, "NaN") == reason(kind, "-0") == ""
        assert math.isnan(convert(TYPES[kind], "NaN"))
        assert math.copysign(1.0, convert(TYPES[kind], "-0")) == -1.0


#: What neither a whole number nor a float may look like, by its reason.
ODD = {
    "empty field": [""],
    "padded field": [" 25", "25 ", "25\r", " ", "1\n"],
    "leading zero": ["007", "-01", "00"],
    "exponent": ["1e3", "-1.5E-7"],
    "not a number": [
        *("\x0025", "+1", "1_000", "0x1", "\u0661", "\uff11", "\u00b2", "nan", "NAN", "-NaN"),
        *("Infinity", "+inf", "Inf", "--1", "-", "1.2.3", "1.", ".5", "-.5", "1 2", "true"),
        "\ufffd",
    ],
}
#: And what only a float may be.
NOT_WHOLE = {
    "not a whole number": ["0.5", "1.0", "-3.25", "00.5", "9" * 50 + ".5"],
    "not a number": ["NaN", "inf", "-inf", "-0"],
}


def test_what_rust_never_prints_has_its_reason_in_every_type():
    for kind in TYPES:
        for odd in [ODD, NOT_WHOLE] if kind in WHOLE else [ODD]:
            for why, texts in odd.items():
                for text in texts:
                    assert reason(kind, text) == why, (kind, text)


def decoded(layout, field, text):
    return layout.decode(body(layout, **{field.name: text}))


def test_every_field_takes_its_lowest_and_highest_in_its_own_place_and_nothing_beyond():
    for layout, field in FIELDS:
        at = layout.index[field.name]
        for text, value in TAKEN[field.kind.name].items():
            assert decoded(layout, field, text)[at] == value, field.name
        for text in TOO_FAR[field.kind.name]:
            problem = decoded(layout, field, text)
            assert isinstance(problem, Problem), field.name
            assert problem.reason == "out of range"
            assert problem.detail.startswith(f"{field.name} ({field.kind.name}) is ")
            assert len(problem.detail) < 120


def test_every_field_refuses_the_wrong_kind_and_only_a_float_may_be_no_number_or_infinite():
    for layout, field in FIELDS:
        at, whole = layout.index[field.name], field.kind.name in WHOLE
        wrong = {"": "empty field", "x": "not a number", "1e2": "exponent", "01": "leading zero"}
        if whole:
            wrong |= {"0.5": "not a whole number"}
            wrong |= dict.fromkeys(("NaN", "-0", "inf", "-inf"), "not a number")
        for text, why in wrong.items():
            problem = decoded(layout, field, text)
            assert isinstance(problem, Problem), field.name
            assert (problem.reason, field.name in problem.detail) == (why, True)
        if not whole:
            values = [decoded(layout, field, text)[at] for text in ("NaN", "inf", "-inf")]
            assert math.isnan(values[0]), field.name
            assert values[1:] == [math.inf, -math.inf], field.name


@pytest.mark.parametrize(
    ("kind", "value", "text"),
    [
        ("f32", 3.4028234663852886e38, F32_MAX),
        ("f32", 1.401298464324817e-45, "0." + "0" * 44 + "1"),
        ("f32", 0.10000000149011612, "0.1"),
        ("f32", 16777216.0, "16777216"),
        ("f32", 25.0, "25"),
        ("f32", -0.0, "-0"),
        ("f32", 9.999999680285692e37, "1" + "0" * 38),
        ("f64", 0.1, "0.1"),
        ("f64", 1e21, "1" + "0" * 21),
        ("f64", 1.7976931348623157e308, F64_MAX),
        ("f64", -math.inf, "-inf"),
        ("f32", math.nan, "NaN"),
        ("i8", -128, "-128"),
    ],
)
def test_the_printer_of_the_tests_prints_as_rust_does(kind, value, text):
    assert as_rust_prints(value, kind) == text
