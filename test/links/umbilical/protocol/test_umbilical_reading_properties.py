"""What holds for any bytes: nothing raises, nothing is mixed up, all is accounted for."""

import itertools
import json
import math
from collections import Counter
from decimal import Context, Decimal

import orjson
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from umbilical_lines import (
    BEGIN,
    BEGIN_CSV,
    BY_NAME,
    DEPLOYMENT,
    END,
    END_CSV,
    LAYOUT,
    LAYOUTS,
    PAD,
    as_f32,
    as_rust_prints,
    body,
    joined,
    line,
)

from chute_ros.links.umbilical.protocol import layouts
from chute_ros.links.umbilical.protocol.decoder import TelemetryDecoder
from chute_ros.links.umbilical.protocol.fields import convert, problem_of
from chute_ros.links.umbilical.protocol.layouts import Problem
from chute_ros.links.umbilical.protocol.line_parser import Telemetry, recognise
from chute_ros.links.umbilical.protocol.stream import (
    MOST_LINE,
    DumpBegan,
    DumpBytes,
    DumpEnded,
    Line,
    StreamReader,
)

WHOLE = PAD.removesuffix(b"\n")
#: What the stream is made of, and what it is easily confused with.
PIECES = st.one_of(
    st.sampled_from([PAD, BEGIN, END, BEGIN_CSV, END_CSV, line(BY_NAME["telem50"])]),
    st.sampled_from([b"\n", b"\r\n", b"\r", b"-", b"[", b"] ", b"$", b"$TELEM,", b"[INFO] "]),
    st.sampled_from([b"Wipe progress: 3/56 sectors\n", b"ERASE FAILED!\n", b"FRAM x\n"]),
    st.sampled_from([WHOLE, BEGIN, END, b"[INFO] " + END_CSV]).flatmap(
        lambda whole: st.integers(0, len(whole)).map(lambda at: whole[:at])
    ),
    st.sampled_from([b"x" * MOST_LINE, b"$TELEM," + b"1," * 2045, b"\0" * 37]),
    st.binary(max_size=40),
)
STREAMS = st.lists(PIECES, max_size=12).map(b"".join)

#: By type: any value that the flight computer can hold.
VALUES = {
    "bool01": st.integers(0, 1),
    "u8": st.integers(0, 2**8 - 1),
    "u32": st.integers(0, 2**32 - 1),
    "i8": st.integers(-(2**7), 2**7 - 1),
    "i32": st.integers(-(2**31), 2**31 - 1),
    "f32": st.floats(width=32),
    "f64": st.floats(),
}


class Ear:
    """All of the reading half; layout: the only one, empty: recognised."""

    def __init__(self, layout=""):
        self.counts = Counter()
        self.decoder = TelemetryDecoder(LAYOUTS, layout, self.counts)
        self.reader = StreamReader(self.decoder.is_telemetry, self.counts)
        self.items = []

    def feed(self, data):
        """The records that come of these bytes."""
        items = self.reader.feed(data)
        self.items += items
        records = []
        for item in items:
            said = recognise(item.data)[0] if isinstance(item, Line) else None
            if isinstance(said, Telemetry):
                records.append(self.decoder.decode(said.body, 1.0))
        return [one for one in records if one is not None]

    def what_came(self):
        """Lines and dumps; neighbouring bytes of a dump as one."""
        return joined([*self.items, *self.reader.end_dump()])


def heard(*pieces):
    """An ear that heard these."""
    ear = Ear()
    for piece in pieces:
        ear.feed(piece)
    return ear


def by_problem_of(layout, text):
    """What decode must say of a body, decided field by field alone."""
    texts = text.split(",")
    if len(texts) != layout.count:
        return "field count"
    kinds = [field.kind for field in layout.fields]
    reasons = [problem_of(kind, one) for kind, one in zip(kinds, texts, strict=True)]
    if any(reasons):
        return next(one for one in reasons if one)
    return repr([convert(kind, one) for kind, one in zip(kinds, texts, strict=True)])


def by_decode(layout, text):
    results = set()
    for reader in (orjson.loads, json.loads):  # the second is PyPy's
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(layouts, "loads", reader)
            result = layout.decode(text)
        results.add(result.reason if isinstance(result, Problem) else repr(list(result)))
    (only,) = results
    return only


@given(STREAMS, st.data())
def test_any_split_of_any_stream_gives_the_same_as_the_whole(stream, data):
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    whole = heard(stream)
    came = whole.what_came()
    for places in ([0, *cuts, len(stream)], range(len(stream) + 1)):
        split = heard(*[stream[start:end] for start, end in itertools.pairwise(places)])
        assert split.what_came() == came
        assert split.counts == whole.counts


