"""Bytes to lines and dumps: cut, glued, endless, in any pieces; dumps with anything in them."""

from collections import Counter

import pytest
from umbilical_lines import BEGIN, BEGIN_CSV, END, END_CSV, LAYOUTS, PAD, joined, line

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
MARKS = {DumpFormat.CSV: (BEGIN_CSV, END_CSV), DumpFormat.BINARY: (BEGIN, END)}

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
DUMP_STORIES = pytest.mark.parametrize("data", DUMPS.values(), ids=DUMPS)
SIZES = pytest.mark.parametrize("size", [1, 64, 0])


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


def whole_dump(data, format_=DumpFormat.BINARY, complete=True):
    """What comes of a dump; behind an end mark the rest of its line is left: nothing."""
    content = [DumpBytes(data)] if data else []
    rest = [Line(b"")] if complete else []
    return [DumpBegan(format_), *content, DumpEnded(complete), *rest]


@pytest.mark.parametrize("size", [1, 7, 64, 0])
def test_lines_come_out_whole_whatever_their_pieces(size):
    ear = Ear()
    heard = ear.hear(PAD + b"\n[INFO] a\r\n\r\n" + PAD, size)
    assert heard == [Line(text) for text in (WHOLE, b"", b"[INFO] a", b"", WHOLE)]
    assert ear.counts == {}


def test_a_line_waits_for_its_end():
    ear = Ear()
    assert ear.reader.feed(b"") == []
    assert ear.reader.end_dump() == []
    assert ear.hear(WHOLE) == []
    assert ear.hear(b"\n") == [Line(WHOLE)]
    assert ear.hear(b"a\rb\r\r\n") == [Line(b"a\rb\r")], "one carriage return belongs to it"


def test_a_cut_line_costs_only_itself():
    good = (Telemetry(WHOLE.decode()[7:]), "")
    for heels in (PAD, b"[INFO] hello\n", b"Wipe progress: 3/56 sectors\n"):
        alone = recognise(heels.removesuffix(b"\n"))[0]
        for cut in CUTS:
            lines = Ear().hear(PAD + WHOLE[:cut] + heels + PAD, 64)
            said = [recognise(one.data) for one in lines]
            assert said == [good, (alone, CUT_LINE), good], (heels, cut)


def test_a_begin_mark_on_the_heels_of_a_cut_line_begins_a_dump():
    for cut in (*CUTS, len(WHOLE) - 3):
        ear = Ear()
        items = ear.hear(WHOLE[:cut] + BEGIN + b"\1\2\3" + END + PAD, 64)
        assert items == [*whole_dump(b"\1\2\3"), Line(WHOLE)], cut
        assert ear.counts == {CUT_LINE: 1}, cut


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


def test_each_line_without_end_is_counted_and_a_good_one_at_its_end_is_read():
    ear = Ear()
    ear.hear((b"x" * 10_000 + b"\n") * 3, 999)
    assert ear.counts == {TOO_LONG: 3}
    (end,) = Ear().hear(b"\0" * 20_000 + PAD, 64)
    assert recognise(end.data) == (Telemetry(WHOLE.decode()[7:]), CUT_LINE)
    for length, counted in ((MOST_LINE, 0), (MOST_LINE + 1, 1)):
        ear = Ear()
        (end,) = ear.hear(b"x" * length + b"\n", 100)
        assert (len(end.data), ear.counts[TOO_LONG]) == (MOST_LINE, counted), length


@DUMP_STORIES
def test_exactly_what_is_put_into_a_dump_comes_out_of_it(data):
    for format_, (begin, end) in MARKS.items():
        for size in (1, 64, 0):
            ear = Ear()
            items = ear.hear(PAD + begin + data + end + PAD, size)
            assert items == [Line(WHOLE), *whole_dump(data, format_), Line(WHOLE)], size
            assert not ear.reader.dumping
            assert ear.counts == {}


@DUMP_STORIES
def test_a_dump_whose_end_mark_was_lost_keeps_all_that_came(data):
    """Telemetry that goes on ends it, or its reader gives it up."""
    for size in (1, 64, 0):
        items = Ear().hear(BEGIN + data + PAD + PAD, size)
        assert items == [*whole_dump(data, complete=False), Line(WHOLE), Line(WHOLE)], size
    ear = Ear()
    items = ear.hear(BEGIN + data, 64) + ear.reader.end_dump()
    assert joined(items) == whole_dump(data, complete=False)
    assert ear.hear(PAD) == [Line(WHOLE)]
    assert ear.reader.end_dump() == []
    ear.hear(BEGIN)
    for _ in range(10):
        ear.hear(data, 64)
        assert len(ear.reader._buffer) <= 4096 + 64, "it never piles up"


