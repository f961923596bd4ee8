"""The report is one page that needs nothing else, and tells what happened."""

import html
import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import flight_bench
import pytest
from chute_msgs.msg import SafetyDecision, SafetyState
from flight_bench import DEPLOY_AT, Flight, run

from chute_ros.model import Action, LinkState, Outcome, ParachuteState, ParachuteStatus
from chute_ros.ros.recorded_topics import recorded_topics
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage
from chute_ros.tools import report_command as report
from chute_ros.tools.flight_story import FlightStory
from chute_ros.tools.recording import read
from chute_ros.tools.release_orders import Fate, MotionThen, Release
from chute_ros.tools.report_command import replayed_states
from chute_ros.tools.report_release import release_of
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


def text_of(part):
    """Its words, a line for each cell of a table."""
    cells = re.sub(r"</t[dh]>|</p>|</h3>", "\n", re.sub(r"<br>|<li>", " / ", part))
    lines = html.unescape(re.sub(r"<[^>]+>", "", cells)).splitlines()
    return [line.strip() for line in lines if line.strip()]


def test_the_first_section_tells_the_release_that_a_person_asked_the_supervisor_for(page):
    """At t+7 a person calls safety/deploy; the kill goes first, and the deploy follows it."""
    assert page.index("<h2>") == page.index("<h2>Release</h2>")
    assert text_of(section(page, "Release")) == [
        "Release",
        "Released: mavlink_parachute (7.300 s)",
        "Released",
        *("time, s", "parachute", "by whose order", "height, vertical speed"),
        *("what was reported", "what did not come"),
        "7.300",
        "mavlink_parachute",
        (
            "a person's request at safety/deploy (rule 'operator'), decision 3 of epoch 7 / "
            "operator: it falls / kill confirmed after 0.30 s (limit 0.5 s)"
        ),
        "24.4 m / -12.0 m/s",
        (
            "mavlink_parachute SENT after 0.100 s: step 0 / "
            "mavlink_parachute ACCEPTED after 0.200 s: step 1 / "
            "mavlink_parachute CONFIRMED after 0.300 s: step 2"
        ),
        "no status of a parachute of mavlink_parachute in the 4.6 s to the recording's end",
    ]


UNCONFIRMED = "Ordered, without a report that it was released by this"


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    """A page: on the ground, ~/deploy at t+1 releases; at t+1.8 it is called again, in vain."""
    flight = Flight(tmp_path_factory.mktemp("shot"))
    status = ParachuteStatus("1/161", LinkState.OK, ParachuteState.ARMED, backup_voltage=8.25)
    flight.fly(1.0).turn(i.ParachuteReport("mavlink_parachute", status))
    flight.call("~/deploy", "force=False, reason='a <test>'", 1.0)
    flight.fly(1.3)
    status = replace(
        status,
        deployed=True,
        state=ParachuteState.LAUNCHED,
        deployment_trigger=4,
        faults=("spent <now>",),
    )
    flight.turn(i.ParachuteReport("mavlink_parachute", status))
    answer = {"success": True, "accepted": True, "message": "deployed after 0.3 s", "after": 0.35}
    flight.call("~/deploy", "force=False, reason='a <test>'", 1.0, **answer)
    flight.fly(1.8).call("~/deploy", "force=True, reason=''", 1.8)
    flight.fly(3.0).turn(i.ParachuteReport("mavlink_parachute", status))
    flight.land()
    return report.report(flight.files())


def test_a_shot_that_a_person_fired_past_the_supervisor_is_told(shot):
    order = "a call of ~/deploy of mavlink_parachute, past the supervisor / "
    told = text_of(section(shot, "Release"))
    assert told[1:4] == [
        "Released: mavlink_parachute 1/161 (1.000 s)",
        f"{UNCONFIRMED}: mavlink_parachute 1/161 (1.800 s)",
        "Released",
    ]
    assert told[10:16] == [
        "1.000",
        "mavlink_parachute 1/161",
        order + "force=False, reason='a <test>'",
        "0.0 m / 0.0 m/s",
        (
            "own status deployed after 0.300 s: 1/161, trigger MAVLINK; "
            "not deployed 0.3 s before / "
            "mavlink_parachute answered: success, accepted after 0.350 s: deployed after 0.3 s"
        ),
        "nothing",
    ]
    assert told[16] == UNCONFIRMED
    assert told[23:] == [
        "1.800",
        "mavlink_parachute 1/161",
        order + "force=True, reason=''",
        "0.0 m / 0.0 m/s",
        "own status deployed already after 0.000 s: 1/161 reported it before the order",
        "no answer in the 1.2 s to the recording's end",
    ]


def test_what_was_asked_of_device_nodes_stands_beside_its_answer(shot):
    assert text_of(section(shot, "Requests to device nodes"))[6:] == [
        *("1.000", "mavlink_parachute", "~/deploy", "force=False, reason='a <test>'"),
        "success, accepted after 0.350 s: deployed after 0.3 s",
        *("1.800", "mavlink_parachute", "~/deploy", "force=True, reason=''", "no answer"),
    ]


