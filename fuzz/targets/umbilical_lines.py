"""Bytes of the umbilical to lines, dumps and records."""

from __future__ import annotations

import functools
from collections import Counter

from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.umbilical.protocol.decoder import TelemetryDecoder
from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.links.umbilical.protocol.line_parser import Telemetry, recognise
from chute_ros.links.umbilical.protocol.stream import MOST_LINE, DumpBytes, Item, StreamReader
from fuzz.program import Program
from fuzz.target import Target, WrongError

#: What the lines are made of, besides bytes of all kinds.
PIECES = (
    b"$TELEM,",
    b"\n",
    b"\r\n",
    b"--- BEGIN FLASH CSV DUMP ---\n",
    b"--- BEGIN FLASH BINARY DUMP ---\n",
    b"--- END FLASH CSV DUMP ---\n",
    b"[INFO] --- END FLASH BINARY DUMP ---\n",
    b"Flash: 12/4096 KB used (0.3%)\n",
    b"Wiping QSPI Flash... Please wait.\n",
    b"Wipe progress: 3/1024 sectors\n",
    b"Flash wiped successfully.\n",
    b"ERASE TIMEOUT!\n",
    b"Arming blocked: flash is not wiped\n",
    b"Snapshot: none\n",
    b"SNAP seq=3 mode=1\n",
    b"[ERROR] a sensor is gone\n",
)


@functools.cache
def layouts() -> tuple[Layout, ...]:
    """All that are shipped."""
    return tuple(load_layouts("", "fuzz"))


def record_of(p: Program) -> bytes:
    """A line of telemetry of one layout: ordinary, but for a few fields."""
    layout = p.choice(layouts())
    fields = ["0"] * layout.count
    fields[layout.index["flight_mode"]] = str(p.byte() % 8)
    fields[layout.index["ms_since_boot_cfc"]] = str(100 * (p.whole(2) & 0xFFFF))
    for _ in range(p.byte() % 4):
        place = p.byte() % layout.count
        text = p.piece().decode("ascii", "replace") if p.flag() else str(p.byte())
        fields[place] = text
    return f"$TELEM,{','.join(fields)}\n".encode()


def bytes_of(p: Program) -> bytes:
    """What comes next over the wire: a record, a known line, or any bytes."""
    what = p.byte() % 3
    if what == 0:
        return record_of(p)
    return p.choice(PIECES) if what == 1 else p.piece()


class Stream:
    """A stream says the same however it is cut into pieces, and each byte of it is in an item.

    The first byte says in which pieces it comes.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        decoder = TelemetryDecoder(list(layouts()), "", self.counts)
        self._is_telemetry = decoder.is_telemetry
        self._reader = StreamReader(decoder.is_telemetry, self.counts)

    def held(self) -> object:
        return self._reader

    def feed(self, data: bytes) -> None:
        piece, program = 1 + (data[0] if data else 0), Program(data[1:])
        stream = b""
        while not program.over:
            stream += bytes_of(program)
        self._check_pieces(stream, piece)
        # And once more, as part of a long life.
        self._cut(self._reader, stream, piece)

    def _check_pieces(self, stream: bytes, piece: int) -> None:
        counts: Counter[str] = Counter()
        whole = self._cut(StreamReader(self._is_telemetry, counts), stream, len(stream) + 1)
        cut = self._cut(StreamReader(self._is_telemetry, counts), stream, piece)
        if max((len(line) for line in stream.split(b"\n")), default=0) > MOST_LINE:
            return  # where it is cut off depends on the pieces
        if whole != cut:
            raise WrongError(f"in pieces of {piece} it says {cut}, as a whole {whole}")

    @staticmethod
    def _cut(reader: StreamReader, stream: bytes, piece: int) -> list[Item]:
        """The items of a stream that comes in such pieces; neighbours of a dump are one."""
        items: list[Item] = []
        pieces = [stream[at : at + piece] for at in range(0, len(stream), piece)]
        came = [one for data in pieces for one in reader.feed(data)]
        for one in [*came, *reader.end_dump()]:
            if isinstance(one, DumpBytes) and items and isinstance(items[-1], DumpBytes):
                items[-1] = DumpBytes(items[-1].data + one.data)
            else:
                items.append(one)
        return items


class Lines:
    """Lines are a record, a saying, or counted once. The input is the lines themselves."""

    def __init__(self, layout: str = "") -> None:
        self._counts: Counter[str] = Counter()
        self._decoder = TelemetryDecoder(list(layouts()), layout, self._counts)

    def held(self) -> object:
        return self._decoder

    def feed(self, data: bytes) -> None:
        program, lines = Program(data), list[bytes]()
        if program.flag():
            lines = data[1:].split(b"\n")
        else:
            while not program.over:
                lines += bytes_of(program).removesuffix(b"\n").split(b"\n")
        for line in lines:
            said, reason = recognise(line)
            if said is None and not reason and line:
                raise WrongError(f"{line!r} is nothing, and has no reason")
            if not isinstance(said, Telemetry):
                continue
            before = sum(self._counts.values())
            record = self._decoder.decode(said.body, 1.0)
            if sum(self._counts.values()) - before != (record is None):
                raise WrongError(f"{line!r}: {record}, and not counted once: {self._counts}")
        self._decoder.take_notices()


TARGETS = (
    Target("umbilical.stream", "bytes to lines and dumps, in any pieces", Stream, longest=2048),
    Target("umbilical.lines", "lines to records and sayings", Lines, longest=2048),
)
