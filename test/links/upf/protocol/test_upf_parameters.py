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


def test_names_defaults_and_ranges_are_those_of_the_document():
    # The twelve names are those of the document in its order.
    assert {one.name: one.kind for one in p.PARAMETERS} == DOCUMENTED
    assert [one.name for one in p.PARAMETERS] == list(DOCUMENTED)
    assert len(p.BY_NAME) == 12
    # Only the defaults that the document gives are known.
    assert {one.name: one.default for one in p.PARAMETERS if one.default is not None} == {
        "Enable CANBUS resister": False
    }
    assert (CONTROLLER_NODE_ID, TRIGGER_NODE_ID) == (33, 34)
    assert CONTROLLER_PARAMETERS[p.STATIC_NODE_ID] == 33
    assert TRIGGER_PARAMETERS[p.STATIC_NODE_ID] == 34
    assert CONTROLLER_PARAMETERS[p.CANBUS_RESISTER] is False
    # Ranges are those that the meanings allow.
    limits = {one.name: (one.minimum, one.maximum) for one in p.PARAMETERS if one.kind is int}
    assert limits == {
        "Static Node ID": (0, 125),
        "Node Status Interval(ms)": (2, 1000),
        "Parachute Status Interval(ms)": (2, 60000),
    }
    # Each request is excluded by its automatic counterpart.
    assert p.EXCLUDES == {
        "TYPE_TAKEOFF": "Enable Auto-Takeoff",
        "TYPE_ARM": "Enable Auto-Arm",
        "TYPE_DISARM": "Enable Auto-Disarm",
        "TYPE_LAND": "Enable Auto-Land",
    }
    assert p.PROTECTION == ("Enable Parachute", "Enable APS")


def test_text_is_read_by_the_kind_of_the_parameter():
    for kind, values in {
        "integer": {"33": 33, " 0x21 ": 33, "-4": -4},
        "real": {"2.5": 2.5, "1e-3": 0.001},
        "boolean": {
            **dict.fromkeys(("true", "True", "on", "yes", "1", " ON "), True),
            **dict.fromkeys(("false", "FALSE", "off", "no", "0"), False),
        },
        "string": {" as it is ": " as it is "},
    }.items():
        for text, value in values.items():
            read = p.parse(text, kind, "any")
            assert (read, type(read)) == (value, type(value)), (kind, text)


def test_text_that_fits_no_value_is_refused_with_what_is_needed():
    for kind, need, texts in (
        ("integer", "need a number (integer)", ("many", "2.5", "")),
        ("real", "need a number (real)", ("much",)),
        ("boolean", "need true or false", ("maybe", "")),
        ("integer", "no parameter can hold it", ("9" * 30,)),
        ("real", "no parameter can hold it", ("nan", "-inf", "1e300")),
        ("string", "need at most 128 bytes", ("x" * 129,)),
    ):
        for text in texts:
            with pytest.raises(ParameterError) as raised:
                p.parse(text, kind, "Enable Light" if kind == "boolean" else "any")
            assert need in str(raised.value), (kind, text)


def test_switch_that_a_device_keeps_as_a_number_is_still_a_switch():
    for kind, on, off in (("integer", 1, 0), ("real", 1.0, 0.0)):
        assert p.parse("true", kind, p.ENABLE_APS) == on
        assert p.parse("off", kind, p.ENABLE_APS) == off
        with pytest.raises(ParameterError, match="need true or false"):
            p.parse("0x0", kind, p.ENABLE_APS)
    # Whatever does not surely switch on may switch off.
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


def test_values_of_a_union_in_words_and_as_a_switch():
    # Empty union has no value and no kind.
    assert p.value_of({"empty": {}}) is None
    assert p.kind_of({"empty": {}}) == ""
    assert p.kind_of({}) == ""
    words = {None: "", True: "true", False: "false", 3: "3", 2.5: "2.5", "text": "text"}
    assert {value: p.words(value) for value in words} == words
    switches = [p.as_switch(value) for value in (True, 0, 1.0, "on", None)]
    assert switches == [True, False, True, None, None]