@given(st.lists(st.binary(max_size=300) | STREAMS, max_size=6))
def test_no_bytes_ever_raise_or_pile_up(chunks):
    ear = Ear()
    for chunk in chunks:
        ear.feed(chunk)
        assert len(ear.reader._buffer) <= MOST_LINE
    ear.what_came()


@given(STREAMS)
def test_what_comes_out_stands_in_the_stream_in_this_order_and_dumps_begin_and_end_in_turn(stream):
    at, inside = 0, False
    for item in heard(stream).what_came():
        if isinstance(item, (DumpBegan, DumpEnded)):
            assert inside == isinstance(item, DumpEnded)
            inside = not inside
        else:
            assert isinstance(item, DumpBytes if inside else Line)
            at = stream.index(item.data, at) + len(item.data)
    assert not inside


@given(STREAMS)
def test_exactly_the_bytes_of_a_dump_come_out_of_it(content):
    # An end mark inside is the end; what its log line begins with would belong to it.
    assume(b"--- END FLASH" not in content)
    assume(not content.endswith(b"[INFO] "))
    # So is telemetry, and a record that was cut in its last number is whole.
    bodies = [one.rpartition(b"$TELEM,")[2] for one in content.split(b"\n")[:-1]]
    assume(not any(Ear().decoder.is_telemetry(one.removesuffix(b"\r")) for one in bodies))
    ear = Ear()
    ear.feed(BEGIN + content + END)
    dump = [DumpBytes(content)] if content else []
    begin, *rest = ear.what_came()
    assert isinstance(begin, DumpBegan)
    assert rest == [*dump, DumpEnded(True), Line(b"")]


GARBAGE = st.one_of(
    st.binary(max_size=60),
    st.text(max_size=30).map(str.encode),
    st.sampled_from([WHOLE, b"[INFO] x", b"SNAP seq=1", b"--- END FLASH CSV DUMP ---", b"\r"]),
).filter(lambda data: b"\n" not in data and b"$TELEM," not in data and b"BEGIN FLASH" not in data)


@given(st.lists(st.none() | GARBAGE, max_size=20), st.integers(1, 500))
def test_good_lines_between_garbage_all_come_out_in_order(lines, size):
    """None stands for a good line."""
    ear = Ear(LAYOUT.name)
    good, stream = [], b""
    for number, garbage in enumerate(lines):
        good += [number] if garbage is None else []
        stream += line(ms_since_boot_cfc=str(number)) if garbage is None else garbage + b"\n"
    records = []
    for start in range(0, len(stream), size):
        records += ear.feed(stream[start : start + size])
    assert [record["ms_since_boot_cfc"] for record in records] == good
    assert all(record["altitude"] == 12.5 for record in records)


@given(st.lists(st.none() | GARBAGE, max_size=20))
def test_good_lines_on_the_heels_of_garbage_do_as_well(lines):
    ear = Ear(LAYOUT.name)
    stream = b"".join(
        line(ms_since_boot_cfc=str(number)) if one is None else one
        for number, one in enumerate(lines)
    )
    good = [number for number, one in enumerate(lines) if one is None]
    assert [one["ms_since_boot_cfc"] for one in ear.feed(stream)] == good


@given(st.binary(max_size=200) | STREAMS)
def test_no_line_ever_raises(data):
    said, reason = recognise(data)
    assert said is not None or reason or not data
    text = said.body if isinstance(said, Telemetry) else data.decode("utf-8", "replace")
    for layout in ("", LAYOUT.name):
        Ear(layout).decoder.decode(text, 0.0)


@given(st.text() | st.lists(st.text(max_size=3), min_size=50, max_size=58).map(",".join))
def test_no_text_ever_raises(text):
    ear = Ear()
    lines = [text] * 4
    records = [ear.decoder.decode(one, 0.0) for one in lines]
    assert sum(ear.counts.values()) == records.count(None)


@pytest.mark.parametrize("name", BY_NAME)
@given(st.data())
def test_what_a_flight_computer_prints_is_read_as_exactly_what_it_has(name, data):
    layout = BY_NAME[name]
    kinds = [field.kind.name for field in layout.fields]
    values = [data.draw(VALUES[kind]) for kind in kinds]
    texts = [as_rust_prints(value, kind) for value, kind in zip(values, kinds, strict=True)]
    came = layout.decode(",".join(texts))
    assert not isinstance(came, Problem)
    as_held = [
        as_f32(one) if kind == "f32" else one for one, kind in zip(came, kinds, strict=True)
    ]
    assert repr(as_held) == repr(values)
    assert by_decode(layout, ",".join(texts)) == by_problem_of(layout, ",".join(texts))


EXACT = Context(prec=1100)


def halfway(value):
    """The middle of this float and the next one, in all its digits."""
    both = EXACT.add(Decimal(value), Decimal(math.nextafter(value, math.inf)))
    return f"{EXACT.divide(both, 2):f}"