def test_every_parachute_has_its_last_own_status(shot):
    assert text_of(section(shot, "Parachutes"))[9:] == [
        *("mavlink_parachute 1/161", "3.000", "OK", "LAUNCHED", "no, or not known"),
        *("deployed, trigger MAVLINK", "8.2", "/ spent <now>"),
    ]


def test_an_answer_whose_call_came_before_the_recording_is_told(tmp_path):
    flight = Flight(tmp_path).fly(1.0)
    flight.call("~/arm", "arm=True, triggers=0", -2.0, success=False, message="no", after=2.5)
    flight.fly(2.0).land()
    told = text_of(section(report.report(flight.files()), "Requests to device nodes"))
    assert told[6:] == [
        *("-1.500", "mavlink_parachute", "~/arm", "arm=True, triggers=0"),
        "no success after 2.500 s: no",
    ]


def test_a_flight_without_a_release_says_so_in_one_line(tmp_path):
    flight = Flight(tmp_path).fly(3.0)
    flight.land()
    assert text_of(section(report.report(flight.files()), "Release")) == [
        "Release",
        (
            "Nothing was released: no decision to deploy, no request to deploy, no call of a "
            "device node that orders one, and no parachute that turned to deployed."
        ),
    ]


def test_an_old_recording_is_read_and_says_that_it_lacks_the_calls(tmp_path, monkeypatch):
    """Given a black box of a version that did not record safety/person."""

    def as_before(node):
        return {n: one for n, one in recorded_topics(node).items() if n != "safety/person"}

    monkeypatch.setattr(flight_bench, "recorded_topics", as_before)
    flight = Flight(tmp_path).fly(3.0)
    flight.land()
    page = report.report(flight.files())
    lacks = "Requests to device nodes are not in this recording: it has no topic safety/person."
    assert text_of(section(page, "Release")) == [
        "Release",
        (
            "Nothing was released: no decision to deploy, no request to deploy, and no parachute "
            "that turned to deployed."
        ),
        lacks,
    ]
    assert text_of(section(page, "Requests to device nodes")) == [
        "Requests to device nodes",
        lacks,
    ]


@pytest.mark.parametrize(
    ("age", "told"),
    [
        (0.5, "32.1 m / -4.0 m/s"),
        (
            3.0,
            "height not known / (32.1 m 3.0 s before) / speed not known / (-4.0 m/s 3.0 s before)",
        ),
        (math.nan, "height not known / speed not known"),
    ],
)
def test_a_height_that_is_old_or_missing_is_not_known(age, told):
    one = Release(1.0, "upf_can 33", "rule 'free fall'", motion=MotionThen(32.1, age, -4.0, age))
    assert text_of(release_of([one], FlightStory()))[-3] == told


def test_what_was_refused_stands_apart_from_what_was_released():
    refused = Release(1.0, "none", "a person's request at safety/deploy", fate=Fate.REFUSED)
    shadow = Release(2.0, "upf_can", "rule 'free fall'", fate=Fate.NOT_SENT)
    told = text_of(release_of([refused, shadow], FlightStory()))
    assert told[:3] == [
        "Released: nothing",
        "Ordered, and refused or failed: none (1.000 s)",
        "Decided, and not sent: upf_can (2.000 s)",
    ]
    released = Release(3.0, "upf_can 33", "rule 'free fall'", fate=Fate.RELEASED)
    told = text_of(release_of([refused, shadow, released], FlightStory()))
    assert told[0] == "Released: upf_can 33 (3.000 s)"
    assert told.index("upf_can 33") < told.index("none"), "what was released has the first table"


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


@pytest.mark.parametrize("linked", [False, True])
def test_a_page_goes_over_no_recording(flight, linked, tmp_path, monkeypatch, capsys):
    file = flight.files()[0]
    output = tmp_path / "link" if linked else file
    if linked:
        output.symlink_to(file)
    before = file.read_bytes()
    assert run(report.main, monkeypatch, file, "--output", output) == 2
    assert f"report: {output} is read here: nothing is written over it" in capsys.readouterr().err
    assert file.read_bytes() == before


def test_a_page_goes_over_an_earlier_one_and_over_nothing_else(
    flight, tmp_path, monkeypatch, capsys
):
    output = tmp_path / "page.html"
    for _ in range(2):
        assert run(report.main, monkeypatch, *flight.files(), "--output", output) == 0
    output.write_text("notes of the flight")
    assert run(report.main, monkeypatch, *flight.files(), "--output", output) == 2
    expected = f"report: {output} exists and is no HTML page: remove it, or name another\n"
    assert capsys.readouterr().err.endswith(expected)
    assert output.read_text() == "notes of the flight"
    assert list(tmp_path.iterdir()) == [output], "nothing beside it"


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
