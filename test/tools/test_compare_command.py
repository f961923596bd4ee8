"""The comparison with what people use today: its command line, its page and its pictures."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from command_bench import assert_refused, call, flying, interrupted

from chute_ros.campaign.comparison import CURVE_OF, FACTORS, Compared, comparable
from chute_ros.campaign.draw import draw
from chute_ros.campaign.guards import GUARDS, OURS
from chute_ros.campaign.judge import Count
from chute_ros.tools import compare_command as compare
from chute_ros.tools.compare_classes import better, paired_delays
from chute_ros.tools.compare_page import Run, page
from chute_ros.tools.compare_picture import curves, delays

PEER = GUARDS[3].name


run = partial(call, compare)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--flights", "0"], "argument --flights: 0: need a whole number, 1 or more"),
        (["--flights", "1e3"], "argument --flights: 1e3: need a whole number, 1 or more"),
        (["--seed", "first"], "argument --seed: invalid int value: 'first'"),
        (["--jobs", "-1"], "argument --jobs: -1: need a whole number, 1 or more"),
        (["--page", "/nowhere/x.md"], "argument --page: /nowhere/x.md: No such file or directory"),
        (["--peers", "PX4"], "unrecognized arguments: --peers PX4"),
    ],
)
def test_a_mistake_is_said_at_once(arguments, words, monkeypatch, capsys) -> None:
    assert_refused(compare, monkeypatch, capsys, arguments, words)


@pytest.mark.parametrize("suffix", [".svg", ".delays.svg"])
def test_no_picture_goes_over_another_file(suffix, tmp_path, monkeypatch, capsys) -> None:
    (tmp_path / f"a{suffix}").write_text("mine")
    words = f"argument --page: {tmp_path}/a{suffix} exists and is no SVG picture: remove it, or"
    assert_refused(compare, monkeypatch, capsys, ["--page", str(tmp_path / "a.md")], words)


def test_two_flights_make_a_page_with_pictures(monkeypatch, tmp_path, capsys) -> None:
    first = next(n for n in range(100) if comparable(draw(n)) and comparable(draw(n + 1)))
    # None of them with scaled limits: those take five times as long.
    assert not {first % CURVE_OF, (first + 1) % CURVE_OF} & {0}
    path = tmp_path / "compare.md"
    arguments = ("--flights", "2", "--seed", str(first), "--jobs", "1", "--page", str(path))
    run(monkeypatch, *arguments)
    told = capsys.readouterr().out
    assert "2 of 2 seeds in " in told
    assert all(guard.name in told for guard in GUARDS)
    text = path.read_text(encoding="utf-8")
    assert f"Written by `make compare FLIGHTS=2 SEED={first}`: 2 flights of aircraft" in text
    for suffix in (".svg", ".delays.svg"):
        picture = path.with_suffix(suffix)
        assert f"]({picture.name})" in text
        ET.parse(picture)


def test_of_rockets_alone_nothing_is_written(monkeypatch, tmp_path, capsys) -> None:
    rocket = next(n for n in range(100) if comparable(draw(n)) is None)
    path = tmp_path / "compare.md"
    run(monkeypatch, "--flights", "1", "--seed", str(rocket), "--jobs", "1", "--page", str(path))
    assert f"{path} is not written" in capsys.readouterr().out
    assert not path.exists()


def test_ctrl_c_writes_what_was_flown_until_then(tmp_path) -> None:
    path = tmp_path / "compare.md"
    aircraft = next(n for n in range(100) if comparable(draw(n)))
    options = ("--seed", str(aircraft), "--jobs", "1", "--page", str(path))
    with flying("compare", *options) as process:
        first, out, err = interrupted(process)
    assert "flights, " in first
    assert "of 100000 seeds in" in out
    assert err.splitlines()[-1] == "compare: interrupted"
    assert path.read_text(encoding="utf-8").startswith("# Beside what people use today")


# -- what a page says of flights that are known ---------------------------------------------------


def flight(
    seed: int, ours: tuple[Count, float], theirs: tuple[Count, float], factor: float = 1.0
) -> list[Compared]:
    """A multirotor whose motor fails: counted as, and released so late (s), by us and by PX4; all
    others miss it."""
    told = {OURS.name: ours, PEER: theirs}
    lines = []
    for guard in GUARDS:
        count, delay = told.get(guard.name, (Count.MISSED, math.nan))
        who = (seed, guard.name, factor, "multirotor", "a motor fails", "none", "")
        needed = count is not Count.FALSE
        lines.append(Compared(*who, count, count, "", needed, delay, 10.0 * delay))
    return lines


FLOWN = [
    *flight(8, (Count.CORRECT, 1.0), (Count.CORRECT, 0.8)),
    *flight(9, (Count.MISSED, math.nan), (Count.CORRECT, 0.9)),
    *flight(10, (Count.CORRECT, 1.2), (Count.FALSE, math.nan)),
    *[line for n in range(11, 16) for line in flight(n, (Count.CORRECT, 1.0), (Count.LATE, 0.7))],
    *[
        line
        for factor in FACTORS
        if factor != 1.0
        for line in flight(8, (Count.CORRECT, factor), (Count.FALSE, math.nan), factor)
    ],
]
PLAIN = [one for one in FLOWN if one.factor == 1.0]
RUN = Run(20, 8, 60.0, "here")


def test_where_a_peer_is_better_is_named_with_seeds() -> None:
    found = better(PLAIN, PEER)
    assert found is not None
    assert (found.missed, found.false) == ((5, 1), (1, 0))
    assert found.delay == (0.7, 1.0)
    assert found.earlier
    assert found.seeds == (9,)
    # Those that miss everything are better in nothing.
    assert better(PLAIN, "threshold") is None


def test_delays_are_compared_in_the_flights_that_both_released() -> None:
    assert paired_delays(PLAIN, PEER) == [(0.8, 1.0), *[(0.7, 1.0)] * 5]


def test_the_page_counts_and_compares() -> None:
    text = page(FLOWN, RUN, ["c.svg", "d.svg"])
    assert "`make compare FLIGHTS=20 SEED=8`: 8 flights of aircraft with each guard" in text
    assert "| chute_ros | 7 | 1 | 0 | 0 |" in text
    assert f"| {PEER} | 2 | 0 | 5 | 1 |" in text
    fails = "multirotor, what fails: a motor fails"
    assert f"| {fails} | {PEER} | 5, 1 | 1, 0 | **0.70 s, 1.00 s** | 9 |" in text
    # Of 8 flights one was ended falsely, and 7 needed it.
    assert f"| {PEER} | 2 of 7 (28.6 %) | 1 of 8 (12.5 %) |" in text
    assert "| multirotor | a motor fails | 8 | 1 / 0 | 8 / 0 |" in text
    # One flight of the curve: PX4's is false as soon as its limits move.
    assert f"| multirotor, {PEER} | 0.0 / 100.0 | 0.0 / 100.0 | 0.0 / 0.0 |" in text
    assert "nan" not in text


def test_where_nobody_is_better_the_page_says_so() -> None:
    good = [line for n in range(3) for line in flight(n, (Count.CORRECT, 0.5), (Count.LATE, 0.9))]
    text = page(good, RUN, ["c.svg", "d.svg"])
    assert text.count("\n\nNone.\n") == 2


def test_what_the_judge_excuses_and_a_peer_saves_is_named() -> None:
    excused = [
        replace(one, count=Count.NO_TIME) if one.guard == OURS.name else one
        for one in flight(9, (Count.LATE, 1.3), (Count.CORRECT, 0.9))
    ]
    text = page(excused, RUN, ["c.svg", "d.svg"])
    assert text.endswith(f"| multirotor | a motor fails | {PEER} | 1 | 9 |\n")


@pytest.mark.parametrize("picture", [curves, delays])
def test_pictures_name_each_guard(picture, tmp_path: Path) -> None:
    text = picture(FLOWN)
    names = [one.text for one in ET.fromstring(text).iter("{http://www.w3.org/2000/svg}text")]
    assert [name for name in names if name in {one.name for one in GUARDS}] == [
        one.name for one in GUARDS
    ]
    assert "nan" not in text
