"""$TELEM lines in every layout, and numbers as Rust prints them."""

import math
import struct
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_flight_computer import LAYOUTS, Host

from chute_ros.links.umbilical.simulator.settings import ComputerMode
from chute_ros.links.umbilical.simulator.telemetry import rust_text, telem_body, telem_line


def f32_from(bits):
    return struct.unpack("<f", struct.pack("<I", bits))[0]


ODD = {"NaN": math.nan, "inf": math.inf, "-inf": -math.inf, "-0": -0.0}
TEXTS = {
    32: {
        "25": 25.0,
        "0": 0.0,
        "0.1": 0.1,
        "-2.5": -2.5,
        "101325": 101325.0,
        **ODD,
        "0.33333334": 1.0 / 3.0,
        "16777216": 16777216.0,
        "123456790": 123456789.0,
        "-76.4878": -76.4878,
        "0.0000001": 1e-7,
        "8388608": 8388608.5,
        "0." + "0" * 44 + "1": 1e-45,
        "0." + "0" * 37 + "11754944": 1.1754944e-38,
        "340282350000000000000000000000000000000": 3.4028234663852886e38,
        "0." + "0" * 31 + "98607613": 9.8607613e-32,
    },
    64: {
        "25": 25.0,
        "0.1": 0.1,
        "0.3333333333333333": 1.0 / 3.0,
        **ODD,
        "10000000000000000": 1e16,
        "1000000000000000000000": 1e21,
        "0.00000015": 1.5e-7,
        "0." + "0" * 323 + "5": 5e-324,
        "17976931348623157" + "0" * 292: 1.7976931348623157e308,
    },
}


@pytest.mark.parametrize("bits", TEXTS)
def test_a_float_is_printed_as_rust_does(bits):
    for text, value in TEXTS[bits].items():
        assert rust_text(value, bits) == text
    beyond = [rust_text(value, 32) for value in (1e39, -1e300, 1e-50)]
    assert beyond == ["inf", "-inf", "0"]
    assert len(rust_text(1e-45, 32)) == 47, "the longest small number"


@given(st.integers(0, 0x7F7F_FFFF))
def test_every_32_bit_float_reads_back_as_itself_and_no_shorter_text_does(bits):
    value = f32_from(bits)
    text = rust_text(value, 32)
    assert "e" not in text.lower()
    assert struct.pack("<f", float(text)) == struct.pack("<f", value)
    digits = len(Decimal(text).normalize().as_tuple().digits)
    if digits > 1:
        shorter = float(f"{value:.{digits - 2}e}")
        assert shorter > 3.4e38 or struct.pack("<f", shorter) != struct.pack("<f", value)
    assert rust_text(-value, 32) == f"-{text}"


@given(st.floats(allow_nan=False))
def test_every_64_bit_float_reads_back_as_itself(value):
    text = rust_text(value, 64)
    assert "e" not in text.lower()
    assert float(text) == value
    assert "." not in text or not text.endswith("0")


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_line_of_every_layout_decodes_to_what_was_given(name):
    layout = LAYOUTS[name]
    values = {field.name: number for number, field in enumerate(layout.fields)}
    values |= {"mav_open": 1, "sv_open": 0}
    line = telem_line(telem_body(layout, values))
    assert line.startswith("$TELEM,")
    decoded = layout.decode(line.removeprefix("$TELEM,"))
    assert decoded == tuple(values[field.name] for field in layout.fields)


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_device_fills_every_layout_in_every_mode(name):
    for mode in ComputerMode:
        host = Host(name)
        host.act(f"jump={mode.name}")
        host.run(0.3)
        record = host.newest
        assert record["flight_mode"] == mode
        assert host.layout.is_as_expected(record.values), mode
        assert record["blims_pid_p"] == pytest.approx(0.8)


def test_numbers_are_kept_within_what_a_field_can_hold():
    layout = LAYOUTS["telem57_airbrake_state"]
    values = {"h_acc": -5.0, "ssa_main_deployed": 300, "head_mot": 2**40, "altitude": 1e60}
    decoded = dict(zip(layout.index, layout.decode(telem_body(layout, values)), strict=True))
    assert (decoded["h_acc"], decoded["ssa_main_deployed"]) == (0, 255)
    assert (decoded["head_mot"], decoded["altitude"]) == (2**31 - 1, math.inf)
