"""Each condition holds, does not hold, or cannot be said, with its value and limit in words."""

import math
from dataclasses import fields, is_dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import pytest
from story import LINK, SINKS, START, Story, changed, parachute, rule, vehicle, with_rules

from chute_ros.model import Armed, LinkState, ParachuteState, ParachuteStatus
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions import CONDITIONS
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.base import JUST_AFTER, Condition, Finding
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.conditions.link import LinkCondition
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkEvidence, LinkJudgement, LinkLimits
from chute_ros.supervisor.measured import Measured
from chute_ros.supervisor.pending import ASK_LASTS
from chute_ros.supervisor.record import CODEC
from chute_ros.supervisor.rules import Profile
from chute_ros.supervisor.state import HeardHere, State
from chute_ros.supervisor.yaml_lines import ALL, ANY


class Told(NamedTuple):
    """As a Finding."""

    holds: bool | None
    text: str
    samples: int = -1


def told(config: SupervisorConfig, state: State, condition: Condition, now: float) -> Told:
    """Look at a condition, and ask for the words."""
    found = condition.find(config, state, now)
    return Told(found.holds, found.text, found.samples)


LINKS = ("a", "b")
TWO = SupervisorConfig((LINK, "upf_can"), deploy_links=(LINK, "upf_can"))


def look(story: Story, condition: Condition) -> Told:
    return told(story.config, story.state, condition, START + story.t)


# -- measurements --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("above", "below", "value", "holds", "words"),
    [
        (math.nan, -12.0, -12.01, True, "vertical_speed -12.01 (below -12)"),
        (math.nan, -12.0, -12.0, False, "vertical_speed -12.00 (below -12)"),
        (8.0, math.nan, 8.01, True, "vertical_speed 8.01 (above 8)"),
        (8.0, math.nan, 8.0, False, "vertical_speed 8.00 (above 8)"),
        (-3.0, 3.0, 0.0, True, "vertical_speed 0.00 (above -3 and below 3)"),
        (-3.0, 3.0, 3.0, False, "vertical_speed 3.00 (above -3 and below 3)"),
        (-3.0, 3.0, -3.0, False, "vertical_speed -3.00 (above -3 and below 3)"),
    ],
)
def test_a_measurement_holds_beyond_its_limit_not_at_it(above, below, value, holds, words):
    story = Story()
    story.at(0.0, vehicle(vertical_speed=value))
    found = look(story, MeasurementCondition("vertical_speed", above, below))
    assert found == Told(holds, words, samples=1)


def test_what_cannot_be_used_says_nothing_about_the_vehicle():
    story = Story()
    story.at(0.0)
    assert look(story, SINKS).holds is None
    assert "vertical_speed cannot be used: never received" in look(story, SINKS).text
    story.at(0.1, vehicle(vertical_speed=-30.0))
    assert look(story, SINKS).holds
    story.at(1.2)
    assert look(story, SINKS).holds is None
    assert "old: 1.10 s (limit 1 s) (asked for: below -12)" in look(story, SINKS).text


# -- links ---------------------------------------------------------------------------------------

LOST = (LinkJudgement.LOST,)


def test_a_link_that_is_still_starting_is_not_held_against_it():
    story = Story(TWO)
    story.at(5.0, story.heartbeat(LINK))
    never = LinkCondition(ANY, (LinkJudgement.NEVER_SEEN,))
    assert not look(story, never).holds
    assert "upf_can is still starting" in look(story, never).text
    story.at(10.0)
    assert look(story, never).holds


# -- the autopilot -------------------------------------------------------------------------------


def autopilot(story: Story, fact: AutopilotFact) -> Told:
    return look(story, AutopilotCondition(fact))


def test_an_autopilot_that_was_never_heard_is_not_lost():
    story = Story()
    story.at(60.0)
    assert autopilot(story, AutopilotFact.LOST) == Told(None, "vehicle/state never received")


