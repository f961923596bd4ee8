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


# -- recognition --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", COUNTS)
def test_each_layout_is_recognised_by_three_lines(name):
    ear = Ear()
    text = body(BY_NAME[name])
    assert LINES_TO_RECOGNISE == 3
    assert ear.hear(text, text) == []
    assert ear.layout is None
    assert ear.hear(text, text) == [name] * 2
    assert ear.counts == {NOT_YET: 2}
    notice = f"telemetry has layout {name} ({COUNTS[name]} fields)"
    assert ear.told() == [notice]
    assert ear.told() == []


@pytest.mark.parametrize("name", COUNTS)
def test_the_values_of_the_third_line_are_its_own(name):
    layout = BY_NAME[name]
    ear = Ear(*[body(layout, ms_since_boot_cfc=str(n)) for n in (1, 2)])
    record = ear.decoder.decode(body(layout, ms_since_boot_cfc="3"), 9.0)
    assert (record["ms_since_boot_cfc"], record.received) == (3, 9.0)


@pytest.mark.parametrize("name", COUNTS)
def test_a_layout_that_was_set_is_the_only_one_and_needs_no_recognition(name):
    ear = Ear(layout=name)
    assert ear.layout == name
    lines = [body(BY_NAME[one]) for one in COUNTS]
    fitting = [
        one for one in COUNTS if not isinstance(BY_NAME[name].decode(body(BY_NAME[one])), Problem)
    ]
    assert ear.hear(*lines * 5) == [name] * len(fitting) * 5
    assert sum(ear.counts.values()) == 25 - len(fitting) * 5
    assert ear.layout == name


def test_a_layout_that_nobody_knows_cannot_be_set():
    with pytest.raises(ParameterError, match=f"'telem60' is not known: need one of {STATE}"):
        TelemetryDecoder(LAYOUTS, "telem60", Counter())


@pytest.mark.parametrize("text", ["0", "1"])
def test_field_32_that_either_could_have_is_the_references(text):
    ear = Ear(*[body(airbrake_state=text)] * 3)
    assert ear.layout == STATE


@pytest.mark.parametrize(
    ("text", "name"),
    [("2", STATE), ("0.5", DEPLOYMENT), ("0.0000001", DEPLOYMENT), ("NaN", DEPLOYMENT)],
)
def test_field_32_tells_two_layouts_apart(text, name):
    assert Ear(*[body(airbrake_state=text)] * 3).layout == name


def test_a_fraction_in_field_32_corrects_what_was_believed_before():
    ear = knowing(STATE, airbrake_state="0")
    assert ear.hear(*[FRACTION] * 4) == [DEPLOYMENT] * 2
    assert ear.counts == {f"fits {DEPLOYMENT}, not {STATE}": 2}
    assert ear.told() == [f"telemetry has layout {DEPLOYMENT} (57 fields), no longer {STATE}"]


def test_so_does_a_2():
    ear = knowing(DEPLOYMENT)
    assert ear.hear(*[body(airbrake_state="2")] * 4) == [STATE] * 2


@pytest.mark.parametrize("text", ["0", "1", "0.25", "NaN", "-1", "3", "256"])
def test_once_told_what_either_could_have_is_of_the_one_that_was_told(text):
    ear = knowing(DEPLOYMENT)
    assert ear.hear(*[body(airbrake_state=text)] * 5) == [DEPLOYMENT] * 5
    assert ear.counts == {}


@pytest.mark.parametrize("text", ["0", "1", "2", "3", "255"])
def test_the_reference_keeps_every_state_that_a_byte_can_have(text):
    ear = knowing(STATE)
    assert ear.hear(*[body(airbrake_state=text)] * 5) == [STATE] * 5
    assert ear.counts == {}


# -- by chance ----------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [50, 52, 54])
@pytest.mark.parametrize("in_a_row", [1, 2])
def test_a_cut_line_that_has_the_count_of_another_layout_is_never_a_record(count, in_a_row):
    cut = ",".join(ALIKE.split(",")[:count])
    assert not isinstance(BY_NAME[f"telem{count}"].decode(cut), Problem)
    ear = knowing(STATE)
    story = ([ALIKE] + [cut] * in_a_row) * 20
    assert ear.hear(*story) == [STATE] * 20
    assert ear.counts == {f"fits telem{count}, not {STATE}": 20 * in_a_row}
    assert ear.layout == STATE


