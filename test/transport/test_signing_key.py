"""Signing goes on from where it was before a restart, whatever the wall clock says."""

import time

import pytest

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
