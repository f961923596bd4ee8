"""What chute shows of the messages that it received: no text without its age."""

from __future__ import annotations

import json
import math

import pytest
from chute_msgs.msg import (
    ActionReport,
    RuleState,
    SafetyDecision,
    SafetyState,
)
from heard_vehicle import NOW, Heard, heartbeat, parachute, stamped, state, vehicle

from chute_ros.tools.chute import listening as listening_module
from chute_ros.tools.chute.hearing import MOST_NAMES
from chute_ros.tools.chute.json_text import json_text
from chute_ros.tools.chute.listening import Listening
from chute_ros.tools.chute.status_text import StatusLine, decision_lines, headline, order_lines


@pytest.fixture
def heard():
    return Heard()


def parachute_line(text):
    (line,) = [one for one in text if " 1/161 " in one]
    return line


def test_a_vehicle_in_flight(heard):
    rules = [
        RuleState(
            name="free fall",
            action=SafetyDecision.DEPLOY,
            alive=True,
            level=0.25,
            hold=0.5,
            conditions=["[x] acceleration 0.65 (below 2)", "[ ] tilt_deg 13.34 (above 45)"],
        ),
        RuleState(name="excess tilt", action=SafetyDecision.DEPLOY, alive=True, hold=0.25),
        RuleState(name="on the ground alone", action=SafetyDecision.KILL, hold=0.25),
        RuleState(name="autopilot lost", action=SafetyDecision.DEPLOY, conditions=["needs imu"]),
    ]
    told = {"decision_id": 3, "decision_action": 2, "decision_rule": "links"}
    unusable = ["attitude_error: never received", "tilt_deg: stuck", "age: never received"]
    heard.hears(stamped(state(rules=rules, unusable=unusable, **told)))
    heard.hears(stamped(parachute())).hears(vehicle())
    assert heard.text() == [
        "IN_FLIGHT",
        "  vehicle            /drone1, supervisor safety_supervisor, <1 s ago",
        "  mode               ACTIVE",
        "  flight             not blocked",
        "  cannot be used     tilt_deg: stuck",
        "  not measured       attitude_error, age",
        "links",
        "  mavlink_parachute  OK, device healthy, node <1 s ago",
        "parachutes",
        "  mavlink_parachute 1/161  ARMED, armed, not deployed, link OK, <1 s ago",
        "vehicle 1/1, link OK",
        "  arming state       ARMED, <1 s ago",
        "  landed state       IN_AIR, <1 s ago",
        "  height             61.2 m, <1 s ago",
        "  vertical speed     0.0 m/s, <1 s ago",
        "  battery            15.8 V, 87 %, 1 s ago",
        "rules: 2 of 4 active, 1 counting",
        "  free fall: DEPLOY, 0.2 of 0.5 s",
        "      [x] acceleration 0.65 (below 2)",
        "      [ ] tilt_deg 13.34 (above 45)",
        "  not counting: excess tilt",
        "  autopilot lost: needs imu",
        "newest decision: FLIGHT_BLOCK_RELEASE by rule 'links' (number 3)",
    ]
    assert heard.view().well


def test_a_vehicle_that_may_not_fly_tells_why(heard):
    blocked = state(
        state=SafetyState.BLOCKED,
        state_text="BLOCKED: no fuel",
        mode=SafetyState.SHADOW,
        flight_blocked=True,
        block_reasons=["no fuel"],
        device_blocks=["upf_can 33"],
        alarms=["the canopy was packed in 1999"],
        devices_healthy=[False],
        link_ages=[math.nan],
        link_states=[0],
    )
    heard.hears(stamped(blocked)).hears(
        stamped(heartbeat(age=math.nan, reasons=["voltage 2 (above 3)"]))
    )
    assert heard.text() == [
        "BLOCKED",
        "  vehicle            /drone1, supervisor safety_supervisor, <1 s ago",
        "  mode               SHADOW",
        "  ALARM              the canopy was packed in 1999",
        "  flight             BLOCKED",
        "                     no fuel",
        "                     blocked by device upf_can 33",
        "links",
        (
            "  mavlink_parachute  NEVER_SEEN, device NOT healthy, device never received, "
            "node never received: voltage 2 (above 3)"
        ),
        "parachutes",
        "  not received here within 0 s",
        "vehicle",
        "  not received here within 0 s",
        "rules: 0 of 0 active, none counting",
        "newest decision: none yet",
    ]
    assert not heard.view().well