def test_an_autopilot_is_lost_when_its_state_stops_or_its_link_says_so():
    story = Story()
    story.at(0.0, vehicle(link_state=LinkState.OK))
    story.at(2.5)
    assert autopilot(story, AutopilotFact.LOST).holds is False
    story.at(2.51)
    assert autopilot(story, AutopilotFact.LOST) == Told(
        True, "autopilot link OK, vehicle/state 2.51 s old (lost after 2.5 s)"
    )
    story.at(3.0, vehicle(link_state=LinkState.LOST))
    assert autopilot(story, AutopilotFact.LOST).holds is True


def test_an_autopilot_that_says_disarmed_must_say_so_freshly():
    story = Story()
    story.at(0.0, vehicle(armed=Armed.DISARMED))
    assert autopilot(story, AutopilotFact.DISARMED) == Told(True, "autopilot says DISARMED")
    story.at(2.6)
    assert autopilot(story, AutopilotFact.DISARMED) == Told(False, "autopilot says UNKNOWN")


@pytest.mark.parametrize(
    ("status", "holds"), [(0, False), (4, False), (5, False), (6, True), (7, False), (8, True)]
)
def test_an_autopilot_that_terminates_says_so_and_counts_up_to_its_age(status, holds):
    story = Story()
    story.at(0.0, vehicle(system_status=status))
    for t in (0.0, 2.5):
        story.at(t)
        found = autopilot(story, AutopilotFact.EMERGENCY)
        assert found == Told(holds, f"autopilot's own state is {status} (6 or 8)")
    story.at(2.6)
    old = Told(None, "autopilot's own state is old")
    assert autopilot(story, AutopilotFact.EMERGENCY) == old


def test_an_autopilot_that_restarts_counts_in_flight_only():
    story = Story().ready()
    story.at(0.1, story.told(armed=Armed.DISARMED, reboot_count=1, rebooted_in_flight=True))
    assert autopilot(story, AutopilotFact.REBOOTED).holds is False
    story.fly(1.0, reboot_count=1, rebooted_in_flight=True)
    assert autopilot(story, AutopilotFact.REBOOTED).holds is False, "it was counted before"
    story.fly(1.1, reboot_count=2, rebooted_in_flight=True)
    found = autopilot(story, AutopilotFact.REBOOTED)
    assert found == Told(True, "autopilot restarts in flight 1")
    assert story.said().count("the autopilot restarted in flight") == 1


# -- devices -------------------------------------------------------------------------------------


def device(story: Story, fact: DeviceFact, link: str = ANY) -> Told:
    return look(story, DeviceCondition(fact, link))


def test_a_device_that_asks_for_a_kill_wants_it_for_a_second():
    story = Story(TWO)
    story.at(0.0, i.KillRequest(0, "upf_can 33", "about to launch"))
    found = device(story, DeviceFact.ASKS_FOR_KILL)
    assert found == Told(True, "upf_can 33: about to launch")
    assert device(story, DeviceFact.ASKS_FOR_KILL, "upf_can").holds
    assert not device(story, DeviceFact.ASKS_FOR_KILL, LINK).holds
    story.at(1.1)
    assert device(story, DeviceFact.ASKS_FOR_KILL) == Told(False, "no device asks for a kill")
    story.at(2.0, i.KillRequest(0, "stranger 9", "fire"), i.KillRequest(0, "b 2", "smoke"))
    found = device(story, DeviceFact.ASKS_FOR_KILL)
    assert found == Told(True, "stranger 9: fire; b 2: smoke"), "also one that is not ours"
    for t, holds in ((2.0 + ASK_LASTS - 0.01, True), (2.0 + ASK_LASTS, False)):
        story.at(t)
        assert device(story, DeviceFact.ASKS_FOR_KILL).holds is holds


