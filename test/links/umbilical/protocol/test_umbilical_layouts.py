"""Lines to values: the layout of the reference field by field, golden lines, and the files."""

import math

import pytest
import yaml
from umbilical_lines import (
    BY_NAME,
    COUNTS,
    DEPLOYMENT,
    FOLDER,
    LAYOUT,
    LAYOUTS,
    PAD,
    PAD_VALUES,
    REFERENCE_FIELDS,
    STATE,
    body,
)

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.protocol.layouts import Problem, Record, layout_from

#: In flight, main out, no fix, and every odd number that the flight computer can print.
ODD = (
    "5,-0,NaN,inf,-inf,0,4294967295,86399.99,25,-0.5,"
    "0.000000000000000000000000000000000000000000001,"
    "340282350000000000000000000000000000000,-340282350000000000000000000000000000000,"
    "16777216,0.1,-0.1,100,0,4095,-1.5,1,1,255,1,0,1,2,3,4,5,6,2,NaN,0,4294967295,"
    "0.1,-123456.78901234567,NaN,inf,0,4294967295,0,-2147483648,-0,-128,NaN,-inf,359.99,127,"
    "0,-180,1000000,0.001,90,-180,NaN,4294967295"
)
ODD_VALUES = [
    *(5, -0.0, math.nan, math.inf, -math.inf, 0.0, 4294967295, 86399.99, 25.0, -0.5),
    *(1e-45, 3.4028235e38, -3.4028235e38, 16777216.0, 0.1, -0.1, 100.0, 0.0, 4095.0, -1.5),
    *(1, 1, 255, 1, 0, 1, 2, 3, 4, 5, 6, 2, math.nan, 0, 4294967295),
    *(0.1, -123456.78901234567, math.nan, math.inf, 0, 4294967295, 0, -2147483648, -0.0, -128),
    *(math.nan, -math.inf, 359.99, 127, 0.0, -180.0, 1000000.0, 0.001, 90.0, -180.0),
    *(math.nan, 4294967295),
]


def text_of(line):
    return line.decode().removeprefix("$TELEM,").removesuffix("\n")


def test_each_field_is_the_references_and_takes_the_value_at_its_place_and_no_other():
    assert (len(REFERENCE_FIELDS), LAYOUT.count) == (57, 57)
    assert LAYOUTS[0].name == STATE
    for place, (field, (name, kind)) in enumerate(
        zip(LAYOUT.fields, REFERENCE_FIELDS, strict=True)
    ):
        assert (field.name, field.kind.name) == (name, kind)
        texts = ["0"] * 57
        texts[place] = "1"
        values = LAYOUT.decode(",".join(texts))
        assert values == tuple(float(text) for text in texts), name
        assert Record(LAYOUT, values, 0.0)[name] == 1


def test_a_line_from_the_pad():
    values = LAYOUT.decode(text_of(PAD))
    assert dict(zip(LAYOUT.index, values, strict=True)) == PAD_VALUES
    assert list(LAYOUT.index) == list(PAD_VALUES)
    kinds = [float if kind in ("f32", "f64") else int for _, kind in REFERENCE_FIELDS]
    assert [type(value) for value in values] == kinds


def test_a_line_with_every_odd_number_that_can_be_printed():
    values = LAYOUT.decode(ODD)
    assert [repr(one) for one in values] == [repr(one) for one in ODD_VALUES]


def test_a_line_with_a_field_missing_empty_or_too_many():
    whole = text_of(PAD).split(",")
    for place, (name, kind) in enumerate(REFERENCE_FIELDS):
        before, after = whole[:place], whole[place + 1 :]
        problem = LAYOUT.decode(",".join(before + after))
        assert problem == Problem("field count", f"56 fields where {STATE} has 57"), name
        problem = LAYOUT.decode(",".join([*before, "", *after]))
        assert problem == Problem("empty field", f"{name} ({kind}) is ''")
        assert LAYOUT.decode(",".join([*before, "0", *whole[place:]])).reason == "field count"
    assert LAYOUT.decode(",".join([*whole, "0"])).reason == "field count"
    for text in ("", ",", "," * 56, "," * 100_000, "x" * 100_000):
        assert isinstance(LAYOUT.decode(text), Problem), text[:60]


