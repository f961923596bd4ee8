"""The full screen: the state in large, grey when it is old, and few bytes."""

from __future__ import annotations

import os
import re

import pytest
from chute_msgs.msg import RuleState, SafetyDecision, SafetyState
from heard_vehicle import Heard, parachute, stamped, state, vehicle

from chute_ros.tools.chute.screen import Screen
from chute_ros.tools.chute.status_text import StatusLine
from chute_ros.tools.chute.watch import essence
from chute_ros.tools.chute.watch_text import Page, empty_page, page_of

WIDTH, HEIGHT = 60, 30
GREY = "128;128;128"


@pytest.fixture
def heard():
    flying = Heard().hears(stamped(state()))
    return flying.hears(stamped(parachute())).hears(vehicle())


@pytest.fixture
def screen(monkeypatch):
    """A screen on a terminal with all colours."""
    monkeypatch.setenv("COLORTERM", "truecolor")
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    size = [os.terminal_size((WIDTH, HEIGHT))]
    monkeypatch.setattr("shutil.get_terminal_size", lambda: size[0])
    one = Screen()
    one.size = size
    return one


def rows(sent):
    """Number -> what a person reads in each row that was sent."""
    parts = re.findall(r"\x1b\[(\d+);1H(.*?)\x1b\[K", sent)
    return {int(number): re.sub(r"\x1b\[[0-9;]*m", "", row).rstrip() for number, row in parts}


def test_the_state_is_in_large_and_the_rest_below_in_its_order(heard):
    page = page_of(heard.view())
    assert page.banner == StatusLine("I N   F L I G H T", "plain")
    assert not page.grey
    heads = [line.text for line in page.lines if line.tone == "head"]
    assert heads == [
        "vehicle 1/1, link OK",
        "rules: 0 of 0 active, none counting",
        "decisions",
    ]


def test_it_turns_grey_with_the_age_when_it_is_older_than_2_s(heard):
    assert not page_of(heard.view(2.0)).grey
    page = page_of(heard.view(2.1))
    assert page.grey
    assert page.banner.text == "LAST WORD 2 s AGO (WAS I N   F L I G H T)"


def test_before_the_first_word_it_says_what_it_looks_for():
    page = empty_page("/drone1", "ROS domain 3", ["/drone2"], 12.0)
    assert page.grey
    assert [line.text for line in page.lines] == [
        "  no supervisor is received in /drone1 for 12 s",
        "  looked for in: ROS domain 3",
        "  vehicles found: /drone2",
    ]


def test_only_rows_that_changed_are_sent(heard, screen, capsys):
    screen.show(page_of(heard.view()), 0.0)
    whole = rows(capsys.readouterr().out)
    assert (len(whole), whole[2].strip()) == (HEIGHT, "I N   F L I G H T")
    screen.show(page_of(heard.view(0.2)), 0.25)
    assert capsys.readouterr().out == ""
    heard.hears(vehicle(height=70.0), at=0.3)
    screen.show(page_of(heard.view(0.3)), 0.5)
    changed = [*rows(capsys.readouterr().out).values()]
    assert [row.split(",")[0] for row in changed] == ["  height             70.0 m"]


def test_all_rows_are_sent_again_now_and_then_and_after_a_change_of_size(heard, screen, capsys):
    screen.show(page_of(heard.view()), 0.0)
    capsys.readouterr()
    screen.show(page_of(heard.view()), 10.0)
    assert len(rows(capsys.readouterr().out)) == HEIGHT
    screen.size[0] = os.terminal_size((40, 20))
    screen.show(page_of(heard.view()), 10.25)
    sent = capsys.readouterr().out
    assert "\x1b[2J" in sent
    assert len(rows(sent)) == 20


def test_grey_is_every_row_and_no_other_colour(heard, screen, capsys):
    screen.show(page_of(heard.view(9.0)), 0.0)
    sent = capsys.readouterr().out
    colours = set(re.findall(r"[34]8;2;(\d+;\d+;\d+)", sent))
    assert colours == {GREY}


@pytest.mark.parametrize("height", [1, 2, 3, 4, 5, 8])
def test_a_low_terminal_says_that_rows_are_missing(heard, screen, capsys, height):
    screen.size[0] = os.terminal_size((WIDTH, height))
    screen.show(page_of(heard.view()), 0.0)
    shown = rows(capsys.readouterr().out)
    assert max(shown) <= height
    assert height < 3 or any("make the terminal taller" in row for row in shown.values())


