"""Bytes to lines and dumps: cut, glued, endless, in any pieces; dumps with anything in them."""

from collections import Counter

import pytest
from umbilical_lines import LAYOUTS, PAD, line

from chute_ros.links.umbilical.protocol.decoder import TelemetryDecoder
from chute_ros.links.umbilical.protocol.line_parser import CUT_LINE, LogLine, Telemetry, recognise
from chute_ros.links.umbilical.protocol.stream import (
    MOST_LINE,
    TOO_LONG,
    DumpBegan,
    DumpBytes,
    DumpEnded,
    DumpFormat,
    Line,
    StreamReader,
)

WHOLE = PAD.removesuffix(b"\n")
CUTS = range(64, len(WHOLE), 64)
MARKS = {
    format_: (
        b"--- BEGIN FLASH %s DUMP ---\n" % name,
        b"--- END FLASH %s DUMP ---\n" % name,
    )
    for format_, name in ((DumpFormat.CSV, b"CSV"), (DumpFormat.BINARY, b"BINARY"))
}
BEGIN, END = MARKS[DumpFormat.BINARY]
CSV = b"0,1,101325.5\n1,1,101324.25\n"
#: What a dump may hold besides numbers.
DUMPS = {
    "nothing": b"",
    "CSV": CSV * 100,
    "without a newline at its end": CSV[:-1],
    "every byte": bytes(range(256)) * 20,
    "nothing but newlines": b"\n" * 100,
    "nothing but the first byte of a mark": b"-" * 5000,
    "nothing but the first byte of a log line": b"[" * 5000,
    "half an end mark": END[:-5] + b"\n" + END[:-2] + b"\r\n" + END[1:],
    "half an end mark over and over": END[:-5] * 50,
    "a begin mark": BEGIN * 3,
    "a word of telemetry": b"$TELEM,\n$TELEM,1,2\n$TELEM" * 30,
    "telemetry cut short": WHOLE[:256] + b"\n" + WHOLE[:64] * 9 + b"\n",
    "telemetry with a mistake": WHOLE.replace(b"101325.5", b"1e5") + b"\n",
    "telemetry without an end": b"$TELEM," * 700,
    "a log line": b"[INFO] nothing of note\n[INFO] --- END\n",
}
DUMP_STORIES = [pytest.param(data, id=story) for story, data in DUMPS.items()]


class Ear:
    """A reader, and what it counted."""

    def __init__(self):
        self.counts = Counter()
        decoder = TelemetryDecoder(LAYOUTS, "", Counter())
        self.reader = StreamReader(decoder.is_telemetry, self.counts)

    def hear(self, data, size=0):
        """What comes of these bytes, in pieces of this size; a dump's bytes joined."""
        size = size or len(data) or 1
        items = []
        for start in range(0, len(data), size):
            items += self.reader.feed(data[start : start + size])
        return joined(items)


def joined(items):
    """Neighbouring bytes of a dump as one."""
    found = []
    for item in items:
        if found and isinstance(item, DumpBytes) and isinstance(found[-1], DumpBytes):
            found[-1] = DumpBytes(found[-1].data + item.data)
        else:
            found.append(item)
    return found


def whole_dump(data, format_=DumpFormat.BINARY, complete=True):
    """What comes of a dump; behind an end mark the rest of its line is left: nothing."""
    content = [DumpBytes(data)] if data else []
    rest = [Line(b"")] if complete else []
    return [DumpBegan(format_), *content, DumpEnded(complete), *rest]


# -- lines --------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1, 7, 64, 0])
def test_lines_come_out_whole_whatever_their_pieces(size):
    ear = Ear()
    assert ear.hear(PAD + b"\n[INFO] a\r\n\r\n" + PAD, size) == [
        *(Line(WHOLE), Line(b""), Line(b"[INFO] a"), Line(b""), Line(WHOLE)),
    ]
    assert ear.counts == {}


def test_a_line_waits_for_its_end():
    ear = Ear()
    assert ear.hear(WHOLE) == []
    assert ear.hear(b"\n") == [Line(WHOLE)]


def test_nothing_comes_of_nothing():
    assert Ear().reader.feed(b"") == []
    assert Ear().reader.end_dump() == []


def test_only_one_carriage_return_belongs_to_the_end_of_a_line():
    assert Ear().hear(b"a\rb\r\r\n") == [Line(b"a\rb\r")]