def test_a_field_is_shown_up_to_47_characters():
    problem = LAYOUT.decode(body(altitude="9" * 5000))
    assert problem == Problem("out of range", f"altitude (f32) is '{'9' * 47}...'")
    text = "0." + "0" * 43 + "1x"
    assert LAYOUT.decode(body(altitude=text)).detail == f"altitude (f32) is {text!r}"


def test_the_layouts_that_are_shipped():
    assert {name: layout.count for name, layout in BY_NAME.items()} == COUNTS
    one_point = ["blims_target_lat", "blims_target_lon"]
    two = [f"blims_{point}_{part}" for point in ("upwind", "downwind") for part in ("lat", "lon")]
    targets = {"telem50": [], "telem54": two}
    for name, layout in BY_NAME.items():
        values = layout.decode(body(layout, altitude="1234.5", ms_since_boot_cfc="99"))
        assert (values[3], values[-1], len(values)) == (1234.5, 99, COUNTS[name]), name
        record = Record(layout, layout.decode(body(layout)), 1.5)
        assert [one for one in layout.index if one not in record] == []
        assert "blims_upwind_lat" in record or name != "telem54"
        assert "no such field" not in record
        assert math.isnan(record.number("no such field"))
        assert record.number("mag_x") == 12.5
        assert list(layout.target_fields) == targets.get(name, one_point), name
        assert layout.target_floats == (4 if name == "telem54" else 2), name


def test_the_second_layout_of_57_fields_differs_in_field_32_alone():
    pairs = zip(LAYOUT.fields, BY_NAME[DEPLOYMENT].fields, strict=True)
    differing = [n for n, (one, other) in enumerate(pairs, 1) if one != other]
    assert differing == [32]
    assert BY_NAME[DEPLOYMENT].fields[31].kind.name == "f32"


def test_field_32_is_as_expected_or_not():
    for name, field, fitting, strange in (
        (STATE, "airbrake_state", "0 1 2", "3 255"),
        (DEPLOYMENT, "airbrake_deployment", "0 0.5 1 -0", "1.01 -1 NaN inf"),
    ):
        layout = BY_NAME[name]
        for text in (fitting + " " + strange).split():
            values = layout.decode(body(layout, **{field: text}))
            assert layout.is_as_expected(values) == (text in fitting.split()), text


def content():
    return yaml.safe_load((FOLDER / f"{STATE}.yaml").read_text())


def spoilt(**changes):
    return {**content(), **changes}


def field(which, **changes):
    """The file, with something else about one field."""
    whole = content()
    for one in whole["fields"]:
        if one["name"] == which:
            one.update(changes)
    return whole


MISTAKES = {
    "nothing": (None, "no layout of"),
    "a list": ([], "no layout of"),
    "a word": ("telem", "no layout of"),
    "no name": ({k: v for k, v in content().items() if k != "name"}, "'name'"),
    "no fields": (spoilt(fields=[]), "lacks flight_mode"),
    "fields that are none": (spoilt(fields=["pressure"]), "no layout of"),
    "a field without a type": (spoilt(fields=[{"name": "a", "unit": "b"}]), "'type'"),
    "a type that nobody knows": (field("temp", type="f16"), "f16: need one of bool01"),
    "a type that is a list": (field("temp", type=["f32"]), "no layout of"),
    "a needed field under another name": (field("mav_open", name="mav"), "lacks mav_open"),
    "a field twice": (field("temp", name="pressure"), "named twice"),
    "one target float": (spoilt(target_floats=1), "target_floats is 1: need 2 or 4"),
    "a target float in words": (spoilt(target_floats="two"), "no layout of"),
    "endless target floats": (spoilt(target_floats=math.inf), "no layout of"),
    "target fields that do not exist": (spoilt(target_fields=["a", "b"]), "lacks a, b"),
    "one target field": (spoilt(target_fields=["temp"]), "as many as target_floats"),
    "no target fields at all": (spoilt(target_fields=None), "no layout of"),
    "a clock that may be no number": (
        field("ms_since_boot_cfc", type="f32"),
        "ms_since_boot_cfc must be of a whole number's type",
    ),
    "a mode that may be no number": (field("flight_mode", type="f64"), "flight_mode must be"),
    "limits that are none": (field("airbrake_state", expected=[]), "no layout of"),
    "half the limits": (field("airbrake_state", expected=[0]), "no layout of"),
    "limits in words": (field("airbrake_state", expected=["low", "high"]), "no layout of"),
    "a list of lists as a name": (spoilt(name=[["x"]]), "a word is needed, not a list"),
    "lists as target fields": (spoilt(target_fields=[["x"]]), "a word is needed, not a list"),
}


