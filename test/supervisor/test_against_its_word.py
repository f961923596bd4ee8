"""Accidents that begin with something that was wrong before: a word, a restart, a gap."""

import math
import random
from dataclasses import replace
from typing import Any

import pytest
from story import LINK, START, Story, falling, parachute, rule, shipped, vehicle, with_rules

from chute_ros.model import Action, Armed, LandedState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.core import update
from chute_ros.supervisor.machine import Stage

K, D = Action.KILL, Action.DEPLOY
TILT = rule(MeasurementCondition("tilt_deg", above=60.0), hold=0.3, samples=3)
GROUND = LandedState.ON_GROUND


def given(story: Story, one: i.Input) -> None:
    """An input that the node makes of its lease, not of a message."""
    story.state, outputs = update(story.config, story.state, (one,), START + story.t)
    story.outputs += [(story.t, output) for output in outputs]


def aloft(profile: str = "multirotor") -> Story:
    """In flight for two seconds."""
    return Story(shipped(profile)).flying().fly(2.0)


def test_one_that_steps_down_with_a_deploy_ordered_fires_it_when_it_leads_again():
    story = Story(with_rules(TILT, standby=True)).flying().fly(1.0).fly(1.5, tilt=90.0)
    assert story.fired() == ["KILL"]
    given(story, i.StepDown("overslept"))
    story.fly(2.0, tilt=90.0)
    assert story.fired() == ["KILL"], "nobody else is there, and this one only looks on"
    given(story, i.TakeOver(11))
    story.fly(3.0, tilt=90.0)
    assert "DEPLOY" in story.fired()


OFF: dict[str, Any] = {"landed_state": GROUND, "armed": Armed.DISARMED}


@pytest.mark.parametrize("off", [{"landed_state": GROUND, "tilt": 90.0}, OFF])
def test_a_landed_state_that_was_wrong_in_a_hover_does_not_veto_the_fall_after_it(off):
    """Nor one after which the autopilot disarmed by itself."""
    disarms = "armed" in off
    story = aloft().fly(8.0, landed_state=GROUND)
    story.fly(8.2, **(off if disarms else {"landed_state": GROUND}))
    assert story.state.stage is (Stage.READY if disarms else Stage.LANDED)
    assert story.fall(10.5, **off).fired()[:2] == ["KILL", "DEPLOY"]


def test_what_it_said_before_a_persons_kill_is_not_its_effect_but_one_that_falls_then_is():
    lies: dict[str, Any] = {"vertical_speed": 0.0, "acceleration": 9.8, "tilt": 70.0, **OFF}
    for before, falls in ((lies, False), ({"landed_state": GROUND}, True)):
        story = aloft().fly(2.4, **before)
        story.at(2.4, i.KillRequest(5, "operator", "it lies on its side"))
        story.at(2.45, story.report(K, Outcome.CONFIRMED))
        story = story.fall(5.0, **OFF) if falls else story.fly(6.0, **lies)
        assert story.fired()[:2] == ["KILL", "DEPLOY"][: 1 + falls]


@pytest.mark.parametrize(
    ("before", "told"),
    [({}, {"acceleration": 0.0}), ({"vertical_speed": math.nan}, {"height": 36.0})],
    ids=["a force that reads nothing", "one step of a height"],
)
def test_one_sensor_that_is_wrong_in_a_hover_deploys_nothing(before, told):
    story = aloft().fly(3.0, height=50.0, **before).fly(6.0, **{"height": 50.0, **before, **told})
    assert story.fired() == []


@pytest.mark.parametrize(("height", "believed_after"), [(50.0, 5.0), (9.0, 1.0)])
def test_one_that_says_so_high_above_its_take_off_must_say_it_for_longer(height, believed_after):
    story = Story(shipped("multirotor")).flying().fly(2.0, height=height)
    story.fly(2.0 + believed_after - 0.1, height=height, landed_state=GROUND)
    assert story.state.stage is Stage.IN_FLIGHT
    story.fly(2.0 + believed_after + 0.15, height=height, landed_state=GROUND)
    assert story.state.stage is Stage.LANDED