@pytest.mark.parametrize("heels", [PAD, b"[INFO] hello\n", b"Wipe progress: 3/56 sectors\n"])
@pytest.mark.parametrize("cut", CUTS)
def test_a_cut_line_costs_only_itself(cut, heels):
    lines = Ear().hear(PAD + WHOLE[:cut] + heels + PAD, 64)
    said = [recognise(one.data) for one in lines]
    alone = recognise(heels.removesuffix(b"\n"))[0]
    good = (Telemetry(WHOLE.decode()[7:]), "")
    assert said == [good, (alone, CUT_LINE), good]


@pytest.mark.parametrize("cut", [*CUTS, len(WHOLE) - 3])
def test_a_begin_mark_on_the_heels_of_a_cut_line_begins_a_dump(cut):
    ear = Ear()
    items = ear.hear(WHOLE[:cut] + BEGIN + b"\1\2\3" + END + PAD, 64)
    assert items == [*whole_dump(b"\1\2\3"), Line(WHOLE)]
    assert ear.counts == ({CUT_LINE: 1} if cut else {})


# -- no newline ---------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1, 64, 4096, 100_000])
def test_a_line_without_end_is_counted_once_and_does_not_pile_up(size):
    ear = Ear()
    for _ in range(200_000 // size):
        assert ear.reader.feed(b"x" * size) == []
        assert len(ear.reader._buffer) <= MOST_LINE
    assert ear.counts == {TOO_LONG: 1}
    (end,) = ear.hear(b"y\n")
    assert end == Line(b"x" * (MOST_LINE - 1) + b"y")
    assert ear.hear(PAD) == [Line(WHOLE)]
    assert ear.counts == {TOO_LONG: 1}


def test_each_line_without_end_is_counted():
    ear = Ear()
    ear.hear((b"x" * 10_000 + b"\n") * 3, 999)
    assert ear.counts == {TOO_LONG: 3}


def test_a_good_line_at_the_end_of_an_endless_one_is_read():
    (end,) = Ear().hear(b"\0" * 20_000 + PAD, 64)
    assert recognise(end.data) == (Telemetry(WHOLE.decode()[7:]), CUT_LINE)


@pytest.mark.parametrize(("length", "counted"), [(MOST_LINE, 0), (MOST_LINE + 1, 1)])
def test_the_longest_line_that_is_taken_whole(length, counted):
    ear = Ear()
    (end,) = ear.hear(b"x" * length + b"\n", 100)
    assert (len(end.data), ear.counts[TOO_LONG]) == (MOST_LINE, counted)


# -- dumps --------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1, 64, 0])
@pytest.mark.parametrize("format_", DumpFormat)
@pytest.mark.parametrize("data", DUMP_STORIES)
def test_exactly_what_is_put_into_a_dump_comes_out_of_it(data, format_, size):
    begin, end = MARKS[format_]
    ear = Ear()
    items = ear.hear(PAD + begin + data + end + PAD, size)
    assert items == [Line(WHOLE), *whole_dump(data, format_), Line(WHOLE)]
    assert not ear.reader.dumping
    assert ear.counts == {}


@pytest.mark.parametrize("size", [1, 64, 0])
@pytest.mark.parametrize("data", DUMP_STORIES)
def test_telemetry_that_goes_on_ends_a_dump_whose_end_mark_was_lost(data, size):
    items = Ear().hear(BEGIN + data + PAD + PAD, size)
    assert items == [*whole_dump(data, complete=False), Line(WHOLE), Line(WHOLE)]


@pytest.mark.parametrize("data", DUMP_STORIES)
def test_a_dump_that_is_given_up_keeps_all_that_came(data):
    ear = Ear()
    items = ear.hear(BEGIN + data, 64) + ear.reader.end_dump()
    assert joined(items) == whole_dump(data, complete=False)
    assert ear.hear(PAD) == [Line(WHOLE)]
    assert ear.reader.end_dump() == []


def test_a_dump_hands_on_what_came_and_holds_back_only_what_may_be_a_mark_or_telemetry():
    ear = Ear()
    few = bytes(50)
    assert ear.hear(BEGIN + few + b"--- END FLA")[1:] == [DumpBytes(few)]
    assert ear.hear(b"T" + few) == [DumpBytes(b"--- END FLAT" + few[:44])]
    assert ear.hear(b"$TELEM,1,2") == [DumpBytes(few[44:])]
    assert ear.hear(b",3") == []
    assert ear.hear(b"\n" + few) == [DumpBytes(b"$TELEM,1,2,3\n" + few[:44])]


@pytest.mark.parametrize("data", DUMP_STORIES)
def test_a_dump_never_piles_up(data):
    ear = Ear()
    ear.hear(BEGIN)
    for _ in range(10):
        ear.hear(data, 64)
        assert len(ear.reader._buffer) <= 4096 + 64


@pytest.mark.parametrize("name", [b"CSV", b"BINARY"])
def test_the_log_line_that_goes_before_the_begin_mark_is_none(name):
    echo = b"[INFO] --- BEGIN FLASH %s DUMP ---" % name
    items = Ear().hear(echo + b"\n" + BEGIN + b"\0" + END)
    assert items == [Line(echo), *whole_dump(b"\0")]
    assert isinstance(recognise(echo)[0], LogLine)


def test_a_log_line_alone_begins_no_dump():
    ear = Ear()
    ear.hear(b"[INFO] --- BEGIN FLASH CSV DUMP ---\n")
    assert not ear.reader.dumping


def test_a_log_line_glued_to_the_end_of_a_dump_is_not_of_the_dump():
    items = Ear().hear(BEGIN + CSV + b"[INFO] " + END + END + PAD, 5)
    assert items == [*whole_dump(CSV), Line(END[:-1]), Line(WHOLE)]


@pytest.mark.parametrize("size", [1, 64, 0])
def test_marks_may_end_as_on_windows(size):
    crlf = b"\r\n"
    items = Ear().hear(BEGIN[:-1] + crlf + b"ab\r\n" + END[:-1] + crlf + WHOLE + crlf, size)
    assert items == [*whole_dump(b"ab\r\n"), Line(WHOLE)]


def test_the_end_mark_of_the_other_format_ends_it_as_well():
    items = Ear().hear(MARKS[DumpFormat.CSV][0] + CSV + END)
    assert items == whole_dump(CSV, DumpFormat.CSV)


@pytest.mark.parametrize("size", [1, 64, 0])
def test_telemetry_on_the_heels_of_an_end_mark_is_whole(size):
    items = Ear().hear(BEGIN + CSV + END[:-1] + PAD, size)
    assert items == [*whole_dump(CSV)[:3], Line(WHOLE)]


@pytest.mark.parametrize("cut", range(1, len(END) - 1))
def test_an_end_mark_that_was_cut_is_of_the_dump_that_telemetry_ends(cut):
    items = Ear().hear(BEGIN + CSV + END[:cut] + PAD, 64)
    assert items == [*whole_dump(CSV + END[:cut], complete=False), Line(WHOLE)]


def test_one_dump_after_the_other():
    items = Ear().hear((BEGIN + b"\n\n" + END) * 3, 3)
    assert items == whole_dump(b"\n\n") * 3


def test_an_end_mark_without_a_dump_is_a_line():
    assert Ear().hear(END) == [Line(END[:-1])]


@pytest.mark.parametrize("before", [b"", b"\0\1--", CSV[:-3], b"$TELEM,1,2", b"[INFO] "])
def test_telemetry_on_the_heels_of_a_cut_dump_is_whole(before):
    items = Ear().hear(BEGIN + before + line(ms_since_boot_cfc="77"), 10)
    assert items == [
        *whole_dump(before, complete=False),
        Line(line(ms_since_boot_cfc="77")[:-1]),
    ]


def test_a_dump_after_one_that_was_given_up_is_searched_from_its_first_byte():
    ear = Ear()
    ear.hear(BEGIN + b"-" * 20 + b"$TELEM,1,2")
    ear.reader.end_dump()
    assert ear.hear(BEGIN + PAD) == [*whole_dump(b"", complete=False), Line(WHOLE)]


@pytest.mark.parametrize("size", [1, 64, 0])
@pytest.mark.parametrize("length", [4096, 4097])
def test_a_dump_is_searched_for_telemetry_up_to_a_length_however_it_comes(length, size):
    zeros = length - len(line(altitude="0."))
    data = line(altitude="0." + "0" * zeros)
    assert len(data) == length
    ear = Ear()
    items = ear.hear(BEGIN + data, size)
    if length == 4096:
        assert items == [*whole_dump(b"", complete=False), Line(data[:-1])]
    else:
        assert joined([*items, *ear.reader.end_dump()]) == whole_dump(data, complete=False)


def test_telemetry_after_the_end_mark_does_not_make_the_dump_incomplete():
    assert Ear().hear(BEGIN + CSV + END + PAD)[2] == DumpEnded(True)


def test_telemetry_of_a_layout_that_may_not_come_is_part_of_the_dump():
    decoder = TelemetryDecoder(LAYOUTS, "telem50", Counter())
    reader = StreamReader(decoder.is_telemetry, Counter())
    items = reader.feed(BEGIN + PAD + END)
    assert joined(items) == whole_dump(PAD)