@pytest.mark.parametrize("story", MISTAKES)
def test_a_mistake_in_a_file_is_told_with_the_name_of_the_file(story):
    wrong, told = MISTAKES[story]
    with pytest.raises(ParameterError, match=r"^/a/layout\.yaml: ") as caught:
        layout_from(wrong, "/a/layout.yaml")
    assert told in str(caught.value)


def test_a_file_without_a_mistake_is_taken_and_the_references_comes_first(tmp_path):
    # A file without a mistake is taken.
    assert layout_from(content(), "here").fields == LAYOUT.fields
    # The references layout comes first and the others by file.
    for name in ("telem54", STATE, "telem50"):
        (tmp_path / f"{name}.yaml").write_text((FOLDER / f"{name}.yaml").read_text())
    names = [layout.name for layout in load_layouts(str(tmp_path), "layouts")]
    assert names == [STATE, "telem50", "telem54"]


def test_a_folder_without_layouts_or_with_two_of_one_name(tmp_path):
    with pytest.raises(ParameterError, match=r"layouts is .* there is no layout"):
        load_layouts(str(tmp_path), "layouts")
    with pytest.raises(ParameterError, match="there is no layout"):
        load_layouts(str(tmp_path / "none"), "layouts")
    for name in ("a", "b"):
        (tmp_path / f"{name}.yaml").write_text((FOLDER / "telem50.yaml").read_text())
    with pytest.raises(ParameterError, match="two layouts have one name"):
        load_layouts(str(tmp_path), "layouts")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        *((text, "") for text in (b"a: [", b"\xff\xfe\xfa", b"", b"- 1")),
        # What only the reader of YAML stumbles over.
        (b"[" * 3000, "cannot be read"),
        (b"a: 2001-12-14t21:59:43.10-99:99", "cannot be read"),
        (b"a: 0b_", "cannot be read"),
    ],
)
def test_a_file_that_cannot_be_read(tmp_path, text, told):
    (tmp_path / "mine.yaml").write_bytes(text)
    with pytest.raises(ParameterError, match=rf"mine\.yaml: {told}"):
        load_layouts(str(tmp_path), "layouts")


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("target_floats: 2", "target_floats: 0x2", "0x2, which YAML reads as 2"),
        ("{name: temp,", "{name: no,", "no, which YAML reads as false"),
        ("type: f32, unit: Pa}", "type: f32, unit: Pa, expected: [0, 010]}", "010, which YAML"),
        ("type: f32, unit: Pa}", "type: f32, unit: Pa, expected: [0, 1e5]}", "1e5, which YAML"),
    ],
)
def test_what_yaml_reads_as_another_value_is_told_with_its_line(tmp_path, old, new, told):
    text = (FOLDER / f"{STATE}.yaml").read_text()
    assert old in text
    (tmp_path / "mine.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(ParameterError, match=r"line [0-9]+") as caught:
        load_layouts(str(tmp_path), "layouts")
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("target_floats: 2", "target_floats: 2.9", "need a whole number"),
        ("heartbeat_in_flight:", "heartbeat_in_fligth:", "there is no heartbeat_in_fligth"),
        ("type: f32, unit: Pa}", "type: f32, unit: Pa, expects: [0, 1]}", "there is no expects"),
        ("type: f32, unit: Pa}", "type: f32, unit: Pa, expected: [2, 0]}", "expected is 2 to 0"),
        ("type: f32, unit: Pa}", "type: f32, unit: Pa, expected: [.nan, 2]}", "expected is nan"),
        ("type: f32, unit: Pa}", "type: f32, unit: Pa, unit: hPa}", "it is there twice"),
        ("target_floats: 2", "target_floats: 2\ntarget_floats: 4", "it is there twice"),
    ],
)
def test_what_would_be_left_out_or_replaced_without_a_word_is_refused(tmp_path, old, new, told):
    text = (FOLDER / f"{STATE}.yaml").read_text()
    assert old in text
    (tmp_path / "mine.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(ParameterError, match=r"mine\.yaml") as caught:
        load_layouts(str(tmp_path), "layouts")
    assert told in str(caught.value)
