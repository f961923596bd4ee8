"""Every field and constant group of every ROS interface says what it is."""

import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1]
INTERFACES = sorted([*PACKAGE.glob("msg/*.msg"), *PACKAGE.glob("srv/*.srv")])
CONSTANT = re.compile(r"^[\w/]+(\[.*?\])?\s+[A-Z][A-Z0-9_]*\s*=")


def undocumented_fields(text):
    """Return the fields that have no comment on their own line or on the line before."""
    missing = []
    before = ""
    for line in text.splitlines():
        line = line.strip()
        is_field = line and line != "---" and not line.startswith("#") and not CONSTANT.match(line)
        if is_field and "#" not in line and not before.startswith("#"):
            missing.append(line)
        before = line
    return missing


def test_there_are_interfaces():
    """The tests below say nothing if they look at nothing."""
    assert INTERFACES


@pytest.mark.parametrize("path", INTERFACES, ids=lambda path: path.name)
def test_every_field_has_a_comment(path):
    """A unit, a range, or what it means."""
    assert undocumented_fields(path.read_text()) == []


def parts_of_vehicle_state():
    """Age -> (its default, the numbers of its part); empty: numbers without an age."""
    found, numbers = {}, []
    for line in (PACKAGE / "msg" / "VehicleState.msg").read_text().splitlines():
        kind, name, *default = [*line.split(), "", ""][:3]
        if name.endswith("_age"):
            found[name] = (*default, numbers)
            numbers = []
        elif kind in ("float32", "float64"):
            numbers.append(name)
    found[""] = ("", numbers)
    return found


def test_a_vehicle_state_tells_by_an_age_which_numbers_were_not_filled_in():
    """They are 0.0, as no message of ROS can have NaN as a default."""
    parts = parts_of_vehicle_state()
    assert parts.pop("") == ("", ["uptime"])
    assert len(parts) > 10
    for age, (default, _) in parts.items():
        assert default == "-1.0", age
    numbers = [name for _, part in parts.values() for name in part]
    assert {"height", "pressure", "tilt", "latitude", "battery_voltage"} < set(numbers)


@pytest.mark.parametrize(
    ("text", "missing"),
    [
        ("float64 height", ["float64 height"]),
        ("# m\nfloat64 height", []),
        ("float64 height  # m", []),
        ("# m\n\nfloat64 height", ["float64 height"]),
        ("# m\nfloat64 height\nfloat64 speed", ["float64 speed"]),
        ("# wanted\nbool arm\n---\nbool success", ["bool success"]),
        ("uint8 NONE = 0\nuint8[<=4] LIMIT=1", []),
        ("# any\nuint8 state 3\nstring<=8 name", ["string<=8 name"]),
    ],
)
def test_the_check_bites(text, missing):
    """The check itself finds what it should."""
    assert undocumented_fields(text) == missing
