"""What a ground station tells is read as it comes."""

import io
import json
from types import SimpleNamespace

import pytest

from faults import ground_station_stories as stories
from faults.ground_station_link import GroundStationLink, StationEndedError


@pytest.fixture
def station(tmp_path, monkeypatch):
    """One whose process only writes what the test has it write."""
    process = SimpleNamespace(stdin=io.BytesIO(), stdout=io.BytesIO(), returncode=None)
    process.stdout.fileno = lambda: 0
    process.poll = lambda: process.returncode
    monkeypatch.setattr("subprocess.Popen", lambda *_, **__: process)
    monkeypatch.setattr("os.set_blocking", lambda *_: None)
    return GroundStationLink(tmp_path / "log", ["/drone1"])


def tells(station, text: bytes) -> None:
    out = station.process.stdout
    place = out.tell()
    out.write(text)
    out.seek(place)


def test_a_line_that_comes_in_two_pieces_is_one(station):
    tells(station, b'{"at": 1.0, "state": 4, "vehi')
    assert station.first(vehicle=...) is None
    tells(station, b'cle": "/drone1"}\n{"at": 2.0, "begun": true}\n')
    assert station.first(vehicle="/drone1") == {"at": 1.0, "state": 4, "vehicle": "/drone1"}
    assert station.first(begun=True)["at"] == 2.0


def test_what_was_told_before_does_not_count(station):
    tells(station, b'{"at": 1.0, "state": 4}\n{"at": 3.0, "state": 4}\n{"at": 4.0, "state": 7}\n')
    assert station.first(2.0, state=4)["at"] == 3.0
    assert station.first(3.5, state=4) is None
    assert [one["at"] for one in station.find(2.0, state=...)] == [3.0, 4.0]


def test_each_call_has_a_number_of_its_own(station):
    first = station.call("/drone1", "deploy", force=False, reason="a test")
    second = station.call("/drone1", "deploy", force=False, reason="a test")
    assert first != second
    station.give_up(first)
    orders = [json.loads(line) for line in station.process.stdin.getvalue().splitlines()]
    assert [order.get("call") for order in orders] == [first, second, None]
    assert orders[2] == {"give_up": first}


def test_one_that_has_ended_is_told_with_its_last_words(station, tmp_path):
    (tmp_path / "log").write_text("ImportError: no such thing")
    station.process.returncode = 1
    with pytest.raises(StationEndedError, match="code 1:\nImportError: no such thing"):
        station.read()


@pytest.mark.parametrize(
    ("actions", "wrong"),
    [
        (["KILL", "DEPLOY"], ""),
        (["KILL", "DEPLOY", "DEPLOY"], "2 deploys were acted on"),
        (["DEPLOY", "KILL"], "the kill did not go first"),
        ([], "0 deploys were acted on"),
    ],
)
def test_one_deploy_after_the_kill_is_right_and_nothing_else(actions, wrong):
    flight = SimpleNamespace(acted=lambda: [(1, n, action) for n, action in enumerate(actions)])
    judged = stories.not_one_deploy(flight)
    assert judged.startswith(wrong)
    assert bool(judged) == bool(wrong)


def test_stories_can_be_told_apart_by_their_names():
    names = [story.name for story in stories.STORIES]
    assert len(set(names)) == len(names)