def test_parachutes_that_are_out_are_named_with_their_link():
    story = Story(SupervisorConfig(deploy_links=(LINK, "upf_can"))).flying()
    assert device(story, DeviceFact.DEPLOYED) == Told(False, "no parachute is out")
    out = [parachute("upf_can", name, deployed=True) for name in ("33", "34")]
    story.at(0.1, story.heartbeat("upf_can"), *out)
    found = device(story, DeviceFact.DEPLOYED)
    assert found == Told(True, "upf_can 33, upf_can 34: its own status says deployed")
    assert not device(story, DeviceFact.DEPLOYED, LINK).holds


def test_a_device_that_is_abnormal_says_why():
    story = Story(TWO)
    broken = ParachuteStatus("33", LinkState.OK, ParachuteState.ABNORMAL, faults=("POD", "IMU"))
    silent = ParachuteStatus("34", LinkState.OK, ParachuteState.ABNORMAL)
    story.at(0.0, story.heartbeat("upf_can"), i.ParachuteReport("upf_can", broken))
    assert device(story, DeviceFact.ABNORMAL) == Told(True, "upf_can 33 is ABNORMAL (POD; IMU)")
    story.at(0.1, i.ParachuteReport("upf_can", silent))
    assert "upf_can 34 is ABNORMAL (no reason given)" in device(story, DeviceFact.ABNORMAL).text
    assert not device(story, DeviceFact.ABNORMAL, LINK).holds
    story.at(1.1)
    assert device(story, DeviceFact.ABNORMAL) == Told(False, "no device is ABNORMAL")


# -- which of them are only silence --------------------------------------------------------------


@pytest.mark.parametrize(
    ("condition", "silence"),
    [
        (LinkCondition(ANY, LOST), True),
        (LinkCondition(LINK, (LinkJudgement.OK,)), True),
        (AutopilotCondition(AutopilotFact.LOST), True),
        (AutopilotCondition(AutopilotFact.REBOOTED), False),
        (AutopilotCondition(AutopilotFact.DISARMED), False),
        (AutopilotCondition(AutopilotFact.EMERGENCY), False),
        (DeviceCondition(DeviceFact.DEPLOYED), False),
        (SINKS, False),
    ],
)
def test_what_tells_only_that_somebody_is_not_heard(condition, silence):
    assert condition.is_silence is silence


# -- k of n with weights -------------------------------------------------------------------------

TILT = MeasurementCondition("tilt_deg", above=60.0)
FALLS = MeasurementCondition("acceleration", below=2.0)
HEAVY = MeasurementCondition("height", above=500.0, weight=2.0)


@pytest.mark.parametrize(
    ("told", "fires"),
    [
        ({}, False),
        ({"tilt": 61.0}, False),
        ({"acceleration": 1.0}, False),
        ({"tilt": 61.0, "acceleration": 1.0}, True),
        ({"height": 501.0}, True),
        ({"height": 501.0, "tilt": 61.0, "acceleration": 1.0}, True),
    ],
)
def test_the_weights_of_those_that_hold_must_reach_what_is_needed(told, fires):
    story = Story(with_rules(rule(TILT, FALLS, HEAVY, needed=2.0))).flying()
    story.fly(0.2, **{"height": 499.0, **told})
    assert bool(story.fired()) is fires


PATIENT = LinkLimits(stale_after=50.0, lost_after=100.0)
CONFIG = SupervisorConfig(required_links=LINKS, kill_links=LINKS, deploy_links=LINKS)
NOW = 100.0
SILENT = (LinkJudgement.STALE, LinkJudgement.LOST)


def state(**known: Any) -> State:
    return changed(State(epoch=7, started_at=0.0), **known)


def links(**evidence: LinkEvidence) -> MappingProxyType[str, LinkEvidence]:
    return MappingProxyType(evidence)


def heard(ago: float, *devices: ParachuteStatus) -> LinkEvidence:
    told = MappingProxyType({one.device: one for one in devices})
    return LinkEvidence(heard=NOW - ago, reported=LinkState.OK, devices=told)