@pytest.mark.parametrize(
    ("fields", "well"),
    [
        ({}, True),
        ({"state": SafetyState.READY}, True),
        ({"state": SafetyState.ARMED}, True),
        ({"state": SafetyState.LANDED}, True),
        ({"state": SafetyState.STARTUP}, False),
        ({"state": SafetyState.BLOCKED}, False),
        ({"state": SafetyState.KILLING}, False),
        ({"state": SafetyState.DEPLOYING}, False),
        ({"state": SafetyState.DEPLOYED}, False),
        ({"state": SafetyState.FAULT}, False),
        ({"state": 200}, False),
        ({"mode": SafetyState.SHADOW}, False),
        ({"mode": SafetyState.INHIBITED}, False),
        ({"alarms": ["anything"]}, False),
    ],
)
def test_a_script_takes_only_a_protected_vehicle_for_well(heard, fields, well):
    heard.hears(stamped(state(**fields)))
    assert heard.view().well is well


def test_without_a_supervisor_there_is_nothing_to_show(heard):
    heard.hears(vehicle())
    assert heard.view() is None
    assert order_lines("/drone1", None, "RELEASES it") == [
        "/drone1: NOT KNOWN, no supervisor is received",
        "this RELEASES it",
    ]


# Ages


def test_what_is_old_is_not_shown_as_if_it_were_now(heard):
    heard.hears(stamped(state(state=SafetyState.READY, state_text="READY")))
    heard.hears(stamped(parachute())).hears(vehicle())
    assert heard.text(at=2.0)[0] == "READY"
    text = heard.text(at=14.0)
    assert text[0] == "NOT KNOWN NOW (was READY, last word 14 s ago)"
    assert "  mavlink_parachute  OK, node OLD: 14 s ago" in text
    assert "  arming state       ARMED, OLD: 14 s ago" in text
    assert "  mavlink_parachute 1/161  ARMED, armed, not deployed, link OK, OLD: 14 s ago" in text
    assert not heard.view(14.0).well


def test_a_part_of_the_vehicle_that_was_never_received_says_so(heard):
    heard.hears(stamped(state()))
    heard.hears(vehicle(height_age=-1.0, armed_age=math.nan, vertical_speed=math.nan))
    text = heard.text()
    assert "  height             never received" in text
    assert "  arming state       never received" in text
    assert "  vertical speed     not known, <1 s ago" in text


def test_a_status_that_its_node_repeats_has_the_age_of_the_device(heard):
    """The parachute fell silent at t+0; its node repeats the status, and its clock is wrong."""
    heard.hears(stamped(state(), at=40.0), at=40.0)
    heard.hears(stamped(heartbeat(), at=40.0, clock=-3600.0), at=40.0)
    heard.hears(stamped(parachute(link_state=3), at=0.0, clock=-3600.0), at=40.0)
    assert heard.view(40.0).parachutes[0].age == pytest.approx(40.0)


def test_the_ages_of_a_node_and_of_its_silent_device_are_told_apart(heard):
    lost = {"link_states": [3], "devices_healthy": [False], "link_ages": [0.1]}
    heard.hears(stamped(state(**lost))).hears(stamped(heartbeat(age=7.9)))
    heard.hears(stamped(parachute(link_state=3), at=-7.9))
    text = heard.text(at=0.5)
    told = "LOST, device NOT healthy, device OLD: 8 s ago, node <1 s ago"
    assert f"  mavlink_parachute  {told}" in text
    assert parachute_line(text).endswith("link LOST, OLD: 8 s ago")


def test_an_output_that_says_nothing_is_told_to_be_written_and_not_received(heard):
    heard.hears(stamped(state())).hears(stamped(parachute(link_state=5)))
    assert parachute_line(heard.text()).endswith("link UNMONITORED, written <1 s ago")
    assert "armed and deployed not known: it tells nothing" in parachute_line(heard.text())


def test_a_status_without_a_stamp_is_of_a_device_that_was_never_received(heard):
    heard.hears(stamped(state())).hears(parachute(link_state=0))
    assert parachute_line(heard.text()).endswith("link NEVER_SEEN, never received")


def test_a_late_heartbeat_does_not_make_a_status_younger(heard):
    heard.hears(stamped(heartbeat(), at=0.0), at=0.0)
    heard.hears(stamped(heartbeat(), at=0.1), at=1.9)
    heard.hears(stamped(parachute(), at=0.0), at=1.9)
    heard.hears(stamped(state(), at=1.9), at=1.9)
    assert heard.view(2.0).parachutes[0].age == pytest.approx(2.0)


def test_the_first_state_may_have_waited_for_hours(heard):
    """It is latched, and its supervisor is silent: its stamp is believed."""
    heard.hears(stamped(state(), at=-7200.0))
    assert heard.text()[0] == "NOT KNOWN NOW (was IN_FLIGHT, last word 2 h ago)"