def test_a_long_reason_is_wrapped_and_a_longer_one_is_cut(screen, capsys):
    long = "x" * 1000
    screen.show(
        Page(
            StatusLine("READY", "good"),
            (StatusLine("word " * 20), StatusLine(long), StatusLine("end")),
        ),
        0.0,
    )
    shown = rows(capsys.readouterr().out)
    words = [row for row in shown.values() if "word" in row]
    assert [row.startswith("        word") for row in words] == [False, True]
    assert sum("xxx" in row for row in shown.values()) == 3
    assert all(len(row) <= WIDTH for row in shown.values())
    assert "end" in shown.values()


def test_brackets_of_a_text_are_no_markup(screen, capsys):
    line = StatusLine("[x] tilt_deg 73.34 [red]or[/red] [/]")
    screen.show(Page(StatusLine("READY", "good"), (line,)), 0.0)
    assert rows(capsys.readouterr().out)[4] == line.text


def test_measurements_and_ages_alone_are_no_news(heard):
    before = essence(heard.view())
    heard.hears(vehicle(height=99.0), at=0.5)
    assert essence(heard.view(0.9)) == before
    assert essence(heard.view(3.0)) != before
    heard.hears(stamped(parachute(deployed=True), at=1.0), at=1.0)
    assert essence(heard.view(1.0)) != before


def test_after_an_accident_all_that_matters_is_on_the_first_24_rows(screen, capsys):
    """Two parachutes, one of which is out; flight is blocked for many reasons."""
    screen.size[0] = os.terminal_size((80, 24))
    heard = Heard()
    why = "mavlink_parachute 1/161 released 3 s ago at 57.3 m, by rule 'falling' (it sinks)"
    reasons = [f"reason number {number} why it must not take off again now" for number in range(6)]
    rules = [RuleState(name=f"rule number {n}", action=4, alive=True) for n in range(20)]
    rules.append(RuleState(name="parachute open", action=3, alive=True, latched=True))
    heard.hears(
        stamped(
            state(
                state=SafetyState.DEPLOYED,
                state_text=f"DEPLOYED: {why}",
                flight_blocked=True,
                block_reasons=reasons,
                rules=rules,
                links=["mavlink_parachute", "upf_can"],
                link_states=[1, 1],
                link_ages=[0.1, 0.1],
                devices_healthy=[False, True],
            )
        )
    )
    out = {"deployed": True, "faults": ["1/161 is released"]}
    heard.hears(stamped(parachute(**out))).hears(vehicle())
    heard.hears(stamped(parachute(link="upf_can", device="33", backup_voltage=8.2)))
    for number, action in ((3, SafetyDecision.KILL), (4, SafetyDecision.DEPLOY)):
        one = SafetyDecision(epoch=7, id=number, action=action, rule="falling")
        one.reasons = ["vertical_speed -6.10 (below -5)", "acceleration 0.65 (below 5)"]
        heard.finds(stamped(one))
    for number in range(5, 9):
        block = SafetyDecision(epoch=7, id=number, action=1, rule="links", reasons=reasons)
        heard.hears(stamped(block))
    screen.show(page_of(heard.view()), 0.0)
    shown = [row for _, row in sorted(rows(capsys.readouterr().out).items())]
    assert len(shown) == 24
    whole = "\n".join(shown)
    for text in (
        "D E P L O Y E D",
        "released 3 s ago at",
        "flight BLOCKED",
        "KILL by rule 'falling', 0 s ago: vertical_speed -6.10 (below -5)",
        "DEPLOY by rule 'falling', 0 s ago: vertical_speed -6.10 (below -5)",
        "mavlink_parachute  OK, device NOT healthy",
        "upf_can            OK, device healthy",
        "mavlink_parachute 1/161  ARMED, armed, DEPLOYED",
        "upf_can 33         ARMED, armed, not deployed",
        "height             61.2 m",
        "vertical speed     0.0 m/s",
        "arming state       ARMED",
        "battery            15.8 V, 87 %",
        "parachute open: KILL, acted on",
    ):
        assert text in whole
    assert sum("rule number" in row for row in shown) <= 1, "what does not count is one row"
