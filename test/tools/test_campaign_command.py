"""The command line of the campaign: mistakes are said before any flight, results are kept."""

import json
import os
import re
import signal
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest
from command_bench import assert_refused, call, flying, interrupted

from chute_ros.campaign import campaign as flights
from chute_ros.campaign import checkpoint
from chute_ros.campaign.checkpoint import code_that_flies
from chute_ros.campaign.draw import draw
from chute_ros.campaign.judge import Count, JudgedFlight
from chute_ros.campaign.scenario import Failure
from chute_ros.campaign.scenario_text import scenario_of, text_of
from chute_ros.tools import campaign_command as campaign
from chute_ros.tools.campaign_page import plan
from chute_ros.tools.machine import machine

TAPES = str(Path(__file__).parents[1] / "campaign" / "tapes" / "bodies.tapes")
#: Flights from this one on are short.
SHORT = 114
#: For a process of it: it tells of each flight, not of some together.
ONE_BY_ONE = "from chute_ros.campaign import pool; pool._BUNDLE = 1"

run = partial(call, campaign)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--flights", "0"], "argument --flights: 0: need a whole number, 1 or more"),
        (["--flights", "-5"], "argument --flights: -5: need a whole number, 1 or more"),
        (["--flights", "nan"], "argument --flights: nan: need a whole number, 1 or more"),
        (["--fligths", "5"], "unrecognized arguments: --fligths 5"),
        (["--each", "0"], "argument --each: 0: need a whole number, 1 or more"),
        (["--each", "1", "--resume", "/tmp/kept"], "argument --each: a campaign of each kind"),
        (["--jobs", "0"], "argument --jobs: 0: need a whole number, 1 or more"),
        (["--jobs", "many"], "argument --jobs: many: need a whole number, 1 or more"),
        (["--scheduler", ""], "argument --scheduler: : need tcp://HOST:PORT"),
        (["--scheduler", "host"], "argument --scheduler: host: need tcp://HOST:PORT"),
        (["--scheduler", "tcp://host"], "argument --scheduler: tcp://host: need tcp://HOST:PORT"),
        (["--scheduler", "tcp://:1"], "argument --scheduler: tcp://:1: need tcp://HOST:PORT"),
        (["--scheduler", "tcp://h:99999"], "tcp://h:99999: need tcp://HOST:PORT"),
        (["--scheduler", "http://h:1"], "http://h:1: need tcp://HOST:PORT"),
        (["--scheduler", "tcp://h:1/x"], "tcp://h:1/x: need tcp://HOST:PORT"),
        (["--scheduler", "tcp://h:1", "--jobs", "999"], "argument --jobs: not allowed with"),
        (["--plan", "0"], "argument --plan: 0: need a whole number, 1 or more"),
        (["--core-hour-price", "-1"], "argument --core-hour-price: -1: need a number, 0 or more"),
        (["--core-hour-price", "nan"], "--core-hour-price: nan: need a number, 0 or more"),
        (["--page", "/nowhere/x.md"], "argument --page: /nowhere/x.md: No such file or directory"),
        (["--page", "/tmp"], "argument --page: /tmp is a folder: name a file in it"),
        (["--page", __file__], "test_campaign_command.py exists and is no Markdown page: remove"),
        (["--tapes", "/nowhere"], "argument --tapes: /nowhere: No such file or directory"),
        (["--tapes", __file__], "test_campaign_command.py: no file of tapes: it does not begin"),
        (
            ["--tapes", TAPES, "--scheduler", "tcp://127.0.0.1:1"],
            "argument --tapes: the workers of a cluster have no such file: fly here",
        ),
        (["--tapes-only"], "argument --tapes-only: name the file with --tapes"),
        (["--replay", "/nowhere"], "argument --replay: /nowhere: need a seed, or a file: "),
        (["--replay", __file__], "is no scenario of a campaign: JSONDecodeError"),
    ],
)
def test_a_mistake_is_said_at_once(arguments, words, monkeypatch, capsys):
    assert_refused(campaign, monkeypatch, capsys, arguments, words)


@pytest.mark.parametrize("suffix", [".svg", ".heights.svg"])
def test_no_picture_goes_over_another_file(suffix, tmp_path, monkeypatch, capsys):
    (tmp_path / f"a{suffix}").write_text("mine")
    words = f"argument --page: {tmp_path}/a{suffix} exists and is no SVG picture: remove it, or"
    assert_refused(campaign, monkeypatch, capsys, ["--page", str(tmp_path / "a.md")], words)


