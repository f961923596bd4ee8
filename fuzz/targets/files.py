"""Files and settings that a person or another program wrote: only named errors come of them."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path

from chute_ros.errors import ChuteError
from chute_ros.links.umbilical.layout_files import load_layouts
from chute_ros.links.upf.allocation_file import AllocationFile
from chute_ros.protocol.mavlink.signing import key_from_text
from chute_ros.supervisor.profile_reader import read_profile
from chute_ros.supervisor.record import CODEC
from chute_ros.supervisor.resume import load
from chute_ros.tools.mcap_entries import McapEntries
from chute_ros.transport.address import parse_address
from chute_ros.transport.can_address import parse_can_address
from fuzz.plain_json import BOOT, NOW, SETTINGS, anything, left
from fuzz.program import Program
from fuzz.target import Target, WrongError

_LINKS = ("mavlink_parachute", "upf_can")


class Reading:
    """A function of the input's bytes. What it raises besides our own errors is a finding."""

    def __init__(self, read: Callable[[bytes], object]) -> None:
        self._read = read

    def held(self) -> object:
        return None

    def feed(self, data: bytes) -> None:
        try:
            self._read(data)
        except ChuteError as error:
            if not str(error):
                raise WrongError(f"{type(error).__name__} without a word") from None


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _json(data: bytes, make: Callable[[Program], object]) -> str:
    """The input itself, or what its program makes, by its first byte."""
    if data[:1] != b"\1":
        return _text(data)
    return json.dumps(make(Program(data[1:])))


def _record(data: bytes) -> None:
    """What was read can be written, and is the same again."""
    value = CODEC.from_json(_json(data, anything))
    text = CODEC.to_json(value, whole=True)
    if CODEC.to_json(CODEC.from_json(text), whole=True) != text:
        raise WrongError(f"it is another after it was written: {text}")


def _left(data: bytes) -> None:
    load(_json(data, left), BOOT, SETTINGS, 30.0, NOW)


def _profile(data: bytes) -> None:
    read_profile(_text(data), "fuzz", _LINKS)


def _addresses(data: bytes) -> None:
    for parse in (parse_address, parse_can_address):
        try:
            parse(_text(data))
        except ChuteError:
            pass  # it belongs to the other, or to neither


class InFile(Reading):
    """The input is a file's content; its folder goes with the instance."""

    def __init__(self, name: str, read: Callable[[Path], object]) -> None:
        super().__init__(self._write_and_read)
        self._folder = tempfile.TemporaryDirectory(prefix="fuzz_")
        self._path = Path(self._folder.name) / name
        self._read_file = read

    def _write_and_read(self, data: bytes) -> None:
        self._path.write_bytes(data)
        self._read_file(self._path)


def _mcap(path: Path) -> None:
    entries = McapEntries(path)
    for _ in entries:
        pass


TARGETS = (
    Target("files.record", "the core's record in a black box", lambda: Reading(_record), 0, 4096),
    Target(
        "files.left", "what a supervisor left for its next start", lambda: Reading(_left), 0, 8192
    ),
    Target("files.profile", "a profile of rules", lambda: Reading(_profile), 0, 4096),
    Target("files.address", "connection strings", lambda: Reading(_addresses), 0, 8192),
    Target(
        "files.key",
        "a signing key",
        lambda: Reading(lambda data: key_from_text(data, "fuzz")),
        0,
        128,
    ),
    Target(
        "files.layout",
        "a layout of telemetry",
        lambda: InFile("fuzz.yaml", lambda path: load_layouts(str(path.parent), "fuzz")),
        0,
        4096,
    ),
    Target(
        "files.node_ids",
        "the table of node ids",
        lambda: InFile("fuzz.json", lambda path: AllocationFile(str(path), "fuzz").load()),
        0,
    ),
    Target("files.mcap", "an MCAP file", lambda: InFile("fuzz.mcap", _mcap), 0, 4096),
)