def test_a_host_with_another_clock_is_not_taken_for_silent(heard):
    """Its second word comes as it is sent; and its heartbeats show its clock at once."""
    heard.hears(stamped(state(), clock=-7200.0)).hears(
        stamped(state(), at=0.5, clock=-7200.0), 0.5
    )
    assert heard.view(0.6).age == pytest.approx(0.1)
    at_once = Heard().hears(stamped(state(), clock=-7200.0))
    at_once.hears(stamped(heartbeat("safety_supervisor"), at=0.1, clock=-7200.0), at=0.1)
    assert at_once.view(0.1).age == pytest.approx(0.1)
    assert at_once.picture.clock_difference("safety_supervisor") == pytest.approx(7200.0)


def test_the_supervisor_that_leads_is_believed_and_not_what_another_left(heard):
    """a led, b took over; a's latched state is received after b's."""
    heard.hears(stamped(state(supervisor="b", epoch=9, state=SafetyState.DEPLOYED)))
    heard.hears(stamped(state(supervisor="a", epoch=8), at=-30.0))
    assert (heard.view().supervisor, heard.view().state) == ("b", "DEPLOYED")
    # b is silent, and a has started again under a lower epoch, as after a lost clock.
    heard.hears(stamped(state(supervisor="a", epoch=3), at=5.0), at=5.0)
    assert heard.view(5.0).supervisor == "a"


# Decisions


def decision(**fields):
    return SafetyDecision(
        **{
            "epoch": 7,
            "id": 4,
            "action": SafetyDecision.DEPLOY,
            "rule": "free fall",
            "reasons": ["acceleration 0.65 (below 2)"],
            **fields,
        }
    )


def report(outcome):
    return ActionReport(
        epoch=7,
        id=4,
        action=SafetyDecision.DEPLOY,
        link="mavlink_parachute",
        outcome=outcome,
        detail="after 0.1 s",
    )


def test_a_decision_is_shown_once_with_its_reasons_and_its_newest_outcome(heard):
    heard.hears(stamped(state()))
    heard.hears(decision(id=3, action=SafetyDecision.KILL, rule="by hand", shadow=True))
    heard.hears(decision()).hears(decision(), at=0.1)
    heard.hears(report(ActionReport.SENT), 0.1).hears(report(ActionReport.CONFIRMED), 0.2)
    assert [line.text for line in decision_lines(heard.view(0.2).decisions, "decisions")] == [
        "decisions",
        "  DEPLOY by rule 'free fall', 0 s ago",
        "      acceleration 0.65 (below 2)",
        "      -> mavlink_parachute CONFIRMED: after 0.1 s",
        "  KILL in SHADOW, not sent, by rule 'by hand', 0 s ago",
        "      acceleration 0.65 (below 2)",
    ]


def test_whoever_comes_late_finds_the_newest_kill_and_deploy_with_their_reasons(heard):
    heard.hears(stamped(state()), at=60.0)
    for number, action in ((3, SafetyDecision.KILL), (4, SafetyDecision.DEPLOY)):
        heard.finds(stamped(decision(id=number, action=action), at=number / 10.0), at=60.0)
    # What blocks flight since then does not push them out.
    for number in range(5, 30):
        block = decision(id=number, action=SafetyDecision.FLIGHT_BLOCK, rule="links")
        heard.hears(block, at=60.0)
    text = heard.text(60.0)
    assert text[text.index("newest kill and deploy") :][:5] == [
        "newest kill and deploy",
        "  DEPLOY by rule 'free fall', 60 s ago",
        "      acceleration 0.65 (below 2)",
        "  KILL by rule 'free fall', 60 s ago",
        "      acceleration 0.65 (below 2)",
    ]


class ScriptedSession:
    """Whoever waits receives one message after the other, until what is waited for is there."""

    namespace = "/drone1"

    def __init__(self, heard, *messages):
        self.node, self._heard, self.left = self, heard, [*messages]

    def create_subscription(self, *_):
        """Nothing comes by itself."""

    def until(self, condition, seconds):
        while not condition() and self.left:
            self._heard.finds(self.left.pop(0))


def test_an_older_kill_is_not_shown_as_the_newest_while_the_newest_is_on_its_way(
    heard, monkeypatch
):
    """safety/history comes one by one, the oldest first."""
    past = [decision(id=3, action=SafetyDecision.KILL), decision(id=7), decision(id=8)]
    session = ScriptedSession(heard, *map(stamped, past))
    listening = Listening(session)
    listening.picture = heard.picture
    monkeypatch.setattr(listening_module.time, "monotonic", lambda: NOW)
    heard.hears(stamped(state(fired_id=8))).hears(heartbeat()).hears(stamped(parachute()))
    heard.hears(vehicle())
    assert "newest kill and deploy: number 8 was not received here yet; ask again" in heard.text()
    shown = listening.settle(5.0)
    assert session.left == []
    assert [one.id for one in shown.decisions] == [3, 7, 8]
    assert not any("not received here" in line for line in heard.text())


