"""judge_log over flights whose outcome is known: which decisions were wrong, and the table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from command_bench import assert_refused
from log_bench import FAILS_AT, FALLS_FROM, judged, tlog

from chute_ros.errors import ChuteError
from chute_ros.tools.judge_log import command
from chute_ros.tools.judge_log.findings import LogVerdict, Rating, verdict_of
from chute_ros.tools.judge_log.flight_log import LogError
from chute_ros.tools.judge_log.known import FLIES, Known, known_of, mistake, page
from chute_ros.tools.state_rows import RuleTold

HEAD = "file\tsource\treal\twhat_happened\tright\tfrom\tuntil"


@pytest.fixture(scope="module")
def well(landed, tmp_path_factory) -> LogVerdict:
    return verdict_of(judged(tlog(landed, tmp_path_factory.mktemp("logs") / "well.tlog")))


@pytest.fixture(scope="module")
def fell(fallen, tmp_path_factory) -> LogVerdict:
    return verdict_of(judged(tlog(fallen, tmp_path_factory.mktemp("logs") / "fell.tlog")))


def known(right: str, begin: float = 0.0, end: float = 0.0) -> Known:
    return Known("", "", True, "", right, begin, end)


def test_an_end_is_right_from_the_failure_on_until_it_is_too_late(well, fell):
    at = fell.first
    assert mistake(known("ends", at - 1.0, at + 1.0), fell) == ""
    assert mistake(known("ends", at + 0.5, at + 1.0), fell).startswith(f"ended at {at:.1f} s, be")
    assert mistake(known("ends", at - 2.0, at - 0.5), fell).endswith(f"later than {at - 0.5:g} s")
    assert mistake(known("ends", 1.0, 2.0), well) == "not ended"
    assert mistake(known(FLIES), well) == ""
    assert mistake(known(FLIES), fell) == f"ended at {at:.1f} s, and nothing asked for it"
    assert mistake(known("either", at + 0.5), fell).startswith(f"ended at {at:.1f} s, before")
    assert mistake(known("either"), well) == mistake(known("either"), fell) == ""


def test_the_table_has_what_happened_beside_what_was_decided(well, fell, tmp_path):
    lines = [
        HEAD,
        "well.tlog\tsome/repo: a|b.tlog\tyes\tit takes off and lands\tflies\t\t",
        f"fell.tlog\tsome/repo: c.tlog\tno\ta motor fails\tends\t{FAILS_AT}\t{FAILS_AT + 2}",
        "none.bin\tsome/repo: none.bin\tyes\tempty\teither\t\t",
    ]
    tsv = tmp_path / "known.tsv"
    tsv.write_text("\n".join(lines) + "\n")
    unread = [(Path("none.bin"), LogError("none.bin: it is empty"))]
    text = page([well, fell], unread, known_of(tsv))
    assert "2 logs, 1 of them of real vehicles" in text
    assert "1 were ended, 0 wrongly" in text
    assert "| well.tlog | it takes off and lands |" in text
    assert "a motor fails (simulated)" in text
    height = text.partition("released at ")[2].partition(" m")[0]
    assert 0.7 * FALLS_FROM < int(height) < FALLS_FROM
    assert "- none.bin: it is empty" in text
    assert "- well.tlog: some/repo: a/b.tlog" in text


def test_a_log_of_which_nothing_is_known_is_told_before_any_is_judged(
    landed, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    tlog(landed, tmp_path / "begun.tlog")
    (tmp_path / "known.tsv").write_text(f"{HEAD}\nother.tlog\ty\tyes\tz\tflies\t\t\n")
    arguments = ("begun.tlog", "--known", "known.tsv")
    words = "--known has no line for begun.tlog"
    assert_refused(command, monkeypatch, capsys, arguments, words)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "need the columns file, source"),
        ("file\tright\nx\tflies\n", "need the columns file, source"),
        (f"{HEAD}\nx\ty\tyes\tz\tperhaps\t\t\n", "x: right is 'perhaps': need flies, ends or"),
        (f"{HEAD}\nx\ty\tyes\tz\tends\tsoon\t\n", "could not convert"),
        (f"{HEAD}\nx\ty\n", ""),
    ],
)
def test_a_table_that_is_none_is_refused(text, says, tmp_path):
    tsv = tmp_path / "known.tsv"
    tsv.write_text(text)
    with pytest.raises(ChuteError) as caught:
        known_of(tsv)
    assert says in str(caught.value)
    assert str(tsv) in str(caught.value)


def test_a_full_counter_that_ended_nothing_says_what_it_lacked():
    full = RuleTold("main overdue", "DEPLOY", (), hold=1.5, peak=1.5)
    assert "too few distinct samples" in Rating(full, (), 0.0).short_of
    for other in (replace(full, fulfilled_at=3.0), replace(full, peak=1.4)):
        assert Rating(other, (), 0.0).short_of == ""
