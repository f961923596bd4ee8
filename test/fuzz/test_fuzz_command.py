"""make fuzz: its command line, what it reads from libFuzzer, the page that it writes."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from fuzz import __main__ as command
from fuzz import page, run
from fuzz.program import Program
from fuzz.targets import NAMES

#: Of a real run, shortened.
SAID = """\
INFO: Using built-in libfuzzer
#2	INITED cov: 28 ft: 28 corp: 1/1b exec/s: 0 rss: 101Mb
fuzz slowest: 3.5
fuzz largest: 120
#1024	pulse  cov: 90 ft: 300 corp: 50/1000b lim: 53 exec/s: 819 rss: 110Mb
fuzz found: /work/fuzz/found/mavlink.raw/found-0123
fuzz slowest: 12.5
#4292	DONE   cov: 91 ft: 439 corp: 88/3329b lim: 142 exec/s: 476 rss: 111Mb
stat::number_of_executed_units: 4292
stat::peak_rss_mb:              112
"""


def call(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> object:
    """The exit code, or what it says at the end."""
    monkeypatch.setattr(sys, "argv", ["fuzz", *arguments])
    with pytest.raises(SystemExit) as caught:
        command.main()
    return caught.value.code


@pytest.mark.parametrize("minutes", ["", "ten", "0", "-1", "nan", "inf", "1e9"])
def test_minutes_that_are_none_are_told_with_what_would_be(
    minutes: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "why_not", lambda: "")
    told = call(monkeypatch, f"--minutes={minutes}")
    assert str(told).startswith(f"fuzz: MINUTES is {minutes!r}: need a number from ")
    assert str(told).endswith("as in make fuzz MINUTES=10")


def test_the_minutes_are_divided_among_the_targets(monkeypatch: pytest.MonkeyPatch) -> None:
    assert command._time("10", 20, 2) == (10.0, 60)
    assert command._time("10", 20, 1) == (10.0, 30)


def test_a_target_that_is_none_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    told = call(monkeypatch, "--minutes=1", "mavlink.rwa")
    assert str(told).startswith("fuzz: there is no target 'mavlink.rwa': need one of mavlink.raw")


def test_where_atheris_is_missing_that_is_told_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "atheris", None)
    told = str(call(monkeypatch, "--minutes=1"))
    assert told.startswith("fuzz: atheris cannot be imported by Python 3.")
    assert "3.10 to 3.13" in told
    assert "\n" not in told


def test_a_stored_input_is_replayed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "input"
    file.write_bytes(b"\0\xfd\0")
    monkeypatch.setattr(sys, "argv", ["fuzz", "--replay", "mavlink.raw", str(file)])
    command.main()
    assert "mavlink.raw: read in " in capsys.readouterr().out
    told = call(monkeypatch, "--replay", "mavlink.raw", str(tmp_path / "none"))
    assert str(told).endswith("none: No such file or directory")


def test_what_libfuzzer_says_is_read() -> None:
    outcome = run.outcome_of("mavlink.raw", 10, SAID, 0)
    assert (outcome.inputs, outcome.edges, outcome.features) == (4292, 91, 439)
    assert (outcome.slowest, outcome.largest, outcome.memory) == (12.5, 120, (101, 112))
    assert outcome.found == [Path("/work/fuzz/found/mavlink.raw/found-0123")]
    assert outcome.died == ""
    assert outcome.line().endswith("112 MB: 1 findings")


def test_a_run_that_dies_is_a_finding() -> None:
    said = "#2	INITED cov: 1 ft: 1 corp: 1/1b exec/s: 0 rss: 9Mb\nSEGV\n"
    said += "Test unit written to /x/crash-1\n"
    outcome = run.outcome_of("mavlink.raw", 10, said, 77)
    assert outcome.found == [Path("/x/crash-1")]
    assert outcome.died == "it died (code 77): Test unit written to /x/crash-1"
    assert page.told(outcome)[0] == "`python3 -m fuzz --replay mavlink.raw /x/crash-1`"


def test_the_page_has_a_row_for_each_target_and_every_finding() -> None:
    outcomes = [run.outcome_of(name, 10, SAID, 0) for name in NAMES]
    text = page.page(outcomes, 10.0)
    for name in NAMES:
        assert f"| {name}: " in text
        assert f"`python3 -m fuzz --replay {name} " in text
    assert "Written by `make fuzz MINUTES=10`" in text


def test_a_finding_makes_the_exit_code_1_and_says_how_to_replay_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run, "why_not", lambda: "")
    monkeypatch.setattr(run, "fuzz", lambda name, seconds: run.outcome_of(name, seconds, SAID, 0))
    assert call(monkeypatch, "--minutes=1", "mavlink.raw") == 1
    out = capsys.readouterr().out
    assert "[1/1] mavlink.raw: 4292 inputs" in out
    assert "found: `python3 -m fuzz --replay mavlink.raw " in out


def test_a_program_reads_on_and_then_zeros() -> None:
    program = Program(b"\1\2\3ab\xff")
    assert program.flag()
    assert program.choice("abc") == "c"
    assert program.piece() == b"ab\xff"
    assert program.over
    assert (program.byte(), program.whole(4), program.piece()) == (0, 0, b"")
    assert program.rest() == b""