def test_a_decision_that_was_received_is_no_other_when_it_is_found_again(heard):
    heard.hears(stamped(state())).hears(decision(), at=0.0)
    heard.finds(stamped(decision()), at=30.0)
    assert [one.age for one in heard.view(30.0).decisions] == [30.0]


def test_the_age_of_what_is_found_is_by_the_supervisors_clock(heard):
    beat = heartbeat("safety_supervisor", supervisor=True)
    heard.hears(stamped(state(), clock=3600.0)).hears(stamped(beat, clock=3600.0))
    heard.finds(stamped(decision(), at=-20.0, clock=3600.0))
    assert [round(one.age) for one in heard.view().decisions] == [20]


# What a stranger may send


def test_names_that_a_stranger_invents_do_not_fill_the_memory(heard):
    heard.hears(stamped(state()), at=1.0)
    for number in range(10 * MOST_NAMES):
        heard.hears(stamped(heartbeat(f"link{number}")), at=0.001 * number)
        heard.hears(stamped(parachute(device=str(number))), at=0.001 * number)
    assert len(heard.picture.heartbeats) == MOST_NAMES
    assert len(heard.picture.parachutes) == MOST_NAMES
    assert heard.view(1.0).parachutes[-1].device in {str(n) for n in range(10 * MOST_NAMES)}


def test_arrays_of_different_lengths_and_numbers_without_a_name_are_shown(heard):
    odd = state(links=["a", "b"], link_states=[77], link_ages=[math.inf, 1.0], mode=99)
    heard.hears(stamped(odd)).hears(stamped(parachute(state=88, link_state=66)))
    heard.hears(vehicle(armed=55, height=math.inf, battery_voltage=-math.inf))
    text = "\n".join(heard.text())
    for number in (77, 99, 88, 66, 55):
        assert f"number {number}" in text


def test_json_has_null_for_what_is_no_number(heard):
    heard.hears(stamped(state(link_ages=[math.nan]))).hears(vehicle(height=math.inf))
    told = json.loads(json_text(heard.view()))
    assert told["state"] == "IN_FLIGHT"
    assert told["links"] == [
        {
            "name": "mavlink_parachute",
            "state": "OK",
            "age": None,
            "device_age": None,
            "device_healthy": True,
            "reasons": [],
        }
    ]
    assert told["vehicle"]["height"] is None
    assert told["well"] is True


# What warns


WARNS = RuleState(
    name="link lost", action=SafetyDecision.NONE, alive=True, fulfilled=True, latched=True
)


def unguarded():
    """It flies, its only link is lost, and its supervisor says so."""
    why = "no parachute can be reached: mavlink_parachute is LOST"
    return state(
        state_text=f"IN_FLIGHT, NOT GUARDED: {why}",
        alarms=["rule 'link lost' warns: nothing is received from a device", why],
        rules=[WARNS],
        link_states=[3],
        devices_healthy=[False],
    )


def test_a_vehicle_that_nobody_guards_says_so_in_its_first_line_and_is_not_well(heard):
    text = heard.hears(stamped(unguarded())).text()
    assert text[0] == "IN_FLIGHT, NOT GUARDED"
    assert text[3:6] == [
        "  why                no parachute can be reached: mavlink_parachute is LOST",
        "  ALARM              rule 'link lost' warns: nothing is received from a device",
        "  flight             not blocked",
    ]
    assert "  link lost: warns" in text
    picture = heard.view()
    assert (picture.well, picture.unguarded) == (False, True)
    assert [(one.action, one.does) for one in picture.rules] == [("ALARM", "warns")]


def test_an_alarm_alone_takes_the_calm_colour_away(heard):
    heard.hears(stamped(state(alarms=["rule 'battery dead' warns: it is empty"])))
    assert headline(heard.view()) == StatusLine("IN_FLIGHT", "warn")
    heard.hears(stamped(unguarded(), at=0.1), at=0.1)
    assert headline(heard.view(0.1)) == StatusLine("IN_FLIGHT, NOT GUARDED", "bad")


def test_the_mode_is_told_once(heard):
    told = "SHADOW: reports its decisions and sends none; IN_FLIGHT"
    text = heard.hears(stamped(state(state_text=told, mode=SafetyState.SHADOW))).text()
    assert [line for line in text if "SHADOW" in line] == ["  mode               SHADOW"]
