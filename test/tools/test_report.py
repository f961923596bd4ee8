"""The report is one page that needs nothing else, and tells what happened."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import pytest
from chute_msgs.msg import SafetyDecision, SafetyState
from flight_bench import DEPLOY_AT, Flight, run

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage
from chute_ros.tools import report_command as report
from chute_ros.tools.recording import read
from chute_ros.tools.report_command import replayed_states
from chute_ros.tools.state_rows import rules_of, state_rows
from chute_ros.tools.timeline_rows import Band, Level

pytestmark = pytest.mark.xdist_group("report")
NASTY = '<script>alert(1)</script><img src="http://x.example/y">\'"&\x1b[2J\x00'


class Tags(HTMLParser):
    """What a browser would make of a page."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.tags, self.open, self.links, self.words = [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.links += [
            value for name, value in attributes if name in ("src", "href", "xlink:href")
        ]
        assert not [name for name, _ in attributes if name.startswith("on")], "no code"
        if tag not in ("meta", "br", "rect", "line", "path"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag in ("rect", "path"):
            if self.open and self.open[-1] == tag:
                self.open.pop()
            return
        assert self.open.pop() == tag

    def handle_startendtag(self, tag, attributes):
        self.tags.append(tag)

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    one = Flight(tmp_path_factory.mktemp("flight")).fly()
    one.land()
    return one


@pytest.fixture(scope="module")
def page(flight):
    return report.report(flight.files())


def section(page, heading):
    start = page.index(f"<h2>{heading}</h2>")
    return page[start : page.index("</section>", start)]


def test_it_is_written_beside_the_recording_and_named(flight, monkeypatch, capsys):
    assert run(report.main, monkeypatch, *flight.files()) == 0
    path = flight.files()[0].with_name(f"{flight.files()[0].name}.html")
    assert capsys.readouterr().out.strip() == str(path)
    assert path.read_text().startswith("<!DOCTYPE html>")
    path.unlink()


def test_it_needs_nothing_from_elsewhere_and_runs_nothing(page):
    tags = Tags(page)
    assert tags.open == []
    assert tags.links == []
    assert not {"script", "link", "img", "iframe", "object"} & set(tags.tags)
    assert "url(" not in page
    assert "@import" not in page


def test_each_decision_has_its_reasons_and_what_came_of_it(page, flight):
    told = section(page, "Decisions")
    assert told.count("<tr>") - 1 == len(flight.decided())
    kill = next(row for row in told.split("<tr>") if ">kill</b>" in row)
    assert f">{DEPLOY_AT:.3f}</td>" in kill
    assert "<li>operator: it falls</li>" in kill
    assert re.search(r"SENT</b> after 0\.\d+ s", kill)
    assert "CONFIRMED</b>" in kill
    assert "step 2" in kill


def test_a_request_stands_beside_its_answer(page):
    told = section(page, "Requests and their answers")
    assert "deploy" in told
    assert "reason: it falls" in told
    assert re.search(r"(success|no success)</b>.* after \d+\.\d+ s", told)


def test_what_was_decided_at_a_takeover_is_told_as_it_was_published(tmp_path):
    flight = Flight(tmp_path).fly(3.0)
    report_of_it = i.ActionReport(9, 1, "upf_can", Outcome.SENT, "on the wire", 9)
    message = SafetyDecision(
        epoch=9, id=1, action=int(Action.KILL), rule="rule", reasons=["another took over"]
    )
    flight.box.message("safety/decision", message)
    flight.turn(report_of_it)
    flight.land()
    told = section(report.report(flight.files()), "Decisions")
    row = next(row for row in told.split("<tr>") if "decision 1 of epoch 9" in row)
    assert "another took over" in row
    assert "upf_can" in row


def test_the_timeline_has_states_links_height_and_speed(page):
    words = {word.strip() for word in Tags(section(page, "Timeline")).words}
    rows = {"state", "mavlink_parachute", "decisions", "alarms", "height", "vertical speed"}
    assert rows | {"m", "m/s", "time from the start, s"} <= words


def test_links_are_told_at_every_moment_and_as_published_where_nothing_can_be_replayed(
    flight, monkeypatch
):
    recording = read(flight.files(), {})
    states = replayed_states(recording)
    assert len(states) >= len(recording.turns) - 1
    assert [one.links for _, one in states] == [["mavlink_parachute"]] * len(states)
    for number, turn in enumerate(recording.turns):
        recording.turns[number] = replace(turn, state=None, config=None)
    assert replayed_states(recording) == []
    monkeypatch.setattr(report, "replayed_states", lambda _: [])
    assert ">mavlink_parachute</text>" in report.report(flight.files())


def test_words_from_a_wire_are_only_words(tmp_path):
    flight = Flight(tmp_path)
    flight.reason = NASTY
    flight.fly()
    message = SafetyState(links=[NASTY], link_states=[1], devices_healthy=[True], alarms=[NASTY])
    flight.box.message("safety/state", message)
    flight.land()
    page = report.report(flight.files())
    tags = Tags(page)
    assert not {"script", "img"} & set(tags.tags)
    assert tags.links == []
    assert "\x1b" not in page
    assert any("<script>alert(1)</script>" in word for word in tags.words), "but can be read"


def test_what_is_missing_in_a_recording_is_said(flight, tmp_path):
    cut = tmp_path / "cut.mcap"
    data = flight.files()[0].read_bytes()
    cut.write_bytes(data[: len(data) - 10])
    assert "ends in the middle" in report.report([cut])


def test_a_recording_that_cannot_be_read_is_told_in_one_line(tmp_path, monkeypatch, capsys):
    wrong = tmp_path / "wrong.mcap"
    wrong.write_bytes(b"nothing")
    assert run(report.main, monkeypatch, wrong) == 2
    error = capsys.readouterr().err
    assert error.startswith("report: ")
    assert error.count("\n") == 1


def test_a_page_that_cannot_be_written_is_told(flight, tmp_path, monkeypatch, capsys):
    where = tmp_path / "none" / "page.html"
    assert run(report.main, monkeypatch, *flight.files(), "--output", where) == 2
    assert "No such file" in capsys.readouterr().err


# What safety/state tells


def rule(level, **told):
    fields = {
        "name": "free_fall",
        "action": int(Action.DEPLOY),
        "alive": True,
        "fulfilled": level >= 0.5,
        "latched": False,
        "level": level,
        "hold": 0.5,
        "conditions": [f"at {level}"],
        "denied": "",
    }
    return SimpleNamespace(**{**fields, **told})


def picture(**told):
    fields = {
        "state": int(Stage.READY),
        "mode": 0,
        "flight_blocked": False,
        "links": ["upf_can"],
        "link_states": [int(LinkState.OK)],
        "devices_healthy": [True],
    }
    return SimpleNamespace(**{**fields, **told})


def band(states, label):
    return next(row for row in state_rows(states) if isinstance(row, Band) and row.label == label)


def test_equal_pictures_are_one_stretch_and_silence_is_a_gap():
    states = [(0.0, picture()), (1.0, picture()), (2.0, picture()), (60.0, picture())]
    first, second = band(states, "state").segments
    assert (first.start, first.end, first.text) == (0.0, 4.5, "READY")
    assert second.start == 60.0


def test_a_link_that_is_heard_with_a_sick_device_is_not_well():
    states = [
        (0.0, picture()),
        (1.0, picture(devices_healthy=[False])),
        (2.0, picture(link_states=[int(LinkState.LOST)])),
        (3.0, picture(link_states=[77])),
    ]
    told = [one.text for one in band(states, "upf_can").segments]
    assert told == ["OK", "OK, DEVICE NOT HEALTHY", "LOST", "number 77"]


def test_rules_have_their_counters():
    states = [
        (0.0, picture(rules=[rule(0.0)])),
        (1.0, picture(rules=[rule(0.25)])),
        (2.0, picture(rules=[rule(0.5)])),
        (3.0, picture(rules=[rule(0.4, latched=True)])),
    ]
    (told,) = rules_of(states)
    assert (told.name, told.action, told.hold, told.peak) == ("free_fall", "DEPLOY", 0.5, 0.5)
    assert (told.peak_at, told.fulfilled_at, told.latched_at) == (2.0, 2.0, 3.0)
    assert told.conditions == ("at 0.5",)
    (level,) = (row for row in state_rows(states) if isinstance(row, Level))
    assert [share for _, share in level.points] == [0.0, 0.5, 1.0, 0.8]


def test_a_rule_that_was_not_acted_on_says_why():
    states = [
        (0.0, picture(rules=[rule(0.5, denied="below 15 m")])),
        (1.0, picture(rules=[rule(0)])),
    ]
    assert rules_of(states)[0].denied == "below 15 m"


def test_a_mode_that_is_not_active_has_a_row():
    assert band([(0.0, picture(mode=1)), (1.0, picture())], "mode").segments[0].text == "SHADOW"
