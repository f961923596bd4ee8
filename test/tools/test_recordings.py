"""Recordings of several vehicles and starts are not mixed: each has its page, and replay asks."""

import shutil
from dataclasses import replace

import pytest
from chute_msgs.msg import SafetyState
from flight_bench import START, WALL, Flight, run

from chute_ros.errors import RecordError
from chute_ros.supervisor import inputs as i
from chute_ros.tools import replay_command as replay
from chute_ros.tools import report_command as report
from chute_ros.tools.recordings import recordings_of

pytestmark = pytest.mark.xdist_group("recordings")
HOUR = 3600 * 10**9


def fly(folder, until=1.0, **given):
    Flight(folder, **given).fly(until).land()


@pytest.fixture(scope="module")
def several(tmp_path_factory):
    """Two starts of one vehicle, an hour apart, its standby, and another vehicle."""
    folder = tmp_path_factory.mktemp("several")
    fly(folder)
    fly(folder, wall=WALL + HOUR, epoch=8)
    fly(folder, node="standby", epoch=9)
    fly(folder, namespace="/drone2", epoch=7)
    return folder


@pytest.fixture
def folder(several, tmp_path):
    return shutil.copytree(several, tmp_path / "box")


NAMES = [
    "drone1.safety_supervisor_000001_20260528T202640Z.mcap",
    "drone1.safety_supervisor_000002_20260528T212640Z.mcap",
    "drone1.standby_000001_20260528T202640Z.mcap",
    "drone2.safety_supervisor_000001_20260528T202640Z.mcap",
]
LISTED = """\
   1  {}: vehicle /drone1, from 2026-05-28 20:26:40 UTC
   2  {}: vehicle /drone1, from 2026-05-28 21:26:40 UTC
   3  {}: vehicle /drone1, from 2026-05-28 20:26:40 UTC
   4  {}: vehicle /drone2, from 2026-05-28 20:26:40 UTC
""".format(*NAMES)


def test_report_makes_a_page_of_each_and_lists_them(folder, monkeypatch, capsys):
    assert run(report.main, monkeypatch, folder) == 0
    pages = [folder / f"{name}.html" for name in NAMES]
    assert capsys.readouterr().out.splitlines() == [str(page) for page in pages]
    for page, vehicle in zip(pages, ["/drone1"] * 3 + ["/drone2"], strict=True):
        text = page.read_text()
        assert f"vehicle {vehicle}, from" in text
        assert ", 0.9 s, 10 turns of the core" in text


def test_report_of_one_of_them_makes_its_page_alone(folder, monkeypatch, capsys):
    assert run(report.main, monkeypatch, folder, "--recording", 4) == 0
    assert capsys.readouterr().out == f"{folder / NAMES[3]}.html\n"
    assert len(list(folder.glob("*.html"))) == 1


def test_report_into_one_file_asks_which(folder, monkeypatch, capsys):
    assert run(report.main, monkeypatch, folder, "--output", folder / "one.html") == 2
    assert capsys.readouterr().err == (
        "report: --output is one page, and these are 4 recordings: choose one with --recording "
        f"NUMBER\n{LISTED}"
    )
    assert list(folder.glob("*.html")) == []


def test_replay_asks_which_and_reads_none_of_them(folder, monkeypatch, capsys):
    def read(*_):
        raise AssertionError("nothing is read to its end")

    monkeypatch.setattr(replay, "read", read)
    assert run(replay.main, monkeypatch, folder) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err == (
        "replay: 4 recordings: choose one with --recording NUMBER, or name its files\n" + LISTED
    )


def test_replay_of_the_chosen_one_decides_it_again(folder, monkeypatch, capsys):
    assert run(replay.main, monkeypatch, folder, "--recording", 2) == 0
    assert "10 turns replayed" in capsys.readouterr().out


@pytest.mark.parametrize("number", [0, 5, -1])
def test_a_number_that_none_has_is_told_with_the_list(number, folder, monkeypatch, capsys):
    assert run(replay.main, monkeypatch, folder, "--recording", number) == 2
    assert capsys.readouterr().err == (
        f"replay: --recording {number}: need a number of this list\n{LISTED}"
    )


