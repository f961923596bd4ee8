"""The command line of the campaign: mistakes are said before any flight, results are kept."""

import os
import re
import signal
import subprocess
import sys
from dataclasses import replace

import pytest

from chute_ros.campaign import campaign as flights
from chute_ros.campaign.judge import Count, Judged
from chute_ros.campaign.scenario import draw
from chute_ros.campaign.scenario_text import scenario_of, text_of
from chute_ros.tools import campaign


def run(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["campaign", *arguments])
    campaign.main()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--flights", "0"], "argument --flights: 0: need 1 or more"),
        (["--flights", "-5"], "argument --flights: -5: need 1 or more"),
        (["--jobs", "0"], "argument --jobs: 0: need 1 or more"),
        (["--jobs", "many"], "argument --jobs: invalid positive value: 'many'"),
        (["--page", "/nowhere/x.md"], "argument --page: /nowhere/x.md: no file can be written"),
        (["--page", "/tmp"], "argument --page: /tmp: no file can be written there"),
        (["--replay", "/nowhere"], "argument --replay: /nowhere: need a seed, or a file: "),
        (["--replay", __file__], "is no scenario of a campaign: JSONDecodeError"),
    ],
)
def test_a_mistake_is_said_at_once(arguments, words, monkeypatch, capsys):
    with pytest.raises(SystemExit) as ended:
        run(monkeypatch, *arguments)
    assert ended.value.code == 2
    told = capsys.readouterr()
    assert words in told.err
    assert told.out == ""


def test_it_writes_its_page_and_its_pictures(monkeypatch, tmp_path, capsys):
    page = tmp_path / "campaign.md"
    failures = str(tmp_path / "failures")
    with_page = ("--jobs", "1", "--page", str(page), "--failures", failures)
    run(monkeypatch, "--flights", "3", "--seed", "5", *with_page)
    assert "3 of 3 flights in" in capsys.readouterr().out
    text = page.read_text()
    assert "`make campaign FLIGHTS=3 SEED=5`" in text
    assert "| mavlink, " in text or "| upf, " in text or "| both, " in text
    for suffix in (".svg", ".heights.svg"):
        assert f"]({page.with_suffix(suffix).name})" in text
        assert page.with_suffix(suffix).read_text().startswith("<svg")
    assert not (tmp_path / "failures").exists()


@pytest.fixture
def all_missed(monkeypatch):
    """A campaign whose every flight is judged as missed."""
    monkeypatch.setattr(flights, "judge", lambda flown: Judged(Count.MISSED, "for a test"))


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


def test_a_folder_that_cannot_be_written_is_said(all_missed, monkeypatch, tmp_path, capsys):
    taken = tmp_path / "taken"
    taken.write_text("")
    with pytest.raises(SystemExit):
        run(monkeypatch, "--flights", "1", "--jobs", "1", "--failures", str(taken))
    assert "not saved, name another folder with --failures: " in capsys.readouterr().out


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_was_flown_until_ctrl_c_is_written(jobs, tmp_path):
    """As in a terminal, where every process of the command gets the signal."""
    page = tmp_path / "campaign.md"
    command = [sys.executable, "-m", "chute_ros.tools.campaign", "--flights", "100000"]
    command += ["--jobs", str(jobs), "--page", str(page), "--failures", str(tmp_path)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        first = process.stderr.readline()
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=60.0)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    flown = int(re.search(r"^(\d+) of 100000 flights in ", out, re.M)[1])
    assert flown >= int(first.split()[0]) > 0
    assert f"`make campaign FLIGHTS={flown} SEED=0`" in page.read_text()


def test_a_changed_scenario_can_be_flown(monkeypatch, tmp_path, capsys):
    calm = replace(draw(7), faults=(), gusts=0.0)
    file = tmp_path / "calm.json"
    file.write_text(text_of(calm, "made by hand"))
    run(monkeypatch, "--replay", str(file))
    assert '"faults": []' in capsys.readouterr().out
