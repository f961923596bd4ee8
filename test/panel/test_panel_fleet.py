"""All vehicles on one page, the worst first. Pure."""

from __future__ import annotations

import re

import pytest
from chute_msgs.msg import SafetyState, SafetySummary
from heard_vehicle import NOW, WALL, stamped
from test_panel_parts import HOSTILE, text_of

from chute_ros.supervisor.machine import Stage
from chute_ros.tools.chute.hearing import ReceivedMessage
from chute_ros.tools.panel.fleet import age_of, fleet, link_to


def summary(stage, at=0.0, number=2, **fields):
    """A vehicle's newest word, received and sent at t+at."""
    message = SafetySummary(
        state=int(stage), state_name=stage.name, text=stage.name, links_ok=2, links=2, **fields
    )
    return ReceivedMessage(stamped(message, at), NOW + at, WALL + at, number)


def order(**those):
    """The names on the page, from the top."""
    page = fleet([(f"/{name}", heard) for name, heard in those.items()], NOW)
    return re.findall(r"<h2>/(.*?)</h2>", page)


def test_the_worst_comes_first():
    assert order(
        a=summary(Stage.READY),
        b=summary(Stage.IN_FLIGHT),
        c=summary(Stage.DEPLOYING),
        d=summary(Stage.FAULT),
        e=None,
        f=summary(Stage.READY, alarms=2),
        g=summary(Stage.READY, at=-5.0),
        h=summary(Stage.BLOCKED),
        i=summary(Stage.DEPLOYED),
    ) == ["d", "c", "i", "e", "f", "g", "h", "b", "a"]


def test_one_that_flies_unguarded_comes_next_to_what_has_failed_and_looks_like_it():
    why = "no parachute can be reached: upf_can is LOST"
    one = summary(Stage.IN_FLIGHT, alarms=1)
    one.message.text = f"IN_FLIGHT, NOT GUARDED: {why}"
    assert order(a=summary(Stage.KILLING), b=one, c=summary(Stage.FAULT)) == ["c", "b", "a"]
    page = fleet([("/a", one)], NOW)
    assert "tone-bad" in page
    assert text_of(page).startswith(f"/a ✖ IN FLIGHT, NOT GUARDED {why} alarms: 1")
    # With an alarm alone it is guarded, and not calm.
    one.message.text = "IN_FLIGHT: rule 'battery dead' warns: it is empty"
    assert "tone-warn" in fleet([("/a", one)], NOW)


def test_a_parachute_that_is_armed_on_the_ground_looks_so_in_every_state():
    for stage in (Stage.READY, Stage.LANDED, Stage.BLOCKED, Stage.ARMED):
        page = fleet([("/a", summary(stage, armed=["upf_can 33"]))], NOW)
        assert "tone-live" in page
        assert text_of(page).startswith(f"/a ◆ {stage.name} ")
    assert "tone-plain" in fleet([("/a", summary(Stage.IN_FLIGHT, armed=["upf_can 33"]))], NOW)


def test_one_that_is_silent_is_not_shown_as_if_it_were_now():
    page = fleet([("/a", summary(Stage.IN_FLIGHT, at=-5.0))], NOW)
    assert text_of(page) == (
        "/a ○ NOT KNOWN NOW it was IN_FLIGHT links OK: 2 of 2 last word: OLD: 5 s ago"
    )
    assert "vehicle old" in page


def test_the_first_word_is_latched_and_may_be_hours_old():
    hours = ReceivedMessage(stamped(summary(Stage.READY).message, -7200.0), NOW, WALL, 1)
    assert age_of(hours, NOW + 1.0) == pytest.approx(7201.0)
    assert "NOT KNOWN NOW" in fleet([("/a", hours)], NOW)
    # The second one is of now, whatever the sender's clock says.
    second = ReceivedMessage(hours.message, NOW, WALL, 2)
    assert age_of(second, NOW + 1.0) == pytest.approx(1.0)


def test_a_vehicle_with_all_that_is_said_of_it():
    one = summary(
        Stage.ARMED,
        mode=SafetyState.SHADOW,
        alarms=1,
        armed=["upf_can 33"],
        released=["mavlink_parachute 1/161"],
    )
    assert text_of(fleet([("/a", one)], NOW)) == (
        "/a ◆ ARMED mode SHADOW alarms: 1 links OK: 2 of 2 armed: upf_can 33 released: "
        "mavlink_parachute 1/161 last word: <1 s ago"
    )


def test_no_vehicle_is_told():
    assert text_of(fleet([], NOW)) == "No vehicle found."


def test_no_text_from_the_network_becomes_a_part_of_the_page():
    hostile = summary(Stage.READY, armed=[HOSTILE])
    hostile.message.state_name = hostile.message.text = HOSTILE
    page = fleet([(f"/{HOSTILE}", hostile)], NOW)
    assert "<script" not in page
    assert '"' not in link_to(f"/{HOSTILE}")