@pytest.mark.parametrize("count", [50, 52, 54])
def test_cut_lines_at_the_beginning_delay_the_recognition_and_do_not_mislead_it(count):
    cut = ",".join(ALIKE.split(",")[:count])
    ear = Ear(cut, cut, ALIKE, ALIKE, cut, ALIKE, ALIKE)
    assert ear.layout is None
    assert ear.hear(ALIKE, ALIKE) == [STATE] * 2
    assert ear.counts == {NOT_YET: 7}


def test_cut_lines_of_two_counts_do_not_add_up():
    cuts = [",".join(ALIKE.split(",")[:count]) for count in (50, 52, 50, 54, 52, 50)]
    assert Ear(*cuts).layout is None


def test_a_broken_line_between_breaks_the_row():
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


# -- what is counted ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "empty field"),
        ("1e5", "exponent"),
        ("9" * 39, "out of range"),
        ("9" * 5000, "out of range"),
        (" 25", "padded field"),
        ("25 ", "padded field"),
        ("007", "leading zero"),
        ("nan", "not a number"),
        ("+1", "not a number"),
        ("1_000", "not a number"),
        ("\u0661", "not a number"),
        ("0x1", "not a number"),
        ("Infinity", "not a number"),
    ],
)
@pytest.mark.parametrize("start", [lambda: knowing(STATE), lambda: Ear(layout=STATE), Ear])
def test_a_field_with_a_mistake_is_counted_under_its_reason(start, text, reason):
    ear = start()
    assert ear.hear(body(altitude=text)) == []
    assert ear.counts == {reason: 1}


@pytest.mark.parametrize("count", [1, 2, 49, 51, 56, 58, 500])
@pytest.mark.parametrize("start", [lambda: knowing(STATE), lambda: Ear(layout=STATE), Ear])
def test_a_line_that_fits_none_is_counted_with_its_count_of_fields_and_told_of_once(start, count):
    ear = start()
    assert ear.hear(*[",".join(["1"] * count)] * 3) == []
    assert ear.counts == {f"{count} fields": 3}
    (notice,) = ear.told()
    assert notice.startswith(f"a $TELEM line of {count} fields: ")
    for name, fields in COUNTS.items():
        assert f"{name} ({fields} fields)" in notice


def test_the_notice_says_what_was_expected():
    assert ": telem50 has 50; known are" in Ear("1", layout="telem50").told()[0]
    assert ": none fits; known are" in Ear("1").told()[0]


def test_the_counters_do_not_grow_with_every_new_count_of_fields():
    ear = Ear()
    lines = [",".join(["x"] * count) for count in range(60, 1060)]
    ear.hear(*lines, *lines)
    assert len(ear.counts) == 17
    assert sum(ear.counts.values()) == 2000
    assert ear.counts["other counts of fields"] == 2 * (1000 - 16)
    assert len(ear.told()) == 16


def test_nor_with_every_new_mistake():
    ear = knowing(STATE)
    ear.hear(*[body(altitude=f"x{number}") for number in range(1000)])
    assert ear.counts == {"not a number": 1000}
    assert ear.told() == []


def test_before_the_layout_is_known_a_mistake_is_that_of_the_first_layout_with_this_count():
    assert Ear(body(airbrake_state="x")).counts == {"not a number": 1}
    assert Ear(body(BY_NAME["telem54"], temp="")).counts == {"empty field": 1}


def test_a_line_of_another_layout_with_a_mistake_is_a_count_that_the_present_one_has_not():
    ear = knowing(STATE)
    ear.hear(body(BY_NAME["telem54"], temp=""))
    assert ear.counts == {"54 fields": 1}


# -- is it telemetry, for who reads a dump -------------------------------------------------------


@pytest.mark.parametrize("name", COUNTS)
def test_a_whole_line_of_any_layout_is_telemetry(name):
    text = body(BY_NAME[name]).encode()
    assert Ear().decoder.is_telemetry(text)
    assert knowing(STATE).decoder.is_telemetry(text)
    assert Ear(layout=name).decoder.is_telemetry(text)
    assert not Ear().decoder.is_telemetry(text[:-1] + b"x")
    assert not Ear().decoder.is_telemetry(text + b",1")


@pytest.mark.parametrize(
    "data", [b"", b"1,2,3", b"\xff" * 100, b"," * 56, GOOD.encode() + b"\xff"]
)
def test_what_is_no_telemetry(data):
    assert not Ear().decoder.is_telemetry(data)


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