def test_it_writes_its_page_and_its_pictures(monkeypatch, tmp_path, capsys):
    page = tmp_path / "campaign.md"
    failures = str(tmp_path / "failures")
    with_page = ("--jobs", "1", "--page", str(page), "--failures", failures)
    run(monkeypatch, "--flights", "3", "--seed", "115", *with_page)
    assert "3 of 3 flights in" in capsys.readouterr().out
    text = page.read_text()
    command = r"`make campaign FLIGHTS=3 SEED=115`"
    written = re.search(command + r": (\d+) s, (\d+) flights a minute", text)
    took, rate = map(float, written.groups())
    assert 3.0 / rate * 60.0 == pytest.approx(took, rel=0.1, abs=0.6)
    assert f", 1 at a time on {machine()}." in text
    assert "| mavlink, " in text or "| upf, " in text or "| both, " in text
    for suffix in (".svg", ".heights.svg"):
        assert f"]({page.with_suffix(suffix).name})" in text
        assert page.with_suffix(suffix).read_text().startswith("<svg")
    assert not (tmp_path / "failures").exists()


def test_of_each_kind_it_flies_the_first(monkeypatch, tmp_path, capsys):
    page = tmp_path / "campaign.md"
    with_page = ("--jobs", "1", "--page", str(page), "--failures", str(tmp_path / "failures"))
    monkeypatch.setattr(campaign, "rare", lambda seeds, each: list(seeds)[5 : 5 + 2 * each])
    run(monkeypatch, "--flights", "30", "--seed", "110", "--each", "1", *with_page)
    told = capsys.readouterr()
    assert "2 of 30 seeds are flown" in told.err
    assert "2 of 2 flights in" in told.out
    text = page.read_text()
    assert "`make campaign FLIGHTS=30 SEED=110 EACH=1`: " in text
    assert "Of 30 seeds these are 2 flights: the first 1 of each kind" in text


def test_bodies_made_by_others_have_a_page_of_their_own(monkeypatch, tmp_path, capsys):
    page, failures = tmp_path / "bodies.md", str(tmp_path / "failures")
    given = ("--tapes", TAPES, "--tapes-only", "--jobs", "1", "--failures", failures)
    run(monkeypatch, "--flights", "4", "--page", str(page), *given)
    told = capsys.readouterr()
    assert "2 of 4 seeds are flown" in told.err
    text = page.read_text()
    assert "`make campaign TAPES=FILE FLIGHTS=4 SEED=0`: 2 flights on 26 tapes" in text
    assert "| body: what fails | correct | missed | late | false" in text
    assert "0 flights." in text
    run(monkeypatch, "--replay", "1", *given)
    assert '"tape": {' in capsys.readouterr().out


def fly_on(monkeypatch, tmp_path, flights, seed=SHORT):
    """Fly until so many are flown, two files beside each other; what the page says."""
    page = tmp_path / "campaign.md"
    run(
        *(monkeypatch, "--flights", str(flights), "--seed", str(seed), "--jobs", "1"),
        *("--page", str(page), "--resume", str(tmp_path / "kept.json")),
        *("--failures", str(tmp_path / "failures")),
    )
    pictures = [page.with_suffix(suffix).read_text() for suffix in (".svg", ".heights.svg")]
    return [re.sub(r"\d+ s\b|\d+ (flights )?a minute", "", page.read_text()), *pictures]


def test_one_that_was_interrupted_goes_on_and_counts_the_same(monkeypatch, tmp_path, capsys):
    for part in ("apart", "whole"):
        (tmp_path / part).mkdir()
    fly_on(monkeypatch, tmp_path / "apart", 1)
    assert "continuing" not in capsys.readouterr().err
    in_two = fly_on(monkeypatch, tmp_path / "apart", 3)
    told = capsys.readouterr()
    assert f"continuing after 1 flights of {tmp_path}" in told.err
    assert "3 of 3 flights in" in told.out
    assert in_two == fly_on(monkeypatch, tmp_path / "whole", 3)
    # Nothing is flown again: what flies now raises.
    monkeypatch.setattr(flights, "fly_here", None)
    capsys.readouterr()
    fly_on(monkeypatch, tmp_path / "whole", 3)
    assert "3 of 3 flights in" in capsys.readouterr().out


