"""Which layout it is, which lines are records of it, and under what the others are counted."""

from collections import Counter

import pytest
from umbilical_lines import BY_NAME, COUNTS, DEPLOYMENT, LAYOUT, LAYOUTS, STATE, body

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.protocol.decoder import (
    LINES_TO_RECOGNISE,
    NOT_YET,
    TelemetryDecoder,
)
from chute_ros.links.umbilical.protocol.layouts import Layout, Problem

#: 57 fields that each fit every type, so that any cut of them is well-formed.
ALIKE = ",".join(["1"] * 57)
GOOD = body()
FRACTION = body(BY_NAME[DEPLOYMENT], airbrake_deployment="0.5")


class Ear:
    """A decoder that heard some lines; layout: the only one, empty: recognised."""

    def __init__(self, *lines, layout=""):
        self.counts = Counter()
        self.decoder = TelemetryDecoder(LAYOUTS, layout, self.counts)
        self.now = 0.0
        self.hear(*lines)

    def hear(self, *lines):
        """The records that come of them: the name of each one's layout."""
        records = []
        for text in lines:
            self.now += 1.0
            record = self.decoder.decode(text, self.now)
            if record is not None:
                assert record.received == self.now
                records.append(record)
        return [record.layout.name for record in records]

    def told(self):
        """What a person is told since the last call."""
        return [notice.text for notice in self.decoder.take_notices()]

    @property
    def layout(self):
        return self.decoder.layout and self.decoder.layout.name


def knowing(layout, **texts):
    """An ear that has recognised this layout; nothing is counted."""
    ear = Ear(*[body(BY_NAME[layout], **texts)] * 3)
    assert ear.layout == layout
    ear.counts.clear()
    ear.told()
    return ear


@pytest.mark.parametrize("name", COUNTS)
def test_each_layout_is_recognised_by_three_lines(name):
    ear = Ear()
    text = body(BY_NAME[name])
    assert LINES_TO_RECOGNISE == 3
    assert ear.hear(text, text) == []
    assert ear.layout is None
    record = ear.decoder.decode(body(BY_NAME[name], ms_since_boot_cfc="3"), 9.0)
    assert (record.layout.name, record["ms_since_boot_cfc"], record.received) == (name, 3, 9.0)
    assert ear.hear(text) == [name]
    assert ear.counts == {NOT_YET: 2}
    assert ear.told() == [f"telemetry has layout {name} ({COUNTS[name]} fields)"]
    assert ear.told() == []


@pytest.mark.parametrize("name", COUNTS)
def test_a_layout_that_was_set_is_the_only_one_and_needs_no_recognition(name):
    ear = Ear(layout=name)
    assert ear.layout == name
    lines = [body(BY_NAME[one]) for one in COUNTS]
    fitting = [one for one in lines if not isinstance(BY_NAME[name].decode(one), Problem)]
    assert ear.hear(*lines * 5) == [name] * len(fitting) * 5
    assert sum(ear.counts.values()) == 25 - len(fitting) * 5
    assert ear.layout == name


def test_a_layout_that_nobody_knows_cannot_be_set():
    with pytest.raises(ParameterError, match=f"'telem60' is not known: need one of {STATE}"):
        TelemetryDecoder(LAYOUTS, "telem60", Counter())


def test_field_32_tells_two_layouts_apart_and_what_either_could_have_is_the_references():
    fractions = dict.fromkeys(("0.5", "0.0000001", "NaN"), DEPLOYMENT)
    for text, name in {"0": STATE, "1": STATE, "2": STATE, **fractions}.items():
        assert Ear(*[body(airbrake_state=text)] * 3).layout == name, text


def test_a_fraction_or_a_2_in_field_32_corrects_what_was_believed_before():
    ear = knowing(STATE, airbrake_state="0")
    assert ear.hear(*[FRACTION] * 4) == [DEPLOYMENT] * 2
    assert ear.counts == {f"fits {DEPLOYMENT}, not {STATE}": 2}
    assert ear.told() == [f"telemetry has layout {DEPLOYMENT} (57 fields), no longer {STATE}"]
    # So does a 2.
    ear = knowing(DEPLOYMENT)
    assert ear.hear(*[body(airbrake_state="2")] * 4) == [STATE] * 2


def test_once_told_what_either_could_have_is_of_the_one_that_was_told():
    for name, texts in ((DEPLOYMENT, "0 1 0.25 NaN -1 3 256"), (STATE, "0 1 2 3 255")):
        for text in texts.split():
            ear = knowing(name)
            assert ear.hear(*[body(airbrake_state=text)] * 5) == [name] * 5, text
            assert ear.counts == {}


def cut_to(count):
    return ",".join(ALIKE.split(",")[:count])


@pytest.mark.parametrize("count", [50, 52, 54])
def test_a_cut_line_that_has_the_count_of_another_layout_is_never_a_record(count):
    cut = cut_to(count)
    assert not isinstance(BY_NAME[f"telem{count}"].decode(cut), Problem)
    for in_a_row in (1, 2):
        ear = knowing(STATE)
        story = ([ALIKE] + [cut] * in_a_row) * 20
        assert ear.hear(*story) == [STATE] * 20
        assert ear.counts == {f"fits telem{count}, not {STATE}": 20 * in_a_row}
        assert ear.layout == STATE
    # At the beginning they delay the recognition and do not mislead it.
    ear = Ear(cut, cut, ALIKE, ALIKE, cut, ALIKE, ALIKE)
    assert ear.layout is None
    assert ear.hear(ALIKE, ALIKE) == [STATE] * 2
    assert ear.counts == {NOT_YET: 7}


