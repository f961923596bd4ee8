"""Signing goes on from where it was before a restart, whatever the wall clock says; what is no key
file is refused at once."""

import os
import time

import pytest

from chute_ros.errors import SigningKeyError
from chute_ros.protocol.mavlink.signing import EPOCH_2015, UNITS_PER_SECOND, Times
from chute_ros.transport.signing_key import signing_from_file


@pytest.fixture
def key(tmp_path):
    path = tmp_path / "key"
    path.write_bytes(bytes(range(32)))
    path.chmod(0o600)
    return str(path)


def units(unix):
    return int((unix - EPOCH_2015) * UNITS_PER_SECOND)


def first_time(key, before):
    signer, _ = signing_from_file(key, 0, "test", before)
    return signer.next_timestamp(time.monotonic())


def test_the_first_start_goes_by_the_wall_clock(key):
    assert first_time(key, None) == pytest.approx(units(time.time()), abs=UNITS_PER_SECOND)


def test_a_restart_with_a_good_clock_adds_nothing(key):
    """Else each of many restarts would push it further ahead of the devices' clocks."""
    before = Times(units(time.time() - 1.0))
    assert first_time(key, before) == pytest.approx(units(time.time()), abs=UNITS_PER_SECOND)


@pytest.mark.parametrize("ahead", [0.5, 3600.0, 1e8])
def test_where_the_clock_was_set_back_it_goes_on_above_all_that_was_given_out(key, ahead):
    newest = units(time.time() + ahead)
    first = first_time(key, Times(newest))
    assert newest + 5 * UNITS_PER_SECOND < first < newest + 15 * UNITS_PER_SECOND


def test_what_was_heard_before_is_known_after(key):
    streams = {(1, 161, 3): units(time.time())}
    _, verifier = signing_from_file(key, 0, "test", Times(0, streams))
    assert verifier.streams == streams
    assert verifier.streams is not streams


def test_a_key_in_digits_may_have_blanks_around_it(key):
    with open(key, "wb") as file:
        file.write(b"\r\n " + bytes(range(32)).hex().encode() + b"  \r\n\n")
    signer, _ = signing_from_file(key, 0, "test")
    assert signer is not None


@pytest.mark.parametrize("name", ["/dev/zero", "/dev/null", "/tmp"])
def test_what_is_no_regular_file_is_refused_without_reading_it(name):
    """/dev/zero would be read for ever."""
    with pytest.raises(SigningKeyError, match=rf"test: {name} is no regular file"):
        signing_from_file(name, 0, "test")


def test_a_pipe_that_nobody_writes_to_is_refused_too(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe, 0o600)
    with pytest.raises(SigningKeyError, match=r"pipe is no regular file"):
        signing_from_file(str(pipe), 0, "test")


def test_no_more_is_read_of_a_file_than_a_key_may_have(key):
    """Given a file of 1 TB, nearly all of it a hole: it would not fit into the memory."""
    os.truncate(key, 10**12)
    with pytest.raises(
        SigningKeyError, match=r"key is no key, it holds more than 128 bytes: need "
    ):
        signing_from_file(key, 0, "test")


def test_a_key_may_be_named_from_the_home_folder(key, monkeypatch):
    monkeypatch.setenv("HOME", os.path.dirname(key))
    signer, _ = signing_from_file("~/key", 0, "test")
    assert signer is not None
