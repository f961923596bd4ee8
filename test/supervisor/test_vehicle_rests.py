"""Most updates are heartbeats: rules on the vehicle are looked at only where something changed."""

import math
from dataclasses import replace
from typing import Any

import pytest
from combinations import combinations
from story import LINK, START, TILTS, Story, falling, rule, shipped, with_rules

from chute_ros.model import Action, Armed, LinkState
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor import policy
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.conditions.link import LinkCondition
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.core import update
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.policy import rests_until
from chute_ros.supervisor.rules import Rule

LOST = AutopilotCondition(AutopilotFact.LOST)
DISARMED = AutopilotCondition(AutopilotFact.DISARMED)
ALARM = Action.NONE


class Compared(Story):
    """Each update is made once more by one that looks at all, and must come to the same."""

    def _update(self, inputs: tuple[i.Input, ...], t: float) -> list[i.Output]:
        before = replace(self.state, own=replace(self.state.own, vehicle_rests_until=-math.inf))
        outputs = super()._update(inputs, t)
        state, all_outputs = update(self.config, before, inputs, START + t)
        rested = replace(
            self.state,
            own=replace(self.state.own, vehicle_rests_until=state.own.vehicle_rests_until),
        )
        assert repr(rested) == repr(state)
        assert repr(tuple(outputs)) == repr(all_outputs)
        return outputs


