"""judge_log over logs with wrong times: a stamp is damaged, or the clock was set in flight."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache, partial

import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_bench import FAILS_AT, FORMATS, mavros, times_of
from rosbags.rosbag2 import StoragePlugin

from chute_ros.tools.judge_log import formats
from chute_ros.tools.judge_log.flight_log import FlightLog
from chute_ros.tools.judge_log.stamps import steady

HOUR, YEAR = 3600.0, 365 * 86_400.0


def times(stamps: Iterable[float], **options) -> tuple[list[float], list[str]]:
    """As they are judged, and what is told of them."""
    remarks: list[str] = []
    found = [at for at, _ in steady([(one, None) for one in stamps], remarks, **options)]
    return found, remarks


TENTHS = [100.0 + k / 10 for k in range(200)]
anything = st.floats(allow_nan=True, allow_infinity=True)


@given(number=st.integers(0, len(TENTHS) - 1), damaged=anything)
def test_one_damaged_stamp_moves_no_other(number, damaged):
    found, _ = times([damaged if k == number else one for k, one in enumerate(TENTHS)])
    found = found if math.isfinite(damaged) or number else [TENTHS[0], *found]
    begin = found[1] - TENTHS[1]
    assert len(found) == len(TENTHS)
    assert found == sorted(found)
    assert [one - begin for one in found] == pytest.approx(TENTHS, abs=1.0)


@given(number=st.integers(1, len(TENTHS) - 1), by=st.floats(-1e12, 0.5) | st.floats(10.5, 1e12))
def test_a_clock_that_was_set_moves_nothing(number, by):
    """Given a clock that nobody sets beside it; what comes up to 10 s later may have been under
    way."""
    stamps = [one + by * (k >= number) for k, one in enumerate(TENTHS)]
    found, _ = times(stamps, boot_time=TENTHS)
    assert found == sorted(found)
    begin = found[-1] - TENTHS[-1]
    assert [one - begin for one in found] == pytest.approx(TENTHS, abs=1.0)


@pytest.mark.parametrize("by", [-2 * YEAR, -HOUR, -3.0, HOUR, YEAR])
def test_a_clock_that_was_set_is_told(by):
    """Given nothing but the stamps: what goes back, or further ahead than any silence."""
    found, remarks = times([one + by * (k >= 60) for k, one in enumerate(TENTHS)])
    assert found == pytest.approx(TENTHS, abs=0.2)
    (remark,) = remarks
    assert remark.startswith(f"its times jump by {by + 0.1:.4g} s, 6 s after its begin")


def test_a_damaged_stamp_is_told():
    found, remarks = times([3e8 if k == 60 else one for k, one in enumerate(TENTHS)])
    assert found[60] == TENTHS[59]
    assert remarks == ["damaged times (1): each counts as the time before it"]


def test_what_a_radio_kept_is_no_clock_that_was_set():
    """Given a radio that keeps what it gets for 3 s, and sends all of it at once."""
    stamps = [103.0 if 100.0 < one < 103.0 else one for one in TENTHS]
    assert times(stamps, boot_time=TENTHS) == (stamps, [])


def test_a_silence_is_no_damage():
    """Given an altimeter that writes every 5 s, and rests for a minute."""
    stamps = [*range(0, 60, 5), *range(120, 160, 5)]
    assert times(map(float, stamps)) == (stamps, [])


def test_a_topic_that_rests_until_its_last_message_keeps_its_time():
    """Given PX4's home, which comes as it changes."""
    stamps = [0.0, 1.0, 2.0, 3.0, 90.0]
    assert times(stamps, longest_silence=math.inf) == (stamps, [])


# -- whole logs --------------------------------------------------------------------------------


#: A folder with parts in MCAP as well.
WRITERS = FORMATS | {"mavros.mcap": partial(mavros, storage=StoragePlugin.MCAP)}


@pytest.fixture(scope="module")
def right(fallen, tmp_path_factory) -> Callable[[str], FlightLog]:
    """right(name of a format): the flight with every time as it was."""
    folder = tmp_path_factory.mktemp("right")
    return cache(lambda name: formats.read(WRITERS[name](fallen, folder / name), {}))


def assert_read_alike(log: FlightLog, other: FlightLog) -> None:
    """Every message, but for one of a kind, at its time: what is judged is the same flight."""
    found, expected = times_of(log), times_of(other)
    assert found.keys() == expected.keys()
    for kind, times in expected.items():
        assert abs(len(times) - len(found[kind])) <= 1, kind
        moved = (abs(a - b) for a, b in zip(times, found[kind], strict=False))
        assert max(moved) <= 0.2, kind


@pytest.mark.parametrize("by", [-6.0, 30.0, HOUR, 2 * YEAR])
@pytest.mark.parametrize(
    "name", ["flight.tlog", "flight.bin", "flight.log", "flight.ulg", "box.mcap"]
)
def test_one_damaged_stamp_hides_no_fall(name, by, fallen, right, tmp_path):
    """Given a message of 6 s before the motor fails, whose stamp is wrong."""
    wrong = next(k for k, one in enumerate(fallen) if one.at > FAILS_AT - 6.0)
    told = [replace(one, at=one.at + by) if k == wrong else one for k, one in enumerate(fallen)]
    assert_read_alike(formats.read(FORMATS[name](told, tmp_path / name), {}), right(name))


@pytest.mark.parametrize(
    ("name", "by"),
    [
        ("flight.tlog", -2 * YEAR),
        ("flight.tlog", 40.0),
        ("flight.tlog", 2 * YEAR),
        ("flight.bin", -6.0),
        ("flight.bin", HOUR),
        ("box.mcap", 40.0),
        ("box.mcap", HOUR),
        ("mavros", -3.0),
        ("mavros", -5.0),
        ("mavros.mcap", -5.0),
    ],
)
def test_a_clock_that_is_set_in_flight_hides_no_fall(name, by, fallen, right, tmp_path):
    told = [replace(one, at=one.at + by * (one.at > FAILS_AT - 6.0)) for one in fallen]
    assert_read_alike(formats.read(WRITERS[name](told, tmp_path / name), {}), right(name))