@pytest.fixture(scope="module")
def text_kept(tmp_path_factory):
    """Of a campaign of one flight."""
    folder = tmp_path_factory.mktemp("kept")
    with pytest.MonkeyPatch.context() as monkeypatch:
        fly_on(monkeypatch, folder, 1)
    return (folder / "kept.json").read_text()


@pytest.mark.xdist_group("campaign_kept")
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda text: text.replace(f'"seed": {SHORT}', '"seed": 41'),
            "kept with seed 41, this campaign",
        ),
        (lambda text: re.sub('"code": "[0-9a-f]{64}"', '"code": "x"', text), "kept with code x, "),
        (lambda text: text.replace('"format": 1', '"format": 9'), "kept with format 9, "),
        (lambda text: text.replace('"took"', '"t"'), "is no kept campaign: KeyError: 'took'"),
        (lambda text: text[:100], "is no kept campaign: JSONDecodeError"),
        (lambda text: "\x00\ufffd", "is no kept campaign: JSONDecodeError"),
        (lambda text: "[]", "is no kept campaign: TypeError"),
    ],
)
def test_flights_of_another_campaign_are_not_gone_on_with(
    change, words, text_kept, monkeypatch, tmp_path, capsys
):
    kept = tmp_path / "kept.json"
    changed = change(text_kept)
    assert changed != text_kept
    kept.write_text(changed)
    with pytest.raises(SystemExit) as ended:
        fly_on(monkeypatch, tmp_path, 2)
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert "argument --resume: " in told
    assert words in told
    assert kept.read_text() == changed, "it is left as it is"