@pytest.fixture
def looked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the rules that were looked at."""
    names: list[str] = []
    judge = policy.judge

    def noted(config: Any, state: Any, one: Rule, now: float) -> policy.JudgedRule:
        names.append(one.name)
        return judge(config, state, one, now)

    monkeypatch.setattr(policy, "judge", noted)
    return names


def flying(*rules: Rule) -> Story:
    return Story(with_rules(*rules)).flying().fly(1.0)


def test_a_heartbeat_looks_at_no_rule_that_rests_on_the_vehicle(looked):
    story = flying(
        rule(TILTS, name="tilts"),
        rule(LOST, TILTS, name="lost"),
        rule(DeviceCondition(DeviceFact.ABNORMAL), name="abnormal"),
        rule(LinkCondition(LINK, (LinkJudgement.LOST,)), name="link"),
        rule(AutopilotCondition(AutopilotFact.KILLED_ALOFT), TILTS, name="aloft"),
    )
    looked.clear()
    story.at(1.05, story.heartbeat())
    assert looked == ["abnormal", "link", "aloft"]
    looked.clear()
    story.at(1.1, story.told())
    assert looked == ["tilts", "lost", "abnormal", "link", "aloft"]


@pytest.mark.parametrize(
    "told",
    [
        pytest.param({"tilt": 90.0}, id="holds"),
        pytest.param({"tilt": math.nan}, id="cannot be said"),
    ],
)
def test_a_rule_that_holds_or_of_which_nothing_can_be_said_is_looked_at(looked, told):
    story = flying(rule(TILTS, action=ALARM, hold=60.0)).fly(1.1, tilt=90.0)
    story.fly(1.2, **told)
    looked.clear()
    story.at(1.21, story.heartbeat())
    assert "tested" in looked


def test_a_rule_that_was_acted_on_is_looked_at_until_it_is_done_with(looked):
    story = flying(rule(TILTS, action=ALARM)).fly(1.2, tilt=90.0).fly(1.4)
    assert story.state.rule("tested").latched
    looked.clear()
    story.at(1.45, story.heartbeat())
    assert looked == ["tested"]


def test_a_rule_that_has_just_come_to_life_is_looked_at(looked):
    states = (Stage.KILLING,)
    story = flying(rule(TILTS, states=states))
    looked.clear()
    story.at(1.05, story.heartbeat(), i.KillRequest(1, "operator", "x"))
    assert looked == ["tested"]


@pytest.mark.parametrize(
    ("part", "after"), [("tilt", 0.5), ("vertical_speed", 1.0), ("battery_remaining", 10.0)]
)
def test_time_alone_makes_what_was_measured_too_old(part, after):
    story = Story(with_rules()).flying()
    told = story.told().state
    story.at(0.5, i.VehicleReport(told))
    others = {"tilt": math.nan, "vertical_speed": math.nan, "height": math.nan}
    others |= {"acceleration": math.nan, "battery_remaining": math.nan}
    only = replace(told, latitude=math.nan, **{**others, part: getattr(told, part)})
    story = Story(with_rules(vehicle_state_age=60.0)).flying()
    story.at(0.5, i.VehicleReport(only))
    until = rests_until(story.config, story.state, START + 0.5)
    assert until == pytest.approx(START + 0.5 + after, abs=1e-5)
    assert until < START + 0.5 + after


@pytest.mark.parametrize(("armed_age", "after"), [(0.0, 2.5), (1.0, 1.5), (-1.0, 2.5)])
def test_time_alone_makes_what_it_says_of_itself_too_old(armed_age, after):
    story = Story(with_rules()).flying()
    said = replace(story.told().state, armed_age=armed_age)
    gone = {"tilt": math.nan, "vertical_speed": math.nan, "height": math.nan}
    gone |= {"acceleration": math.nan, "battery_remaining": math.nan, "battery_voltage": math.nan}
    story.at(0.5, i.VehicleReport(replace(said, latitude=math.nan, **gone)))
    until = rests_until(story.config, story.state, START + 0.5)
    assert until == pytest.approx(START + 0.5 + after, abs=1e-5)
    # What has passed is not waited for.
    later = rests_until(story.config, story.state, START + 0.5 + after + 0.1)
    assert later > START + 0.5 + after + 0.05


def story_of(profile: str) -> Compared:
    return Compared(shipped(profile)).flying().fly(1.0)  # type: ignore[return-value]


def heartbeats(story: Story, until: float) -> Story:
    while story.t < until - 1e-9:
        story.at(story.t + 0.03, story.heartbeat())
    return story


NAMES = ("multirotor", "fixed_wing", "rocket", "by_hand")
PROFILES = pytest.mark.parametrize("profile", NAMES)


@PROFILES
def test_a_fall_is_judged_the_same(profile):
    story = story_of(profile)
    story.fall(3.0, 300.0, tilt=100.0)
    heartbeats(story, 5.0)
    story.fly(6.0)


@pytest.mark.parametrize(
    ("profile", "gone"),
    combinations(NAMES, ["tilt", "acceleration", "vertical_speed", "height", "battery_remaining"]),
)
def test_a_fall_with_a_measurement_that_ends_in_it_is_judged_the_same(profile, gone):
    story = story_of(profile)
    story.fall(1.3, 300.0, tilt=30.0)
    for value, until in ((math.nan, 2.6), (0.0, 4.0)):
        for step in range(26):
            told = {**falling(step * 0.05, 290.0), "tilt": 100.0, gone: value}
            story.at(story.t + 0.05, story.heartbeat(), story.told(**told))
        heartbeats(story, until + 0.7)
    heartbeats(story, 16.0)


@PROFILES
def test_an_autopilot_that_is_lost_starts_anew_or_disarms_is_judged_the_same(profile):
    story = story_of(profile)
    story.fly(2.0, link_state=LinkState.LOST)
    heartbeats(story, 5.0)
    story.fly(5.5, reboot_count=1, rebooted_in_flight=True, height=3.0)
    heartbeats(story, 6.0)
    story.fly(6.5, armed=Armed.DISARMED, system_status=8)
    heartbeats(story, 7.0)
    story.fly(8.0, tilt=80.0, reboot_count=1, rebooted_in_flight=True)
    heartbeats(story, 9.0)


def test_measurements_from_the_future_are_judged_the_same():
    story = story_of("multirotor")
    for step in range(40):
        told = story.told(tilt=100.0, vertical_speed=-9.0).state
        ahead = replace(told, attitude_age=-0.5 + 0.02 * step, vertical_speed_age=-0.3)
        story.at(story.t + 0.05, story.heartbeat(), i.VehicleReport(ahead))
        heartbeats(story, story.t + 0.06)
    heartbeats(story, 8.0)


def test_at_the_very_moment_at_which_something_turns_too_old_it_is_looked_at():
    story = Story(with_rules()).flying().fly(1.0)
    known = story.state.measured("tilt_deg")
    turns = known.measured_at + story.config.profile.limits["tilt_deg"].max_age
    assert rests_until(story.config, story.state, turns) < turns


def test_what_may_come_to_hold_by_silence_wakes_beside_what_others_wait_for():
    counts = rule(TILTS, name="counts", hold=0.7)
    unknown = MeasurementCondition("acceleration", below=1.0, if_unknown=True)
    silent = rule(unknown, MeasurementCondition("tilt_deg", above=80.0), name="silent")
    story = Story(with_rules(counts, silent)).flying().fly(1.0).fly(1.1, tilt=70.0)
    deadlines = policy.rule_deadlines(story.config, story.state, START + 1.1)
    acceleration = story.state.measured("acceleration").measured_at
    assert any(one == pytest.approx(acceleration + 0.5) for one in deadlines)
    level = story.state.rule("counts").level
    assert any(one == pytest.approx(START + 1.1 + 0.7 - level) for one in deadlines)