def test_a_dump_hands_on_what_came_and_holds_back_only_what_may_be_a_mark_or_telemetry():
    ear = Ear()
    few = bytes(50)
    assert ear.hear(BEGIN + few + b"--- END FLA")[1:] == [DumpBytes(few)]
    assert ear.hear(b"T" + few) == [DumpBytes(b"--- END FLAT" + few[:44])]
    assert ear.hear(b"$TELEM,1,2") == [DumpBytes(few[44:])]
    assert ear.hear(b",3") == []
    assert ear.hear(b"\n" + few) == [DumpBytes(b"$TELEM,1,2,3\n" + few[:44])]


def test_a_log_line_is_no_mark_and_none_of_a_dump():
    for begin in (BEGIN_CSV, BEGIN):
        echo = b"[INFO] " + begin[:-1]
        items = Ear().hear(echo + b"\n" + BEGIN + b"\0" + END)
        assert items == [Line(echo), *whole_dump(b"\0")]
        assert isinstance(recognise(echo)[0], LogLine)
    ear = Ear()
    ear.hear(b"[INFO] " + BEGIN_CSV)
    assert not ear.reader.dumping
    items = Ear().hear(BEGIN + CSV + b"[INFO] " + END + END + PAD, 5)
    assert items == [*whole_dump(CSV), Line(END[:-1]), Line(WHOLE)], "glued to its end"


@SIZES
def test_marks_may_end_as_on_windows_or_have_telemetry_on_their_heels(size):
    crlf = b"\r\n"
    items = Ear().hear(BEGIN[:-1] + crlf + b"ab\r\n" + END[:-1] + crlf + WHOLE + crlf, size)
    assert items == [*whole_dump(b"ab\r\n"), Line(WHOLE)]
    items = Ear().hear(BEGIN + CSV + END[:-1] + PAD, size)
    assert items == [*whole_dump(CSV)[:3], Line(WHOLE)]


def test_an_end_mark_ends_a_dump_of_either_format_but_not_if_it_was_cut():
    items = Ear().hear(BEGIN_CSV + CSV + END + PAD)
    assert items == [*whole_dump(CSV, DumpFormat.CSV), Line(WHOLE)]
    assert items[2] == DumpEnded(True), "telemetry after it does not make it incomplete"
    assert Ear().hear(END) == [Line(END[:-1])], "without a dump it is a line"
    assert Ear().hear((BEGIN + b"\n\n" + END) * 3, 3) == whole_dump(b"\n\n") * 3
    for cut in range(1, len(END) - 1):
        items = Ear().hear(BEGIN + CSV + END[:cut] + PAD, 64)
        assert items == [*whole_dump(CSV + END[:cut], complete=False), Line(WHOLE)], cut


def test_telemetry_on_the_heels_of_a_cut_dump_is_whole():
    telemetry = line(ms_since_boot_cfc="77")
    for before in (b"", b"\0\1--", CSV[:-3], b"$TELEM,1,2", b"[INFO] "):
        items = Ear().hear(BEGIN + before + telemetry, 10)
        assert items == [*whole_dump(before, complete=False), Line(telemetry[:-1])], before


def test_a_dump_after_one_that_was_given_up_is_searched_from_its_first_byte():
    ear = Ear()
    ear.hear(BEGIN + b"-" * 20 + b"$TELEM,1,2")
    ear.reader.end_dump()
    assert ear.hear(BEGIN + PAD) == [*whole_dump(b"", complete=False), Line(WHOLE)]


@SIZES
def test_a_dump_is_searched_for_telemetry_up_to_a_length_however_it_comes(size):
    for length in (4096, 4097):
        data = line(altitude="0." + "0" * (length - len(line(altitude="0."))))
        assert len(data) == length
        ear = Ear()
        items = ear.hear(BEGIN + data, size)
        if length == 4096:
            assert items == [*whole_dump(b"", complete=False), Line(data[:-1])]
        else:
            assert joined([*items, *ear.reader.end_dump()]) == whole_dump(data, complete=False)


def test_telemetry_of_a_layout_that_may_not_come_is_part_of_the_dump():
    decoder = TelemetryDecoder(LAYOUTS, "telem50", Counter())
    reader = StreamReader(decoder.is_telemetry, Counter())
    items = reader.feed(BEGIN + PAD + END)
    assert joined(items) == whole_dump(PAD)