def test_only_those_that_hold_are_told_as_reasons_and_what_cannot_be_said_does_not():
    story = Story(with_rules(rule(TILT, FALLS, HEAVY, needed=2.0, hold=0.1))).flying()
    story.fly(0.3, tilt=61.0, acceleration=math.nan)
    assert story.fired() == []
    story.fly(0.6, tilt=61.0, acceleration=1.0)
    reasons = "; ".join(story.decisions()[-1].reasons)
    assert "tilt_deg 61.00 (above 60); acceleration 1.00 (below 2); counter 0.10 s of 0.1 s" in (
        reasons
    )
    assert "height" not in reasons


# -- at their limits -----------------------------------------------------------------------------


def test_samples_that_cannot_be_used_were_seen_all_the_same():
    old = Measured(value=70.0, measured_at=NOW - 9.0, same_since=NOW - 9.0, count=4)
    known = state(measurements=MappingProxyType({"tilt_deg": old}))
    found = told(CONFIG, known, MeasurementCondition("tilt_deg", above=60.0), NOW)
    assert (found.holds, found.samples) == (None, 4)


def test_every_link_is_told_with_what_was_asked_for_and_judged_by_its_own_limits():
    known = state(links=links(a=heard(0.2), b=heard(5.0)))
    text = (
        "link a is OK, last received 0.20 s ago, b is LOST, last received 5.00 s ago "
        "(asked for: STALE or LOST)"
    )
    assert told(CONFIG, known, LinkCondition(ANY, SILENT), NOW) == Told(True, text)
    assert told(CONFIG, known, LinkCondition(ALL, SILENT), NOW) == Told(False, text)
    assert told(CONFIG, known, LinkCondition(ALL, SILENT), NOW + 9.0).holds is True
    one = "link b is LOST, last received 5.00 s ago (asked for: LOST)"
    assert told(CONFIG, known, LinkCondition("b", LOST), NOW) == Told(True, one)
    assert told(CONFIG, known, LinkCondition("a", LOST), NOW).holds is False
    either = LinkCondition("a", (LinkJudgement.LOST, LinkJudgement.OK))
    assert told(CONFIG, known, either, NOW).holds is True
    patient = SupervisorConfig(required_links=LINKS, link_limits=MappingProxyType({"b": PATIENT}))
    assert told(patient, known, LinkCondition(ANY, SILENT), NOW).holds is False


def test_one_that_is_still_starting_does_not_hide_the_next():
    known = State(epoch=7, started_at=NOW - 1.0, heard=HeardHere(links=links(b=heard(5.0))))
    found = told(CONFIG, known, LinkCondition(ANY, SILENT), NOW)
    assert found.holds is True
    assert found.text.startswith("link a is still starting, b is LOST")


def test_all_that_are_abnormal_are_told_each_within_the_limits_of_its_link():
    wrong = [
        ParachuteStatus("1", LinkState.OK, ParachuteState.ABNORMAL, faults=("hot",)),
        ParachuteStatus("2", LinkState.OK, ParachuteState.ABNORMAL),
    ]
    known = state(links=links(a=heard(5.0, *wrong)))
    config = SupervisorConfig(required_links=LINKS, link_limits=MappingProxyType({"a": PATIENT}))
    abnormal = DeviceCondition(DeviceFact.ABNORMAL)
    text = "a 1 is ABNORMAL (hot); a 2 is ABNORMAL (no reason given)"
    assert told(config, known, abnormal, NOW) == Told(True, text)
    assert told(CONFIG, known, abnormal, NOW) == Told(False, "no device is ABNORMAL")


def test_a_speed_that_is_told_by_the_heights_has_their_samples():
    height = Measured(value=30.0, measured_at=NOW, same_since=NOW, count=7)
    known = state(
        measurements=MappingProxyType({"height": height}), heights=((NOW - 1.0, 50.0), (NOW, 30.0))
    )
    found = told(CONFIG, known, MeasurementCondition("vertical_speed", below=-12.0), NOW)
    assert (found.holds, found.samples) == (True, 7)