#: Longer than any device prints.
LONG = st.one_of(
    st.from_regex(r"-?(0|[1-9][0-9]{0,306})(\.[0-9]{1,400})?", fullmatch=True),
    st.floats(0, 1e300).map(halfway),
)


@given(LONG, st.sampled_from(["pressure", "vel_n"]))
def test_a_number_of_any_length_is_read_exactly(text, name):
    assert LAYOUT.fields[LAYOUT.index["vel_n"]].kind.name == "f64"
    texts = body(**{name: text})
    assert by_decode(LAYOUT, texts) == by_problem_of(LAYOUT, texts)


def test_a_number_between_two_floats_with_more_digits_than_any_reader_looks_at():
    texts = body(vel_n=halfway(1.0) + "0" * 900)
    assert LAYOUT.decode(texts)[LAYOUT.index["vel_n"]] == 1.0


TEXTS = st.one_of(
    st.sampled_from(
        ["", "-0", "NaN", "inf", "-inf", "007", "1e5", " 1", "1 ", "+1", "1_0", "1.5"]
    ),
    st.sampled_from(["2", "255", "256", "-1", "-128", "-129", "4294967296", "9" * 39, "0.50"]),
    st.sampled_from(["1,2", ",", "\u0661", "0x1", "34028236" + "0" * 31, "9" * 309, "1\n"]),
    st.text("0123456789.-eE+_ NaInf\r", max_size=8),
    st.text(max_size=5),
)


@given(st.sampled_from(LAYOUTS), st.integers(0, 56), TEXTS, st.sampled_from(LAYOUTS))
def test_deciding_all_at_once_and_field_by_field_is_the_same(layout, place, text, other):
    texts = body(layout).split(",")
    texts[place % len(texts)] = text
    assert by_decode(other, ",".join(texts)) == by_problem_of(other, ",".join(texts))


@given(st.lists(TEXTS, min_size=50, max_size=57), st.sampled_from(LAYOUTS))
def test_so_it_is_of_lines_with_many_mistakes(texts, layout):
    assert by_decode(layout, ",".join(texts)) == by_problem_of(layout, ",".join(texts))


CHANGES = st.one_of(
    st.binary(min_size=1, max_size=1),
    st.sampled_from(list(b"0123456789.,-eNaIinf \r")).map(lambda one: bytes([one])),
    st.just(b""),
)


@given(
    st.sampled_from(LAYOUTS),
    st.lists(st.tuples(st.integers(0, 400), st.booleans(), CHANGES), max_size=12),
)
def test_a_line_spoilt_at_one_place_says_what_it_says_or_is_counted_once(layout, spoils):
    """Each spoilt place: where, whether the byte there goes, and what comes in its place."""
    ear = Ear(layout.name)
    whole = body(layout).encode()
    for at, goes, change in spoils:
        spoilt = whole[: at % len(whole)] + change + whole[at % len(whole) + goes :]
        text = spoilt.decode("utf-8", "replace")
        before = sum(ear.counts.values())
        record = ear.decoder.decode(text, 1.0)
        assert sum(ear.counts.values()) - before == (record is None)
        if record is not None:
            assert [float(one) for one in text.split(",")] == list(record.values)


@given(st.lists(st.tuples(st.sampled_from(LAYOUTS), st.none() | TEXTS), max_size=30))
def test_every_line_that_is_no_record_is_counted_exactly_once(lines):
    """Each line: its layout, and what stands in field 32 if not the ordinary."""
    ear = Ear()
    none = 0
    for layout, text in lines:
        texts = body(layout).split(",")
        texts[31] = texts[31] if text is None else text
        record = ear.decoder.decode(",".join(texts), 1.0)
        none += record is None
        assert record is None or record.layout is ear.decoder.layout
        assert record is None or record.layout.count == len(",".join(texts).split(","))
    assert sum(ear.counts.values()) == none


@given(st.lists(st.sampled_from(LAYOUTS), max_size=30))
def test_a_record_is_of_the_layout_that_sent_it_or_differs_in_field_32_alone(lines):
    ear = Ear()
    for number, layout in enumerate(lines):
        record = ear.decoder.decode(body(layout, ms_since_boot_cfc=str(number)), 1.0)
        assert record is None or record.layout is layout
        assert record is None or record["ms_since_boot_cfc"] == number


@given(st.lists(st.floats(0, 1, width=32), min_size=3, max_size=30))
def test_a_fraction_that_was_recognised_stays_one(fractions):
    layout = BY_NAME[DEPLOYMENT]
    ear = Ear()
    for _ in range(3):
        ear.decoder.decode(body(layout), 1.0)
    for value in fractions:
        text = body(layout, airbrake_deployment=as_rust_prints(value, "f32"))
        record = ear.decoder.decode(text, 1.0)
        assert as_f32(record["airbrake_deployment"]) == value
