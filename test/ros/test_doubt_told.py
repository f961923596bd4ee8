"""What a measurement in doubt, and a parachute that is armed, look like in diagnostics and
safety/state."""

from dataclasses import replace
from types import MappingProxyType

import pytest
from builtin_interfaces.msg import Time
from chute_msgs.msg import SafetySummary
from diagnostic_msgs.msg import DiagnosticStatus

from chute_ros.model import Armed, LinkState, ParachuteStatus, VehicleState
from chute_ros.ros.supervisor_messages import decisions_task, state_message, summary_message
from chute_ros.ros.supervisor_parameters import PARAMETERS, config_from
from chute_ros.runtime.topics import safety_told
from chute_ros.supervisor.link_evidence import LinkEvidence
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import Measured
from chute_ros.supervisor.state import Alarms, HeardHere, State

NOW = 100.0
CONFIG = config_from({parameter.name: parameter.default for parameter in PARAMETERS})
WELL = LinkEvidence(heard=NOW, reported=LinkState.OK, device_healthy=True)


def known(**doubts: float) -> State:
    """In flight on its side, by an attitude that is known as well as this."""
    tilt = Measured(value=90.0, measured_at=NOW, same_since=NOW, count=9, **doubts)
    carried = Measured(value=9.8, measured_at=NOW, same_since=NOW, count=9)
    told = MappingProxyType({"tilt_deg": tilt, "acceleration": carried})
    return State(
        epoch=1,
        started_at=0.0,
        stage=Stage.IN_FLIGHT,
        heard=HeardHere(
            links=MappingProxyType(dict.fromkeys(CONFIG.links, WELL)),
            vehicle=VehicleState(link_state=LinkState.OK, armed=Armed.ARMED, armed_age=0.0),
            vehicle_received=NOW,
            measurements=told,
        ),
    )


def values(status: DiagnosticStatus) -> dict[str, str]:
    return {one.key: one.value for one in status.values}


def test_a_measurement_in_doubt_says_why_beside_its_value():
    sound = decisions_task("safety_supervisor", CONFIG, known(), NOW)
    assert (sound.level, values(sound)["tilt_deg"]) == (DiagnosticStatus.OK, "90.00")
    doubted = decisions_task("safety_supervisor", CONFIG, known(jumped_at=NOW - 2.0), NOW)
    assert values(doubted)["tilt_deg"] == "90.00 (in doubt: it jumped 2.0 s ago)"


def test_sources_that_contradict_each_other_are_a_warning_with_the_part_named():
    state = replace(known(), heard=replace(known().heard, disputed=frozenset({"attitude"})))
    task = decisions_task("safety_supervisor", CONFIG, state, NOW)
    assert task.level == DiagnosticStatus.WARN
    text = "IN_FLIGHT: attitude in doubt, as the vehicle's sources contradict each other"
    assert text in task.message
    assert values(task)["sources contradict each other"] == "attitude"
    assert values(task)["tilt_deg"] == "90.00 (in doubt: another source reported otherwise)"
    told = safety_told(CONFIG, "", state, {}, NOW)
    assert text in state_message(CONFIG, told, Time()).state_text


ARMED = ParachuteStatus("1/161", LinkState.OK, armed=True)


@pytest.mark.parametrize(
    ("stage", "armed", "text"),
    [
        (Stage.READY, True, "READY; ARMED all the same: {} (safety/arm disarms)"),
        (Stage.LANDED, True, "LANDED; ARMED all the same: {} (safety/arm disarms)"),
        (Stage.ARMED, True, "ARMED"),
        (Stage.IN_FLIGHT, True, "IN_FLIGHT"),
        (Stage.READY, False, "READY"),
    ],
)
def test_a_parachute_that_is_armed_is_told_in_every_state_on_the_ground(stage, armed, text):
    state, link = known(), CONFIG.deploy_links[0]
    evidence = replace(WELL, devices=MappingProxyType({"1/161": replace(ARMED, armed=armed)}))
    links = MappingProxyType({**state.heard.links, link: evidence})
    state = replace(state, stage=stage, heard=replace(state.heard, links=links))
    state = replace(state, last_armed=frozenset({(link, "1/161")} if armed else ()))
    told = state_message(CONFIG, safety_told(CONFIG, "", state, {}, NOW), Time()).state_text
    assert told == text.format(f"{link} 1/161")
    assert decisions_task("safety_supervisor", CONFIG, state, NOW).message.endswith(told)


def test_the_summary_is_the_same_in_a_few_fields():
    state, (link,) = known(), CONFIG.links
    armed = replace(WELL, devices=MappingProxyType({"1/161": ARMED}))
    state = replace(
        state,
        stage=Stage.BLOCKED,
        heard=replace(state.heard, links=MappingProxyType({link: armed})),
        released_since_reset=frozenset({(link, "1/162")}),
        last_armed=frozenset({(link, "1/161")}),
        alarming=Alarms(alarms=("one", "two")),
    )
    told = safety_told(CONFIG, "supervisor", state, {}, NOW)
    whole = state_message(CONFIG, told, Time(sec=5))
    summary = summary_message(CONFIG, told, whole)
    assert (summary.header.stamp.sec, summary.supervisor) == (5, "supervisor")
    assert (summary.state, summary.state_name) == (SafetySummary().state + 1, "BLOCKED")
    assert summary.text == whole.state_text
    assert summary.text.startswith(f"BLOCKED: {link} 1/162 was released")
    assert not summary.flight_blocked, "it was not sent yet"
    assert (summary.armed, summary.released) == ([f"{link} 1/161"], [f"{link} 1/162"])
    assert (summary.links_ok, summary.links, summary.alarms) == (1, 1, 2)
    silent = replace(state, heard=replace(state.heard, links=MappingProxyType({})))
    assert summary_message(CONFIG, replace(told, state=silent), whole).links_ok == 0
