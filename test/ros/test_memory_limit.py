"""A node that is made to take all memory ends itself, not the computer; the version is named."""

import os
import resource
import subprocess
import sys

import pytest

from chute_ros.errors import ParameterError
from chute_ros.ros import memory_limit, middleware_diagnostics
from chute_ros.ros.memory_limit import VARIABLE, limit_memory
from chute_ros.ros.middleware import CURED, fast_dds, is_cured
from chute_ros.ros.middleware_diagnostics import middleware_task
from chute_ros.ros.own_version import own_version

GREEDY = (
    "from chute_ros.ros.memory_limit import limit_memory\n"
    "limit_memory()\n"
    "kept = []\n"
    "while len(kept) < 700: kept.append(bytearray(b'x' * 2**20))\n"
)


@pytest.fixture
def limits(monkeypatch):
    """What is set, in place of the test's own limits. Unlimited from outside."""
    found = []
    unlimited = resource.RLIM_INFINITY
    monkeypatch.setattr(memory_limit.resource, "getrlimit", lambda _: (unlimited, unlimited))
    monkeypatch.setattr(memory_limit.resource, "setrlimit", lambda *given: found.append(given))
    monkeypatch.delenv(VARIABLE, raising=False)
    return found


def taking_all(**environment):
    return subprocess.run(
        [sys.executable, "-c", GREEDY],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_what_takes_more_than_its_limit_ends():
    done = taking_all()
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "MemoryError"


@pytest.mark.parametrize("limit", ["0", "2000"])
def test_the_limit_is_what_the_environment_says(limit):
    assert taking_all(**{VARIABLE: limit}).returncode == 0


def test_without_a_word_it_is_half_a_gigabyte(limits):
    limit_memory()
    assert limits == [(resource.RLIMIT_DATA, (512 * 2**20, resource.RLIM_INFINITY))]


def test_a_lower_limit_from_outside_stays(limits, monkeypatch):
    monkeypatch.setattr(memory_limit.resource, "getrlimit", lambda _: (400 * 2**20, 450 * 2**20))
    limit_memory()
    assert limits == [(resource.RLIMIT_DATA, (400 * 2**20, 450 * 2**20))]


@pytest.mark.parametrize("text", ["", "much", "-1", "1", "299", "1000001", "512.0", "٥١٢"])
def test_what_is_no_limit_is_refused_with_the_fix(text, limits, monkeypatch):
    monkeypatch.setenv(VARIABLE, text)
    with pytest.raises(ParameterError, match="need 300 to 1000000 MB, or 0 for no limit"):
        limit_memory()
    assert limits == []


def test_a_node_says_so_in_one_line_and_ends_with_code_2():
    done = subprocess.run(
        [sys.executable, "-m", "chute_ros.ros.safety_supervisor"],
        env={**os.environ, VARIABLE: "lots"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    said = "safety_supervisor: CHUTE_ROS_MEMORY_LIMIT is 'lots': need 300 to 1000000 MB, or 0"
    assert done.stderr.startswith(said)
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("version", "cured"),
    [
        ((2, 6, 11), False),
        ((2, 6, 12), True),
        ((2, 10, 99), False),
        # Without the packet that takes all memory, but with others.
        ((2, 14, 6), False),
        ((2, 14, 7), True),
        ((3, 2, 4), False),
        ((3, 2, 5), True),
        ((3, 3, 1), False),
        ((3, 6, 2), False),
        ((3, 7, 0), True),
        ((4, 0, 0), True),
    ],
)
def test_each_line_of_fast_dds_has_a_first_version_that_is_cured(version, cured):
    assert is_cured(version) is cured


@pytest.mark.parametrize(
    ("file", "beside", "version"),
    [
        ("libfastrtps.so.2.14", "libfastrtps.so.2.14.5", (2, 14, 5)),
        ("libfastdds.so.3.2.2", "libother.so.1", (3, 2, 2)),
        ("libfastdds.so.3.2", "libfastdds.so", None),
        ("librmw_fastrtps_cpp.so", "libfastcdr.so.2.2.5", None),
    ],
)
def test_the_version_is_that_of_the_library_that_is_loaded(file, beside, version, tmp_path):
    for name in (file, beside):
        (tmp_path / name).write_text("")
    maps = tmp_path / "maps"
    maps.write_text(f"7f00-7f01 r-xp 00000000 08:01 42    {tmp_path}/{file}\n")
    assert fast_dds(maps) == version
    assert fast_dds(tmp_path / "none") is None


@pytest.mark.parametrize(
    ("version", "local", "level", "words"),
    [
        ((2, 14, 5), False, b"\x01", "Fast DDS 2.14.5: one packet from anybody on the network"),
        ((2, 14, 5), True, b"\x00", "Fast DDS 2.14.5, kept to this host"),
        ((2, 14, 6), False, b"\x01", "Fast DDS 2.14.6: one packet from anybody on the network"),
        ((2, 14, 7), False, b"\x00", "Fast DDS 2.14.7"),
        (None, False, b"\x00", "no Fast DDS"),
    ],
)
def test_diagnostics_name_the_version_and_those_that_are_cured(
    version, local, level, words, monkeypatch
):
    monkeypatch.setattr(middleware_diagnostics, "fast_dds", lambda: version)
    monkeypatch.setattr(middleware_diagnostics, "is_local", lambda: local)
    status = middleware_task("drone1/upf_can")
    assert (status.name, status.level) == ("drone1/upf_can: middleware", level)
    assert status.message.startswith(words)
    assert {one.key: one.value for one in status.values}["chute_ros"] == own_version()
    if level == b"\x01":
        for one in CURED:
            assert ".".join(map(str, one)) in status.message
        assert "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST" in status.message