def test_cut_lines_of_two_counts_and_a_broken_one_between_make_no_row():
    # Cut lines of two counts do not add up.
    assert Ear(*map(cut_to, (50, 52, 50, 54, 52, 50))).layout is None
    # A broken line between breaks the row.
    text = body(BY_NAME["telem50"])
    ear = knowing(STATE)
    assert ear.hear(text, text, "1,2,3", text, text, GOOD, text, text) == [STATE]
    assert ear.layout == STATE
    assert ear.hear(text) == ["telem50"]


@pytest.mark.parametrize("name", [one for one in COUNTS if one != STATE])
def test_another_layout_is_believed_after_three_lines_in_a_row(name):
    ear = knowing(STATE)
    text = body(BY_NAME[name])
    assert ear.hear(text, text, text, text) == [name] * 2
    assert ear.counts == {f"fits {name}, not {STATE}": 2}
    assert ear.hear(GOOD, GOOD, GOOD) == [STATE]
    first, second = ear.told()
    assert first.startswith(f"telemetry has layout {name} ")
    assert second.endswith(f"no longer {name}")


#: The layout is recognised, set, or not known yet.
STARTS = pytest.mark.parametrize(
    "start", [lambda: knowing(STATE), lambda: Ear(layout=STATE), Ear], ids=["known", "set", "none"]
)


@STARTS
def test_a_field_with_a_mistake_is_counted_under_its_reason(start):
    for reason, texts in {
        "empty field": [""],
        "exponent": ["1e5"],
        "out of range": ["9" * 39, "9" * 5000],
        "padded field": [" 25", "25 "],
        "leading zero": ["007"],
        "not a number": ["nan", "+1", "1_000", "\u0661", "0x1", "Infinity"],
    }.items():
        for text in texts:
            ear = start()
            assert ear.hear(body(altitude=text)) == []
            assert ear.counts == {reason: 1}, text


@STARTS
def test_a_line_that_fits_none_is_counted_with_its_count_of_fields_and_told_of_once(start):
    for count in (1, 2, 49, 51, 56, 58, 500):
        ear = start()
        assert ear.hear(*[",".join(["1"] * count)] * 3) == []
        assert ear.counts == {f"{count} fields": 3}
        (notice,) = ear.told()
        assert notice.startswith(f"a $TELEM line of {count} fields: ")
        for name, fields in COUNTS.items():
            assert f"{name} ({fields} fields)" in notice
    assert ": telem50 has 50; known are" in Ear("1", layout="telem50").told()[0]
    assert ": none fits; known are" in Ear("1").told()[0]


def test_the_counters_do_not_grow_with_every_new_count_of_fields_or_mistake():
    ear = Ear()
    lines = [",".join(["x"] * count) for count in range(60, 1060)]
    ear.hear(*lines, *lines)
    assert len(ear.counts) == 17
    assert sum(ear.counts.values()) == 2000
    assert ear.counts["other counts of fields"] == 2 * (1000 - 16)
    assert len(ear.told()) == 16
    ear = knowing(STATE)
    ear.hear(*[body(altitude=f"x{number}") for number in range(1000)])
    assert ear.counts == {"not a number": 1000}
    assert ear.told() == []


def test_a_mistake_is_that_of_the_present_layout_or_of_the_first_with_this_count():
    assert Ear(body(airbrake_state="x")).counts == {"not a number": 1}
    other = body(BY_NAME["telem54"], temp="")
    assert Ear(other).counts == {"empty field": 1}
    ear = knowing(STATE)
    ear.hear(other)
    assert ear.counts == {"54 fields": 1}


def test_a_whole_line_of_any_layout_is_telemetry_and_nothing_else():
    for name in COUNTS:
        text = body(BY_NAME[name]).encode()
        for ear in (Ear(), knowing(STATE), Ear(layout=name)):
            assert ear.decoder.is_telemetry(text), name
        assert not Ear().decoder.is_telemetry(text[:-1] + b"x")
        assert not Ear().decoder.is_telemetry(text + b",1")
    for data in (b"", b"1,2,3", b"\xff" * 100, b"," * 56, GOOD.encode() + b"\xff"):
        assert not Ear().decoder.is_telemetry(data), data


def test_one_layout_alone_is_enough():
    alone = TelemetryDecoder([Layout("mine", LAYOUT.fields, 2, ())], "", Counter())
    assert [alone.decode(GOOD, 1.0) is not None for _ in range(4)] == [False, False, True, True]


def test_a_fraction_that_touches_zero_and_one_is_recognised_all_the_same():
    """Given 0 on the pad, which fits both, when the brakes then move, then few are lost."""
    ear = knowing(STATE, airbrake_state="0")
    moving = [body(BY_NAME[DEPLOYMENT], airbrake_deployment=v) for v in ("0.3", "0.3", "1")]
    heard = ear.hear(*moving * 4)
    assert ear.layout == DEPLOYMENT
    assert heard.count(DEPLOYMENT) == 9, "after the third that fits no other"
    assert ear.counts == {f"fits {DEPLOYMENT}, not {STATE}": 2}