@pytest.mark.parametrize(
    ("minimum", "speed", "holds", "words"),
    [
        (50.0, math.nan, True, "(minimum 50 m), and nothing reports whether it falls"),
        (50.1, math.nan, False, "(minimum 50.1 m), and nothing reports whether it falls"),
        (50.0, -4.0, False, "(minimum 50 m), and something reports whether it falls"),
    ],
)
def test_a_kill_aloft_is_told_with_what_is_left_of_the_height(minimum, speed, holds, words):
    config = SupervisorConfig(profile=Profile("tested", (), minimum_height=minimum))
    told_speed = {} if math.isnan(speed) else {"vertical_speed": Measured(speed, NOW, NOW, 1)}
    known = state(
        killed_in_flight=True,
        killed_at=NOW - 2.0,
        # What a body loses in 2 s.
        killed_height=50.0 + 9.81 / 2.0 * 4.0,
        killed_sinking=0.0,
        vehicle_received=NOW - 1.0,
        measurements=MappingProxyType(told_speed),
        links=MappingProxyType({one: LinkEvidence(heard=NOW) for one in config.kill_links}),
    )
    found = told(config, known, AutopilotCondition(AutopilotFact.KILLED_ALOFT), NOW)
    assert found == Told(holds, f"killed aloft 2.00 s ago, at least 50.0 m are left {words}")


#: What a kind of condition says of itself, written once more.
OWN: dict[str, Any] = {
    "weight": 1.0,
    "is_silence": False,
    "parse": classmethod(lambda cls, *_: cls()),
    "find": lambda *_: Finding(True, str),
    "deadlines": lambda *_: (),
}


def test_one_that_says_all_of_itself_can_be_made():
    made = type("Whole", (Condition,), OWN)()
    assert made.counted
    assert [made.measured, made.rests_on_the_vehicle, made.goes_on] == [(), False, False]


@pytest.mark.parametrize("missing", OWN)
def test_one_that_forgets_something_cannot_be_made(missing):
    kind = type("Half", (Condition,), {key: OWN[key] for key in OWN if key != missing})
    with pytest.raises(TypeError, match=missing):
        kind()


@pytest.mark.parametrize(("key", "kind"), CONDITIONS.items())
def test_every_kind_is_read_under_its_key_and_kept_in_the_black_box(key, kind):
    assert kind.key == key
    assert is_dataclass(kind)
    assert {"weight"} <= {one.name for one in fields(kind)}
    assert CODEC._classes[kind.__name__] is kind


@pytest.mark.parametrize("fact", AutopilotFact)
def test_every_fact_of_the_autopilot_is_found_and_waited_for(fact):
    story, one = Story().flying(), AutopilotCondition(fact)
    now = START + story.t
    assert one.find(story.config, story.state, now).text
    received = story.state.heard.vehicle_received + story.config.vehicle_state_age + JUST_AFTER
    assert received in one.deadlines(story.config, story.state, None, False, now)


def test_the_end_of_a_wish_is_waited_for_by_the_rule_that_looks_at_it():
    asked = DeviceCondition(DeviceFact.ASKS_FOR_KILL)
    story = Story(with_rules()).flying()
    story.at(1.0, i.KillRequest(0, "upf_can 33", "smoke"))
    (ask,) = story.state.asks.values()
    assert ask.ends_at == START + 2.0
    deadlines = asked.deadlines(story.config, story.state, True, False, START + 1.0)
    assert list(deadlines) == [START + 2.0]
    for fact in (DeviceFact.DEPLOYED, DeviceFact.ABNORMAL):
        other = replace(asked, fact=fact)
        assert not list(other.deadlines(story.config, story.state, True, False, START + 1.0))
