"""The parameters of a UPF device: the document's names, their values in text and on the wire."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from chute_ros.errors import ParameterError
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.config import CONTROLLER_NODE_ID, TRIGGER_NODE_ID
from chute_ros.links.upf.simulator.controller import CONTROLLER_PARAMETERS
from chute_ros.links.upf.simulator.trigger import TRIGGER_PARAMETERS

DOCUMENTED = {
    "Static Node ID": int,
    "Enable Auto-Save": bool,
    "Enable CANBUS resister": bool,
    "Enable Parachute": bool,
    "Enable APS": bool,
    "Enable Auto-Takeoff": bool,
    "Enable Auto-Arm": bool,
    "Enable Auto-Disarm": bool,
    "Enable Auto-Land": bool,
    "Enable Light": bool,
    "Node Status Interval(ms)": int,
    "Parachute Status Interval(ms)": int,
}


def test_the_twelve_names_are_those_of_the_document_in_its_order():
    assert {one.name: one.kind for one in p.PARAMETERS} == DOCUMENTED
    assert [one.name for one in p.PARAMETERS] == list(DOCUMENTED)
    assert len(p.BY_NAME) == 12


def test_only_the_defaults_that_the_document_gives_are_known():
    assert {one.name: one.default for one in p.PARAMETERS if one.default is not None} == {
        "Enable CANBUS resister": False
    }
    assert (CONTROLLER_NODE_ID, TRIGGER_NODE_ID) == (33, 34)
    assert CONTROLLER_PARAMETERS[p.STATIC_NODE_ID] == 33
    assert TRIGGER_PARAMETERS[p.STATIC_NODE_ID] == 34
    assert CONTROLLER_PARAMETERS[p.CANBUS_RESISTER] is False


def test_ranges_are_those_that_the_meanings_allow():
    limits = {one.name: (one.minimum, one.maximum) for one in p.PARAMETERS if one.kind is int}
    assert limits == {
        "Static Node ID": (0, 125),
        "Node Status Interval(ms)": (2, 1000),
        "Parachute Status Interval(ms)": (2, 60000),
    }


def test_each_request_is_excluded_by_its_automatic_counterpart():
    assert p.EXCLUDES == {
        "TYPE_TAKEOFF": "Enable Auto-Takeoff",
        "TYPE_ARM": "Enable Auto-Arm",
        "TYPE_DISARM": "Enable Auto-Disarm",
        "TYPE_LAND": "Enable Auto-Land",
    }
    assert p.PROTECTION == ("Enable Parachute", "Enable APS")


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("33", "integer", 33),
        (" 0x21 ", "integer", 33),
        ("-4", "integer", -4),
        ("2.5", "real", 2.5),
        ("1e-3", "real", 0.001),
        *[(word, "boolean", True) for word in ("true", "True", "on", "yes", "1", " ON ")],
        *[(word, "boolean", False) for word in ("false", "FALSE", "off", "no", "0")],
        (" as it is ", "string", " as it is "),
    ],
)
def test_text_is_read_by_the_kind_of_the_parameter(text, kind, value):
    read = p.parse(text, kind, "any")
    assert (read, type(read)) == (value, type(value))


@pytest.mark.parametrize(
    ("text", "kind", "need"),
    [
        ("many", "integer", "need a number (integer)"),
        ("2.5", "integer", "need a number (integer)"),
        ("", "integer", "need a number (integer)"),
        ("much", "real", "need a number (real)"),
        ("maybe", "boolean", "need true or false"),
        ("", "boolean", "need true or false"),
        ("9" * 30, "integer", "no parameter can hold it"),
        ("nan", "real", "no parameter can hold it"),
        ("-inf", "real", "no parameter can hold it"),
        ("1e300", "real", "no parameter can hold it"),
        ("x" * 129, "string", "need at most 128 bytes"),
    ],
)
def test_text_that_fits_no_value_is_refused_with_what_is_needed(text, kind, need):
    with pytest.raises(ParameterError) as raised:
        p.parse(text, kind, "Enable Light" if kind == "boolean" else "any")
    assert need in str(raised.value)


@pytest.mark.parametrize(("kind", "on", "off"), [("integer", 1, 0), ("real", 1.0, 0.0)])
def test_switch_that_a_device_keeps_as_a_number_is_still_a_switch(kind, on, off):
    assert p.parse("true", kind, p.ENABLE_APS) == on
    assert p.parse("off", kind, p.ENABLE_APS) == off
    with pytest.raises(ParameterError, match="need true or false"):
        p.parse("0x0", kind, p.ENABLE_APS)


def test_whatever_does_not_surely_switch_on_may_switch_off():
    assert p.switches_on(" True ")
    assert not any(p.switches_on(text) for text in ("false", "0", "0x0", "", "+0", "-1", "nay"))


VALUES = (
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(width=32, allow_nan=False)
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=40)
)


@given(VALUES)
def test_value_goes_to_the_wire_and_back(value):
    union = p.union_of(value)
    back = p.value_of(union)
    assert (back, type(back)) == (value, type(value))
    assert (
        p.kind_of(union)
        == {bool: "boolean", int: "integer", float: "real", str: "string"}[type(value)]
    )


@given(st.text(), st.sampled_from(["integer", "real", "boolean", "string"]))
def test_any_text_is_a_value_or_a_parameter_error(text, kind):
    for name in ("any", p.ENABLE_APS, p.STATIC_NODE_ID):
        try:
            value = p.parse(text, kind, name)
        except ParameterError:
            continue
        assert p.kind_of(p.union_of(value)) == kind


def test_empty_union_has_no_value_and_no_kind():
    assert p.value_of({"empty": {}}) is None
    assert p.kind_of({"empty": {}}) == ""
    assert p.kind_of({}) == ""


def test_values_in_words():
    assert [p.words(value) for value in (None, True, False, 3, 2.5, "text")] == [
        "",
        "true",
        "false",
        "3",
        "2.5",
        "text",
    ]


def test_value_as_a_switch():
    assert [p.as_switch(value) for value in (True, 0, 1.0, "on", None)] == [
        True,
        False,
        True,
        None,
        None,
    ]