def test_named_files_of_one_supervisor_are_one_recording_and_its_starts_are_told(
    folder, monkeypatch, capsys
):
    assert run(replay.main, monkeypatch, folder / NAMES[0], folder / NAMES[1]) == 0
    out = capsys.readouterr().out
    assert "remark: 2 starts of the supervisor are in it" in out
    assert "20 turns replayed" in out


def test_a_file_that_is_given_again_is_read_once(folder, tmp_path, monkeypatch, capsys):
    file, link = folder / NAMES[0], tmp_path / "link.mcap"
    link.symlink_to(file)
    assert run(replay.main, monkeypatch, file, file, link) == 0
    told = capsys.readouterr()
    assert "10 turns replayed" in told.out
    assert told.err.splitlines() == [
        f"replay: {again} is the same file as {file}: read once" for again in (file, link)
    ]


def test_named_files_of_several_vehicles_are_not_mixed(folder, monkeypatch, capsys):
    assert run(replay.main, monkeypatch, folder / NAMES[0], folder / NAMES[3]) == 2
    assert "replay: 2 recordings: choose one" in capsys.readouterr().err


def test_files_with_other_names_are_told_apart_by_their_vehicle(folder):
    (folder / NAMES[0]).rename(folder / "a.mcap")
    (folder / NAMES[3]).rename(folder / "b.mcap")
    found = recordings_of([folder / "a.mcap", folder / "b.mcap"])
    assert [one.begin.namespace for one in found] == ["/drone1", "/drone2"]


def test_full_files_of_one_start_are_one_recording(tmp_path, await_until):
    """Given a supervisor that is reset by a person while its first file fills."""
    flight = Flight(tmp_path, limit=1000)
    flight.fly(1.0)
    flight.turn(i.ResetRequest(1))
    flight.fly(2.0)
    await_until(lambda: flight.box.counts()["bytes in the file"] > 1000, "the first is full")
    assert flight.state.started_at > START, "a reset begins anew"
    flight.fly(3.0).land()
    fly(tmp_path, epoch=8, wall=WALL + HOUR)
    first, second = recordings_of([tmp_path])
    assert len(first.files) == 2
    assert str(first).startswith(f"{NAMES[0]} to drone1.safety_supervisor_000002_")
    assert "(2 files): vehicle /drone1" in str(first)
    assert len(second.files) == 1


def test_a_start_whose_first_turns_are_lost_is_a_recording_of_its_own(tmp_path):
    """Given a disk that took the second start's turns only from the hundredth on."""
    fly(tmp_path)
    later = Flight(tmp_path, epoch=8)
    later.state = replace(later.state, started_at=2000.0)
    later.box._turns = 100
    later.fly(1.0).land()
    assert [len(one.files) for one in recordings_of([tmp_path])] == [1, 1]


def test_a_file_without_a_turn_goes_with_the_one_before_it(folder):
    flight = Flight(folder)
    flight.box.message("safety/state", SafetyState())
    flight.land()
    first = recordings_of([folder])
    assert [len(one.files) for one in first] == [1, 2, 1, 1]


def test_a_file_that_cannot_be_read_costs_the_others_nothing(folder, monkeypatch, capsys):
    bad = folder / "drone1.safety_supervisor_000003_20260528T222640Z.mcap"
    bad.write_bytes(b"")
    assert run(report.main, monkeypatch, folder) == 2
    told = capsys.readouterr()
    assert len(told.out.splitlines()) == 4
    assert told.err == f"report: {bad} is no MCAP file\n"
    assert run(replay.main, monkeypatch, folder) == 2
    assert f"   3  {bad.name}: {bad} is no MCAP file\n" in capsys.readouterr().err


def test_a_named_file_that_cannot_be_read_is_told_at_once(folder, tmp_path):
    (tmp_path / "bad.mcap").write_bytes(b"")
    with pytest.raises(RecordError, match="is no MCAP file"):
        recordings_of([folder / NAMES[0], tmp_path / "bad.mcap"])
