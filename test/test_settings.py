"""Settings: written once as fields, checked when they are made, told by their names."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace
from typing import Any

import pytest

from chute_ros.errors import ParameterError
from chute_ros.settings import Settings, nested, parameter, parameters_of, settings_from


class Way(enum.Enum):
    AUTO = "auto"
    YES = "true"
    NO = "false"


class Mode(enum.IntEnum):
    SLOW = 0
    FAST = 1


class Mask(enum.IntFlag):
    A = 1
    B = 2


@dataclass(frozen=True)
class Part(Settings):
    low: float = parameter(1.0, "time of the device", 0.5, 60.0, "s")
    high: float = parameter(2.0, "longer time", 0.5, 60.0, "s", name="upper")
    hidden: int = 7

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.low >= self.high:
            raise self.contradiction("need a smaller first", "low", "high")


@dataclass(frozen=True)
class Whole(Settings):
    links: tuple[str, ...] = parameter(("a",), "links")
    way: Way = parameter(Way.AUTO, "way")
    mode: Mode = parameter(Mode.SLOW, "mode")
    mask: Mask = parameter(Mask.A | Mask.B, "mask", 1, 3)
    part: Part = nested(Part(1.5, 3.0), "wire", low={"maximum": 30.0})
    other: Part = nested(Part())
    switch: bool = parameter(False, "switch", changeable=True)
    text: str = parameter("", "text")


@dataclass(frozen=True)
class Outermost(Settings):
    whole: Whole = nested(Whole())


def refusal(kind: type[Settings], values: dict[str, Any]) -> str:
    with pytest.raises(ParameterError) as caught:
        settings_from(kind, values)
    return str(caught.value)


def test_all_parameters_are_found_with_what_their_place_says() -> None:
    told = {one.name: one for one in parameters_of(Whole)}
    assert list(told) == [
        *("links", "way", "mode", "mask", "wire_low", "wire_upper", "low", "upper"),
        *("switch", "text"),
    ]
    assert [one.default for one in told.values()] == [
        *(["a"], "auto", "SLOW", 3, 1.5, 3.0, 1.0, 2.0, False, "")
    ]
    assert (told["way"].choices, told["mode"].choices) == (
        ("auto", "true", "false"),
        ("SLOW", "FAST"),
    )
    assert (told["way"].takes_switch, told["mode"].takes_switch) == (True, False)
    assert (told["wire_low"].maximum, told["low"].maximum) == (30.0, 60.0)
    assert told["wire_low"].meaning == "time of the wire"
    assert [name for name, one in told.items() if one.changeable] == ["switch"]


def test_settings_are_made_from_values_and_defaults() -> None:
    assert settings_from(Whole, {}) == Whole()
    assert settings_from(Whole, {one.name: one.default for one in parameters_of(Whole)}) == Whole()
    values = {"links": ["b", "c"], "way": "true", "mode": "FAST", "mask": 2, "wire_low": 2.5}
    made = settings_from(Whole, {**values, "switch": True, "text": "x", "not ours": 1})
    wanted = Whole(("b", "c"), Way.YES, Mode.FAST, Mask.B, Part(2.5, 3.0), switch=True, text="x")
    assert made == wanted
    assert (type(made.links), type(made.mask)) == (tuple, Mask)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"way": "maybe"}, "parameter way is 'maybe': need one of auto, true, false (way)"),
        ({"mask": 4}, "parameter mask is 4: need a whole number from 1 to 3 (mask)"),
        ({"mask": True}, "parameter mask is True: need a whole number from 1 to 3 (mask)"),
        ({"links": [1]}, "parameter links is [1]: need a list of texts (links)"),
        ({"text": 1}, "parameter text is 1: need text (text)"),
        ({"switch": 1}, "parameter switch is 1: need true or false (switch)"),
        (
            {"wire_low": 31.0},
            "parameter wire_low is 31.0: need a number (1.0, not 1) from 0.5 to 30 s (time of",
        ),
        (
            {"wire_low": 0.1},
            "parameter wire_low is 0.1: need a number (1.0, not 1) from 0.5 to 30 s (time of",
        ),
        (
            {"wire_low": 3.0},
            "parameter wire_low is 3.0 and wire_upper is 3.0: need a smaller first",
        ),
        ({"low": 3.0}, "parameter low is 3.0 and upper is 2.0: need a smaller first"),
    ],
)
def test_a_value_that_is_not_allowed_is_told_by_the_parameters_name(
    values: dict[str, Any], said: str
) -> None:
    assert refusal(Whole, values).startswith(said)
    assert refusal(Outermost, values).startswith(said)


def test_settings_are_checked_however_they_are_made() -> None:
    for wrong in (0.4, 60.1, math.nan, math.inf, -math.inf, "1"):
        with pytest.raises(ParameterError, match=r"^parameter low is "):
            Part(wrong)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match=r"^parameter upper is 61\.0: "):
        replace(Part(), high=61.0)
    with pytest.raises(ParameterError, match=r"^parameter low is 2 and upper is 2: "):
        Part(2, 2)
    # In its own range, and not in that of its place.
    with pytest.raises(ParameterError, match=r"^parameter wire_low is 31\.0: "):
        Whole(part=Part(31.0, 40.0))


def test_a_whole_number_is_a_number_in_python_and_not_in_ros() -> None:
    assert Part(1, 2) == Part()
    assert refusal(Whole, {"low": 1}).startswith("parameter low is 1: need a number (1.0, not 1)")


def test_a_hostile_value_is_told_in_short() -> None:
    assert len(refusal(Whole, {"text": ["x" * 1000] * 1000})) < 300