def test_a_full_disk_does_not_end_the_flights(monkeypatch, tmp_path, capsys):
    def full_disk(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(campaign.checkpoint, "text_of", full_disk)
    fly_on(monkeypatch, tmp_path, 1)
    told = capsys.readouterr()
    assert "1 of 1 flights in" in told.out
    assert "not saved: [Errno 28] No space left on device" in told.err


def test_a_file_that_takes_long_to_write_is_written_less_often(monkeypatch, tmp_path):
    now, written = [0.0], []

    def slow(*_):
        now[0] += 10.0
        written.append(now[0])
        return ""

    monkeypatch.setattr(campaign, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(campaign.checkpoint, "text_of", slow)
    kept = campaign._Kept(tmp_path / "kept.json", 0, tmp_path)
    while now[0] < 500.0:
        kept.look(flights.Tally())
        now[0] += 1.0
    assert written == [70.0, 270.0, 470.0], "a twentieth of the time"


@pytest.mark.parametrize("changed", ["profiles/one.yaml", "dsdl/flyfire/163", "telem/57.yaml"])
def test_the_code_that_flies_is_told_apart(tmp_path, monkeypatch, changed):
    monkeypatch.setattr(checkpoint, "shared_folder", lambda name, what: tmp_path / name)
    for name in ("profiles/one.yaml", "dsdl/flyfire/163", "telem/57.yaml"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text("a")
    before = code_that_flies(tmp_path / "profiles")
    assert code_that_flies(tmp_path / "profiles") == before
    (tmp_path / changed).write_text("b")
    assert code_that_flies(tmp_path / "profiles") != before


@pytest.mark.parametrize(
    ("changed", "flies"),
    [
        ("settings.py", True),
        ("runtime/device.py", True),
        ("links/mavlink/virtual.py", True),
        ("supervisor/core.py", True),
        ("ros/qos.py", False),
        ("tools/demo.py", False),
    ],
)
def test_all_code_of_a_flight_counts_and_no_other(tmp_path, monkeypatch, changed, flies):
    monkeypatch.setattr(checkpoint.chute_ros, "__file__", str(tmp_path / "__init__.py"))
    (tmp_path / changed).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / changed).write_text("a")
    before = code_that_flies(tmp_path / "profiles")
    (tmp_path / changed).write_text("b")
    assert (code_that_flies(tmp_path / "profiles") != before) is flies


@pytest.fixture
def all_missed(monkeypatch):
    """A campaign whose every flight is judged as missed."""
    monkeypatch.setattr(flights, "judge", lambda flown: JudgedFlight(Count.MISSED, "for a test"))


def test_what_must_not_be_is_saved_and_told_again(all_missed, monkeypatch, tmp_path, capsys):
    folder = tmp_path / "failures"
    with pytest.raises(SystemExit) as ended:
        run(
            *(monkeypatch, "--flights", "1", "--seed", "7", "--jobs", "1"),
            *("--failures", str(folder)),
        )
    assert ended.value.code == 1
    told, at_once = capsys.readouterr()
    assert "  seed 7, " in told
    assert at_once.startswith("seed 7, ")
    assert f"saved in {folder}" in told
    saved = folder / "7.json"
    assert scenario_of(saved.read_text(), "x") == (draw(7), "MISSED: for a test")
    run(monkeypatch, "--replay", str(saved))
    from_file = capsys.readouterr().out
    run(monkeypatch, "--replay", "7")
    assert capsys.readouterr().out == from_file
    assert '"seed": 7' in from_file
    assert "   0.000 s  is up" in from_file


def test_a_changed_scenario_can_be_flown_and_says_who_outlives_the_autopilot(
    monkeypatch, tmp_path, capsys
):
    lost = replace(draw(7), faults=(), failure=Failure.POWER, vehicle="mavlink")
    lost = replace(lost, profile="multirotor", vehicle_sources=("vehicle/state", "odometry"))
    file = tmp_path / "lost.json"
    file.write_text(text_of(lost, "made by hand"))
    run(monkeypatch, "--replay", str(file))
    told = capsys.readouterr().out
    assert '"faults": []' in told
    assert '"vehicle_sources": [' in told
    assert "and with it the autopilot, outlived by: odometry" in told


def test_a_folder_that_cannot_be_written_is_said(all_missed, monkeypatch, tmp_path, capsys):
    taken = tmp_path / "taken"
    taken.write_text("")
    with pytest.raises(SystemExit):
        run(monkeypatch, "--flights", "1", "--jobs", "1", "--failures", str(taken))
    assert "not saved (name another folder with --failures): " in capsys.readouterr().out


def flown_by(out):
    return int(re.search(r"^(\d+) of 100000 flights in ", out, re.M)[1])


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_was_flown_until_ctrl_c_is_written(jobs, tmp_path):
    page = tmp_path / "campaign.md"
    options = ("--jobs", str(jobs), "--page", str(page), "--failures", str(tmp_path))
    with flying("campaign", *options, changed=ONE_BY_ONE) as process:
        first, out, err = interrupted(process)
    assert err.splitlines()[-1] == "campaign: interrupted"
    flown = flown_by(out)
    assert flown >= int(first.split()[0]) > 0
    assert f"`make campaign FLIGHTS={flown} SEED=0`" in page.read_text()


def test_a_ctrl_c_that_a_destructor_drops_ends_it_with_the_next_flight(tmp_path):
    drops = """
import signal
class Dropping:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)
look = command._CampaignProgress.look
def dropped(self, tally):
    look(self, tally)
    if tally.flights == 2:
        Dropping()
command._CampaignProgress.look = dropped
"""
    with flying("campaign", "--jobs", "1", "--failures", str(tmp_path), changed=drops) as process:
        out, err = process.communicate(timeout=120.0)
    assert process.returncode == 130, err
    assert err.splitlines()[-1] == "campaign: interrupted"
    assert flown_by(out) in (2, 3)


def test_a_process_of_it_that_dies_ends_it_with_what_was_flown(tmp_path):
    """As the system does that has no memory left."""
    kept = tmp_path / "kept.json"
    options = ("--jobs", "2", "--failures", str(tmp_path), "--resume", str(kept))
    with flying("campaign", *options, changed=ONE_BY_ONE) as process:
        process.stderr.readline()
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        os.kill(int(children[0]), signal.SIGKILL)
        out, err = process.communicate(timeout=60.0)
    assert process.returncode == 1, err
    assert err.splitlines()[-1].startswith("campaign: one of its processes ended by itself")
    assert "Traceback" not in err
    assert flown_by(out) > 0
    assert json.loads(kept.read_text())["flights"] == flown_by(out)


def test_a_plan_tells_hours_and_core_hours_from_the_rate_of_one_core():
    text = plan(10_000_000, 2.5, 600, None)
    assert text.startswith("10000000 flights, if each core flies 150 a minute, as in the 600 ")
    head, _, one, four, *_, last = text.splitlines()[2:]
    assert head == "| workers, one a core | hours | core hours |"
    assert one == "| 1 | 1111.1 | 1111 |"
    assert four == "| 4 | 277.8 | 1111 |"
    assert last == "| 1024 | 1.1 | 1111 |"


def test_a_price_is_only_what_it_is_given():
    head, _, one, *_ = plan(3600, 1.0, 600, 0.25).splitlines()[2:]
    assert head.endswith("| cost at 0.25 a core hour |")
    assert one == "| 1 | 1.0 | 1 | 0.25 |"
