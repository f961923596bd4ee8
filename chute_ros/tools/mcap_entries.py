"""The messages of an MCAP file in their order, as far as the file can be read.

A file of which the end is missing is read up to its last whole chunk; a chunk that is damaged is
left out. Neither raises: what is wrong is told at the end.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, NamedTuple

from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, Footer, McapRecord, Message, Schema
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from zstandard import ZstdDecompressor, ZstdError

from chute_ros.errors import RecordError
from chute_ros.transport.regular_file import open_regular

#: Longest chunk, bytes: who writes MCAP ends one after four million at the latest.
_LONGEST_CHUNK = 16 * 1024 * 1024
#: And how many times as long as in the file: a few bytes must not become hours of reading.
_MOST_COMPRESSION = 1000
#: What bytes that are no MCAP make its reader raise.
_UNREADABLE = (
    McapError,
    CRCValidationError,
    ZstdError,
    RuntimeError,  # of lz4
    struct.error,
    UnicodeDecodeError,
    ValueError,
    MemoryError,
    OverflowError,
)


class Entry(NamedTuple):
    """One message: its channel, its schema, its wall clock (Unix ns), its number, its CDR."""

    channel: Channel
    schema: Schema
    time: int
    number: int
    data: bytes


class McapEntries:
    """Iterate once; then remarks says what was not in order, one line each."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.remarks: list[str] = []
        #: Bytes that were read so far.
        self.position = 0
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}

    @property
    def topics(self) -> set[str]:
        """Of every channel so far, also without messages."""
        return {one.topic for one in self._channels.values()}

    def __iter__(self) -> Iterator[Entry]:
        """RecordError if there is no such file, or if it is no MCAP from its first byte on."""
        try:
            with open_regular(self.path) as file:
                yield from self._read(file)
        except OSError as error:
            raise RecordError(f"{self.path}: {error.strerror or error}") from None

    def _read(self, file: IO[bytes]) -> Iterator[Entry]:
        size = self.path.stat().st_size
        damaged = 0
        for record in self._records(file, size):
            inner = [record]
            if isinstance(record, Chunk):
                try:
                    inner = breakup_chunk(_unpacked(record), validate_crc=True)
                except _UNREADABLE:
                    if self.position < size:
                        damaged += 1
                    else:
                        self._remark_cut(size)
                    continue
            for one in inner:
                yield from self._entry(one)
        if damaged:
            self.remarks.append(f"{self.path}: damaged parts are left out ({damaged} chunks)")

    def _records(self, file: IO[bytes], size: int) -> Iterator[McapRecord]:
        """The outer records, up to the end or to what cannot be read."""
        records = StreamReader(file, emit_chunks=True, record_size_limit=size).records
        whole = False
        try:
            for record in records:
                self.position = file.tell()
                whole = isinstance(record, Footer)
                yield record
        except _UNREADABLE:
            if not self.position:
                raise RecordError(f"{self.path} is no MCAP file") from None
            if not whole:
                self._remark_cut(size)

    def _entry(self, record: McapRecord) -> Iterator[Entry]:
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._channels[record.id] = record
        elif isinstance(record, Message):
            channel = self._channels.get(record.channel_id)
            schema = self._schemas.get(channel.schema_id) if channel else None
            if channel and schema:
                yield Entry(channel, schema, record.log_time, record.sequence, record.data)

    def _remark_cut(self, size: int) -> None:
        self.remarks.append(
            f"{self.path} ends in the middle ({size} bytes), as after a power cut: read as far as "
            "it goes"
        )


def _unpacked(chunk: Chunk) -> Chunk:
    """The same without compression. ValueError: it is not as long as it says, or too long."""
    size, packed = chunk.uncompressed_size, chunk.data
    if chunk.compression not in ("zstd", "lz4"):
        return chunk
    if size > min(_LONGEST_CHUNK, _MOST_COMPRESSION * len(packed)):
        raise ValueError(f"a chunk of {size} bytes in {len(packed)}")
    # One more than it says: no more is ever unpacked.
    if chunk.compression == "zstd":
        data = ZstdDecompressor().stream_reader(packed).read(size + 1)
    else:
        data = LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
    if len(data) != size:
        raise ValueError(f"a chunk of {len(data)} bytes or more says that it has {size}")
    return replace(chunk, compression="", data=data)
