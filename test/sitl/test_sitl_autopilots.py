"""A binary is told by its words; what is none is refused with what to give."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from sitl.autopilots import (
    ARDUCOPTER,
    ARDUPLANE,
    PX4,
    AutopilotError,
    recognise,
    version_text,
)


def binary(path: Path, words: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"\x7fELF\0" + words + b"\0more")
    path.chmod(0o755)
    return path


def px4_build(folder: Path) -> Path:
    start = folder / "etc" / "init.d-posix" / "rcS"
    start.parent.mkdir(parents=True)
    start.write_text("")
    return binary(folder / "bin" / "px4", b"PX4 server already running for instance %i")


@pytest.mark.parametrize(
    ("words", "kind", "version"),
    [
        (b"x\0ArduCopter V4.7.0-dev\0y", ARDUCOPTER, "4.7.0-dev"),
        (b"ArduPlane V4.5.7", ARDUPLANE, "4.5.7"),
    ],
)
def test_ardupilot_says_what_it_is_and_which_version(tmp_path, words, kind, version):
    found = recognise(binary(tmp_path / "any name", words))
    assert (found.kind, found.version) == (kind, version)
    assert found.ardupilot


def test_px4_is_known_by_its_server_and_needs_its_start_up_files(tmp_path):
    assert recognise(px4_build(tmp_path / "build")).kind == PX4
    alone = binary(
        tmp_path / "elsewhere" / "bin" / "px4", b"PX4 server already running for instance"
    )
    with pytest.raises(AutopilotError, match="start-up files are not beside it"):
        recognise(alone)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (b"Rover V4.7.0", "is Rover V4.7.0: need one of ArduCopter, ArduPlane, PX4"),
        (b"something else", "no simulator known here"),
    ],
)
def test_another_program_is_refused_by_its_name(tmp_path, words, told):
    with pytest.raises(AutopilotError, match=told):
        recognise(binary(tmp_path / "one", words))


def test_a_file_that_cannot_be_executed_is_refused_with_what_to_give(tmp_path):
    with pytest.raises(AutopilotError, match="make sitl AUTOPILOT="):
        recognise(tmp_path / "nothing")


@pytest.mark.parametrize(
    ("number", "commit", "text"),
    [
        (0x04070000, b"8264a9b4", "4.7.0-dev (8264a9b4)"),
        (0x040507FF, b"0123abcd", "4.5.7 (0123abcd)"),
        (0x01100040, bytes.fromhex("00000000dc37c659"), "1.16.0-alpha (59c637dc)"),
    ],
)
def test_the_running_autopilot_tells_its_version(number, commit, text):
    message = SimpleNamespace(flight_sw_version=number, flight_custom_version=list(commit))
    assert version_text(message) == text