@pytest.mark.parametrize(
    "said",
    [{"landed_state": GROUND}, {"landed_state": LandedState.IN_AIR, "armed": Armed.DISARMED}],
)
def test_a_supervisor_that_starts_in_the_middle_of_a_fall_sees_it(said):
    story = Story(shipped("multirotor"))
    story.fall(3.0, tilt=90.0, **said)
    assert story.fired()[:2] == ["KILL", "DEPLOY"]


@pytest.mark.parametrize(
    "wrong", [{"vertical_speed": -12.0}, {"height": 40.0}, {"acceleration": 0.0}]
)
@pytest.mark.parametrize("armed", [Armed.DISARMED, Armed.ARMED])
def test_one_wrong_sensor_on_the_ground_is_no_flight(wrong, armed):
    story = Story(shipped("multirotor")).ready()
    stands = {"height": 0.1, "vertical_speed": 0.0, "acceleration": 9.8, "tilt": 1.0}
    story.fly(5.0, **{**stands, **wrong}, landed_state=GROUND, armed=armed)
    assert story.state.stage is not Stage.IN_FLIGHT
    assert story.fired() == []


def test_after_a_kill_on_the_ground_flight_is_blocked_and_one_that_flies_is_watched():
    story = Story(shipped("multirotor")).ready()
    story.at(0.1, story.heartbeat(), i.KillRequest(0, "mavlink_parachute 1/161", "test"))
    story.at(0.15, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.KILLING
    assert story.newest(Action.FLIGHT_BLOCK).reasons[-1].startswith("the vehicle is KILLING")
    story.fly(10.0)
    assert story.state.stage is Stage.IN_FLIGHT
    assert "took off although KILLING" in story.alarms()
    story.fall(12.0, tilt=90.0)
    assert story.fired() == ["KILL", "KILL", "DEPLOY"]


def test_a_person_who_insists_releases_another_parachute_than_the_one_that_is_out():
    config = with_rules(TILT, deploy_links=(LINK, "upf_can"))
    story = Story(config).flying().fly(2.0)
    story.at(2.0, parachute(deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    story.at(3.0, i.DeployRequest(8, False, "it did not open"))
    assert "force releases the next of the ladder" in story.answer(8).message
    story.at(3.1, story.heartbeat("upf_can"), i.DeployRequest(9, True, "it did not open"))
    story.at(3.7, story.heartbeat("upf_can"))
    assert story.newest(D).targets == ("upf_can",)
    story.at(3.8, parachute("upf_can", "33", deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    story.at(4.5)
    assert story.answer(9).success


def test_a_deploy_after_the_motors_were_armed_again_is_preceded_by_another_kill():
    story = aloft()
    story.at(2.0, i.KillRequest(5, "operator", "x", kill_only=True))
    story.at(2.05, story.report(K, Outcome.CONFIRMED))
    story.fly(10.0)
    story.at(10.0, i.DeployRequest(6, False, "help"))
    story.fly(10.7)
    assert story.fired() == ["KILL", "KILL", "DEPLOY"]


def test_as_long_as_it_falls_a_link_that_comes_back_is_told_again():
    story = aloft()
    start = story.t
    for step in range(1, 400):
        t = start + step * 0.05
        told = story.told(**falling(step * 0.05, 2000.0))
        story.at(t, told, *([story.heartbeat()] if t < 2.3 or t > 12.5 else []))
    assert story.fired()[:2] == ["KILL", "DEPLOY"]
    assert story.fired()[2:4] == ["KILL", "DEPLOY"]
    assert any("still in the air" in why for d in story.decisions(D) for why in d.reasons)


def test_one_wrong_sample_that_other_messages_tell_again_stays_one():
    chance = random.Random(1)
    story = aloft()
    bad = story.t + 0.05
    story.at(bad, story.heartbeat(), story.told(tilt=170.0))
    for number in range(1, 11):
        sent, way = bad + number * 0.05, chance.uniform(0.0, 0.012) * number / 3
        told = replace(story.told().state, tilt=math.radians(170.0), attitude_age=sent - bad)
        story.at(sent + way, story.heartbeat(), i.VehicleReport(told))
    story.fly(4.0)
    assert story.fired() == []


def test_a_node_that_counts_restarts_from_0_again_hides_none():
    story = Story(shipped("multirotor"))
    down = {"armed": Armed.DISARMED, "landed_state": GROUND}
    story.at(0.0, story.heartbeat(), story.told(reboot_count=2, **down))
    story.fly(2.0, reboot_count=2).fly(4.0, reboot_count=0)
    for step in range(1, 40):
        told = {**falling(step * 0.05, 0.0), **down}
        again = story.told(reboot_count=1, rebooted_in_flight=True, **told)
        story.at(4.0 + step * 0.05, story.heartbeat(), again)
    assert story.fired()[:2] == ["KILL", "DEPLOY"]


@pytest.mark.parametrize("name", ["multirotor", "fixed_wing"])
def test_every_second_message_without_a_value_hides_no_fall(name):
    story = aloft(name)
    for step in range(1, 160):
        told = {**falling(step * 0.05, 400.0), "tilt": 90.0}
        if step % 2:
            told |= dict.fromkeys(("vertical_speed", "acceleration", "tilt"), math.nan)
        story.at(2.0 + step * 0.05, story.heartbeat(), story.told(**told))
    assert story.fired()[:2] == ["KILL", "DEPLOY"]


def test_gaps_in_the_messages_do_not_undo_what_was_counted():
    story = Story(with_rules(TILT)).flying().fly(2.0)
    for burst in range(5):
        for part in (0.0, 0.1):
            t = 2.05 + burst * 1.2 + part
            story.at(t, story.heartbeat(), story.told(tilt=90.0 + t * 1e-3))
    assert story.when(K) < 4.0


def test_a_height_that_does_not_change_holds_a_deploy_back_at_a_tip_over():
    story, t = Story(shipped("multirotor")), 0.0
    while t < 10.0:
        t += 0.1
        up = t > 8.0
        told = {
            "height": 0.0,
            "vertical_speed": (-4.0 if up else 0.0) + t * 1e-6,
            "landed_state": LandedState.TAKING_OFF if up else GROUND,
            "tilt": (90.0 if up else 1.0) + t * 1e-3,
            "acceleration": 9.8 + t * 1e-6,
        }
        story.at(t, story.heartbeat(), vehicle(**told))
    assert story.fired() == ["KILL"]


@pytest.mark.parametrize(("height", "last"), [(-5.0, "KILL"), (-60.0, "DEPLOY")])
def test_far_below_the_take_off_nobody_knows_the_height_above_the_ground(height, last):
    story = Story(shipped("multirotor")).flying().fly(3.0, height=20.0)
    for step in range(20):
        story.fly(story.t + 0.1, height=20.0 + (height - 20.0) * (step + 1) / 20)
    story.fly(story.t + 2.0, height=height, vertical_speed=-4.0, tilt=90.0)
    assert story.fired()[-1] == last


def test_without_a_vertical_speed_the_heights_tell_the_sink():
    story = Story(shipped("rocket")).flying().fly(2.0, height=1000.0, vertical_speed=math.nan)
    for step in range(1, 100):
        told = {"height": 1000.0 - 80.0 * step * 0.05, "vertical_speed": math.nan}
        story.at(2.0 + step * 0.05, story.heartbeat(), story.told(tilt=170.0, **told))
    assert story.fired()[:2] == ["KILL", "DEPLOY"]
    assert "vertical_speed -80.00 (below -60)" in story.newest(K).reasons


def test_what_goes_wrong_again_and_again_does_not_grow_it():
    story, t = Story(shipped("multirotor")).flying().fly(1.0), 1.0
    for _ in range(100):
        t += 0.25
        story.at(t, story.heartbeat(), i.KillRequest(0, "mavlink_parachute 1/161", "x"))
        story.at(t + 0.01, story.report(K, Outcome.FAILED, detail=f"no answer for {t:.2f} s"))
    assert len(story.state.alarming.alarms) <= 16


def test_what_was_said_in_one_flight_is_said_in_the_next_as_well():
    down = {"landed_state": GROUND, "height": 0.0}
    story = Story(shipped("multirotor")).flying().fly(13.0, battery_remaining=0.01)
    story.fly(15.0, **down).fly(16.0, armed=Armed.DISARMED, **down)
    assert story.state.stage is Stage.READY
    story.fly(40.0, battery_remaining=0.01)
    assert len([text for text in story.alarms() if "battery" in text]) == 2


@pytest.mark.parametrize("turns", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("name", ["multirotor", "fixed_wing"])
def test_a_tumble_is_seen_although_it_is_upright_again_and_again(name, turns):
    story = aloft(name)
    for step in range(1, 60):
        angle = 360.0 * turns * step * 0.1 % 360.0
        tilt = min(min(angle, 360.0 - angle) + step * 1e-3, 180.0)
        told = story.told(tilt=tilt, vertical_speed=-6.0 - step * 1e-3)
        story.at(2.0 + step * 0.1, story.heartbeat(), told)
    assert story.fired()[:2] == ["KILL", "DEPLOY"]


def test_a_vehicle_that_falls_below_the_minimum_while_the_kill_is_awaited_gets_no_deploy():
    waits = {"kill_to_deploy_delay": 2.0, "low_kill_to_deploy_delay": 2.0}
    story = Story(shipped("multirotor", **waits)).flying().fly(2.0, height=30.0)
    story.fall(5.1, 30.0)
    assert story.fired() == ["KILL"]
    assert any("after the kill: height" in text for text in story.alarms())
    story.at(5.1, i.DeployRequest(5, False, "all the same"))
    story.at(7.2)
    assert "DEPLOY" in story.fired(), "a person's is never held back by it"


def test_after_a_rules_deploy_a_person_who_insists_is_answered_and_a_reset_is_taken():
    story = aloft().fall(4.0)
    story.at(4.0, story.report(D, Outcome.CONFIRMED), parachute(deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    story.at(4.1, i.DeployRequest(5, True, "again"))
    assert "every parachute of the ladder is out" in story.answer(5).message
    story.at(60.0, i.ResetRequest(6))
    assert story.answer(6).success, "nothing is under way any more"


def test_an_accelerometer_that_reads_nothing_in_a_descent_deploys_nothing():
    story = Story(shipped("multirotor")).flying().fly(2.0, height=100.0)
    for step in range(60):
        told = {"height": 100.0 - 6.0 * step * 0.1, "vertical_speed": -6.0 - step * 1e-3}
        story.fly(2.0 + (step + 1) * 0.1, acceleration=0.0, **told)
    assert story.fired() == []


@pytest.mark.parametrize("name", ["multirotor", "fixed_wing"])
def test_a_fall_without_a_restart_is_not_called_one(name):
    story = aloft(name).fall(6.0, 200.0, tilt=90.0)
    assert not story.state.rule("autopilot rebooted in flight").latched
    assert not story.state.rule("autopilot terminates").latched


def test_a_link_that_was_only_silent_for_a_while_is_not_told_to_shoot_again():
    story = aloft()
    story.at(2.0, story.heartbeat(), i.DeployRequest(5, False, "it falls"))
    story.at(2.1, story.report(K, Outcome.CONFIRMED))
    story.at(2.2, story.report(D, Outcome.SENT))
    story.at(4.0, story.heartbeat())
    assert len(story.decisions(D)) == 1
    story.seq = 0
    story.at(4.1, story.heartbeat())
    assert len(story.decisions(D)) == 2, "one that has restarted knows of nothing"


def test_flying_down_a_valley_after_the_take_off_is_high_enough():
    """It was seen off the ground first: one that was not may be an estimator that runs away."""
    story = Story(shipped("multirotor")).flying().fly(0.1, height=0.0)
    story.fly(2.0, height=3.0)
    for step in range(1, 60):
        story.fly(2.0 + step * 0.1, height=3.0 - 0.55 * step)
    story.fly(11.0, height=-30.0, vertical_speed=-4.0, tilt=90.0)
    assert story.fired()[:2] == ["KILL", "DEPLOY"]
