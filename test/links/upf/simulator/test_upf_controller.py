"""The controller's states and rules, each as the document says it, seen from the vehicle."""

import math
from itertools import pairwise

import pytest
from upf_device_bench import (
    BLOCK,
    BOTH_LAYOUTS,
    BY_REQUEST,
    CONTROLLER,
    KILL,
    NODE_STATUS,
    RELEASE,
    TRIGGER,
    Story,
    Vehicle,
    armed,
    ready,
)

from chute_ros.links.upf.protocol import definitions as names
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.model import ParachuteState as S
from chute_ros.sim.motion import Motion

# Self test


@BOTH_LAYOUTS
def test_a_failed_self_test_is_abnormal_and_blocks_the_flight(layout):
    story = Story(layout, errors=frozenset({"IMU"})).run(2.0)
    assert story.states() == [S.NOT_READY, S.ABNORMAL]
    assert story.asked() == [BLOCK, BLOCK]
    assert len(story.faults()) == 1
    assert "imu" in story.faults()[0].lower()


def test_a_fault_during_the_self_test_fails_it():
    story = Story(values={p.NODE_STATUS_INTERVAL: 100}, script=[(0.2, "error=BAROMETER")]).run(2.0)
    assert story.states() == [S.NOT_READY, S.ABNORMAL]
    assert story.faults() == ["BAROMETER"]
    modes = [message.values["mode"] for message in story.heard(NODE_STATUS)]
    assert (modes[0], modes[-1]) == (1, 0), "its node says that it initializes until then"


def test_a_vehicle_that_comes_later_or_comes_back_is_asked_when_it_comes():
    story = Story()
    story.vehicle.speaks = False
    story.run(3.0)
    assert (story.state, story.asked()) == (S.READY, [])
    assert not story.status["is_vehicle_connected"]
    story.vehicle.speaks = True
    assert story.run(0.3).asked() == [RELEASE]
    assert story.status["is_vehicle_connected"]
    story = Story(errors=frozenset({"IMU"})).run(2.0)
    story.vehicle.speaks = False
    story.forget()
    assert "VEHICLE_CONNECTION" in story.run(1.2).faults()
    story.vehicle.speaks = True
    assert story.run(0.3).asked() == [BLOCK]
    assert story.faults() == ["IMU"]


def test_a_request_without_an_answer_is_sent_again_and_given_up():
    story = Story()
    story.vehicle.results = {BLOCK: None, RELEASE: None}
    story.run(5.0)
    assert story.asked() == [BLOCK] * 2 + [RELEASE] * 3, "the release ends what it takes back"
    assert any("RELEASE answered: no answer" in event for _, event in story.log)


def test_of_two_vehicles_it_talks_to_the_first():
    story = Story().run(1.0)
    second = Vehicle(story.definitions, node_id=11)
    story.forget()
    for _ in range(200):
        second.update(story.now)
        for frame in second.endpoint.take_output():
            story.bus.receive(frame, story.now)
        story.run(0.01)
        for frame in story.bus.take_output():
            second.receive(frame, story.now)
    assert story.asked() == []
    assert second.asked == []
    story.fall(50.0)
    story.controller.launch("test")
    story.run(0.1)
    assert story.asked() == [KILL]


# Take-off, arm, disarm, land: by request


REQUESTS = ("TAKEOFF", "ARM", "DISARM", "LAND")


def test_what_the_state_does_not_allow_fails_and_changes_nothing():
    for steps, impossible in (([], ["ARM", "DISARM"]), (["TAKEOFF", "ARM"], ["TAKEOFF", "LAND"])):
        story = ready()
        for step in steps:
            story.ask(step)
        before = story.state
        for name in impossible:
            assert story.ask(name) == "FAILED"
            assert story.run(0.2).state is before, name
    for name in REQUESTS:
        story = Story(values=BY_REQUEST).run(0.2)
        assert story.ask(name) == "FAILED", "before its self test has passed"


def test_asking_once_more_for_what_is_so_succeeds():
    story = ready()
    assert story.ask("LAND") == "SUCCESS"
    for name in ("TAKEOFF", "ARM"):
        assert [story.ask(name), story.ask(name)] == ["SUCCESS", "SUCCESS"]
    assert story.states() == [S.NOT_READY, S.READY, S.TAKEOFF, S.ARMED]


# Take-off, arm, disarm, land: automatic


@BOTH_LAYOUTS
def test_a_whole_flight_by_itself(layout):
    story = Story(layout).run(1.0)
    for height in (0.3, 2.0, 20.0, 50.0, 20.0, 5.0, 0.0):
        story.at(height).run(0.5)
    story.run(3.0)
    expected = [S.NOT_READY, S.READY, S.TAKEOFF, S.ARMED, S.TAKEOFF, S.READY]
    assert story.states() == expected


def test_without_auto_takeoff_or_auto_arm_it_stays_and_does_not_deploy_by_itself():
    for switch, state in ((p.AUTO_TAKEOFF, S.READY), (p.AUTO_ARM, S.TAKEOFF)):
        story = Story(values={switch: False}).run(1.0).at(50.0).fall(50.0).run(5.0)
        assert story.state is state
        assert not story.trigger.fired
    assert story.ask("ARM") == "SUCCESS"
    assert story.run(1.0).trigger.fired


def test_without_auto_disarm_or_auto_land_it_stays_until_it_is_told():
    for switch, state, request in (
        (p.AUTO_DISARM, S.ARMED, "DISARM"),
        (p.AUTO_LAND, S.TAKEOFF, "LAND"),
    ):
        story = Story(values={switch: False}).run(1.0).at(50.0).at(5.0).at(0.0).run(10.0)
        assert story.state is state
        assert story.ask(request) == "SUCCESS"
        assert story.run(3.0).state is S.READY


def test_what_was_requested_on_the_ground_does_not_end_by_itself_there():
    """Given Auto-Disarm and Auto-Land: a vehicle that arms before it flies is not undone."""
    story = ready(values={p.AUTO_DISARM: True, p.AUTO_LAND: True})
    story.ask("TAKEOFF")
    story.run(10.0)
    assert story.state is S.TAKEOFF
    story.ask("ARM")
    story.run(10.0)
    assert story.state is S.ARMED
    story.at(50.0).at(0.0).run(5.0)
    assert story.state is S.READY


def test_while_it_falls_it_is_not_disarmed_by_itself():
    story = Story().run(1.0)
    story.at(50.0).at(7.0, vertical_speed=-6.0).run(1.0)
    assert story.state is S.ARMED


# Launching


@BOTH_LAYOUTS
def test_an_accident_asks_for_the_kill_switch_first_and_launches_after_the_answer(layout):
    story = armed(layout)
    story.fall(50.0)
    seconds = story.until(lambda: story.trigger.fired, 2.0)
    assert seconds < 0.5
    assert story.asked() == [KILL]
    asked_at = story.vehicle.asked[0][0]
    launch_at = story.heard(names.TRIGGER_LAUNCH)[0].at
    assert asked_at <= launch_at < asked_at + 0.05
    story.run(0.1)
    assert story.states() == [S.ARMED, S.LAUNCHED]
    lines = [event for _, event in story.log]
    killed = next(i for i, line in enumerate(lines) if "KILLSWITCH answered: SUCCESS" in line)
    fired = next(i for i, line in enumerate(lines) if "FIRED" in line)
    assert killed < fired


def unanswered(**settings):
    """An armed one whose kill switch nobody answers."""
    story = armed(**settings)
    story.vehicle.results[KILL] = None
    return story


def test_a_vehicle_that_does_not_want_to_stop_does_not_stop_the_launch():
    for result in ("REJECTED", "FAILED"):
        story = armed()
        story.vehicle.results[KILL] = result
        assert story.fall(50.0).run(1.0).trigger.fired, result


def test_a_kill_switch_without_an_answer_is_waited_for_only_so_long():
    story = unanswered(kill_wait=0.5)
    story.fall(50.0).until(story.asked)
    seconds = story.until(lambda: story.trigger.fired, 2.0)
    assert seconds == pytest.approx(0.5, abs=0.05)
    story.run(3.0)
    assert story.asked() == [KILL, KILL], "after the launch it is not asked for any more"


def test_without_a_vehicle_nothing_is_waited_for():
    story = Story(values=BY_REQUEST)
    story.vehicle.speaks = False
    story.run(1.0)
    assert story.ask("DEPLOY_FORCE") == "SUCCESS"
    story.run(0.03)
    assert story.trigger.fired


def stuck():
    """An armed one whose trigger says yes, and nothing comes out."""
    story = armed()
    story.trigger.act("trigger-stuck")
    return story


def test_it_is_launched_only_when_the_trigger_says_so_and_tells_it_again_in_its_time():
    story = stuck().fall(50.0).run(4.5)
    assert story.asked()
    assert story.state is S.ARMED
    launches = [message.at for message in story.heard(names.TRIGGER_LAUNCH)]
    assert len(launches) in (4, 5)
    assert all(b - a >= 1.0 for a, b in pairwise(launches))
    story.trigger.stuck = False
    assert story.run(1.5).state is S.LAUNCHED


def test_a_request_tells_a_trigger_that_has_not_fired_at_once_again():
    story = stuck()
    assert story.ask("DEPLOY") == "SUCCESS"
    story.run(0.2)
    story.trigger.stuck = False
    assert story.ask("DEPLOY") == "SUCCESS"
    assert story.run(0.1).state is S.LAUNCHED
    # One that somebody else fires launches it as well.
    story = armed()
    values = story.definitions.request(names.TRIGGER_SERVICE, "TYPE_LAUNCH")
    assert story.result(names.TRIGGER_SERVICE, values, TRIGGER) == "SUCCESS"
    assert story.run(0.1).state is S.LAUNCHED


@BOTH_LAYOUTS
def test_touchdown_after_five_seconds_of_rest(layout):
    story = armed(layout)
    story.ask("DEPLOY")
    story.at(40.0, vertical_speed=-5.0).run(20.0)
    assert story.state is S.LAUNCHED, "under its canopy it is not at rest"
    story.at(0.0).run(2.0)
    story.at(0.0, vertical_speed=1.0).at(0.0)
    seconds = story.until(lambda: story.state is S.TOUCHDOWN)
    assert seconds == pytest.approx(5.0 - 0.1, abs=0.1), "of rest without a break"
    assert story.run(10.0).state is S.TOUCHDOWN


# TYPE_DEPLOY and TYPE_DEPLOY_FORCE


def test_deploy_needs_flight_and_force_does_not():
    flying = (S.TAKEOFF, S.ARMED)
    for state in (S.NOT_READY, S.READY, S.ABNORMAL, *flying):
        for name in ("DEPLOY", "DEPLOY_FORCE"):
            goes = state in flying or name == "DEPLOY_FORCE"
            story = in_state(state)
            assert story.ask(name) == ("SUCCESS" if goes else "FAILED"), (state, name)
            story.run(0.2)
            assert story.trigger.fired is goes, (state, name)
            assert (story.state is S.LAUNCHED) is goes
            assert (KILL in story.asked()) is goes


def in_state(state):
    """A controller that does nothing by itself, in this state."""
    story = Story(values=BY_REQUEST, self_test=5.0 if state is S.NOT_READY else 0.5).run(1.0)
    for name in {S.TAKEOFF: ["TAKEOFF"], S.ARMED: ["TAKEOFF", "ARM"]}.get(state, []):
        assert story.ask(name) == "SUCCESS"
    if state is S.ABNORMAL:
        story.bus.act("error=IMU")
        story.run(0.1)
    assert story.state is state
    return story


def test_a_second_deploy_succeeds_and_does_nothing():
    story = armed()
    assert [story.ask("DEPLOY"), story.ask("DEPLOY")] == ["SUCCESS", "SUCCESS"]
    story.run(0.5)
    assert story.ask("DEPLOY_FORCE") == "SUCCESS"
    story.run(1.0)
    assert len([event for _, event in story.log if "LAUNCH by" in event]) == 1


def test_too_low_is_not_now_but_force_or_a_person_deploys():
    # Too low is not now but force deploys.
    story = armed(minimum_height=20.0).at(15.0)
    assert story.ask("DEPLOY") == "TEMPORARILY_REJECTED"
    assert not story.run(1.0).trigger.fired
    assert story.ask("DEPLOY_FORCE") == "SUCCESS"
    assert story.run(0.2).trigger.fired
    # A person at the device deploys as well.
    story = armed()
    story.bus.act("deploy")
    assert story.run(0.2).state is S.LAUNCHED


# Enable Parachute, Enable APS


@BOTH_LAYOUTS
def test_without_enable_parachute_nothing_deploys(layout):
    for way in ("DEPLOY", "DEPLOY_FORCE", "APS", "person"):
        story = armed(layout, {p.ENABLE_PARACHUTE: False})
        if way == "APS":
            story.fall(50.0)
        elif way == "person":
            story.bus.act("deploy")
        else:
            assert story.ask(way) == "REJECTED"
        story.run(3.0)
        assert not story.trigger.fired, way
        assert story.state is S.ARMED
        assert story.asked() == [], "nor are the motors stopped"


def test_that_it_may_not_deploy_is_told_and_calls_off_a_launch_that_waits():
    story = ready()
    assert story.faults() == []
    story.set(p.ENABLE_PARACHUTE, False)
    assert story.faults() == ["PARACHUTE_DISABLED"]
    assert story.run(1.0).state is S.READY
    story = unanswered()
    story.ask("DEPLOY_FORCE")
    story.run(0.2)
    story.set(p.ENABLE_PARACHUTE, False)
    assert not story.run(3.0).trigger.fired
    assert story.asked() == [KILL], "what it was asked for is not asked again"


@BOTH_LAYOUTS
def test_without_enable_aps_it_deploys_only_when_told_to(layout):
    story = armed(layout, {p.ENABLE_APS: False}).run(0.2)
    assert not story.status.get("is_enable_auto_launch", False)
    story.fall(50.0).run(3.0)
    assert not story.trigger.fired
    assert story.ask("DEPLOY") == "SUCCESS"
    assert story.run(0.2).trigger.fired


def test_enable_aps_switched_off_calls_off_an_automatic_launch_but_no_other():
    for requested in (False, True):
        story = unanswered()
        story.fall(50.0).until(story.asked)
        if requested:
            story.ask("DEPLOY")
        story.set(p.ENABLE_APS, False)
        assert story.run(2.0).trigger.fired is requested
    story = unanswered()
    story.fall(50.0).until(story.asked)
    story.set(p.ENABLE_APS, False)
    story.run(2.0).ask("DEPLOY")
    story.run(0.2)
    story.set(p.ENABLE_APS, False)
    assert story.run(1.0).trigger.fired


# Faults and restarts


def test_a_fault_makes_it_abnormal_and_blocks_the_flight():
    for steps in ([], ["TAKEOFF"], ["TAKEOFF", "ARM"]):
        story = ready()
        for step in steps:
            story.ask(step)
        story.forget()
        story.bus.act("error=LOW_POWER")
        story.run(0.1)
        assert (story.state, story.asked()) == (S.ABNORMAL, [BLOCK]), steps
        assert story.faults() == ["LOW_POWER"]
        story.forget()
        story.bus.act("clear-errors")
        story.run(0.1)
        assert (story.state, story.asked()) == (S.READY, [RELEASE]), steps
        assert story.faults() == []
    story = armed()
    story.bus.act("error=IMU")
    story.fall(50.0).run(3.0)
    assert story.state is S.ABNORMAL
    assert not story.trigger.fired, "a faulty one does not deploy by itself"


def test_a_launched_one_stays_launched_whatever_breaks():
    story = armed()
    story.ask("DEPLOY")
    story.run(0.2)
    story.bus.act("error=IMU")
    assert story.run(1.0).state is S.LAUNCHED
    assert story.faults() == ["IMU"]


@BOTH_LAYOUTS
def test_a_trigger_that_is_not_heard_any_more_is_told_but_stops_nothing(layout):
    story = armed(layout)
    story.trigger.act("silent")
    story.run(1.5)
    assert len(story.faults()) == 1
    assert "trigger_connection" in story.faults()[0].lower()
    assert story.state is S.ARMED
    story.fall(50.0).run(1.0)
    assert story.trigger.fired, "it may be deaf to us only"


@BOTH_LAYOUTS
def test_every_error_has_an_action_and_is_told_by_its_name(layout):
    story = ready(layout)
    known = story.controller.arguments["error"].convert
    for name in ("IMU", "BAROMETER", "TRIGGER_CONNECTION"):
        known(name)
        story.bus.act(f"error={name}")
        assert any(name in fault.upper() for fault in story.run(0.1).faults())
    with pytest.raises(KeyError):
        known("NO_SUCH_ERROR")


@BOTH_LAYOUTS
def test_a_restart_in_flight_tests_itself_again(layout):
    story = armed(layout).at(5.0).run(3.0)
    story.restart()
    story.run(0.2)
    assert story.states()[-1] is S.NOT_READY
    assert story.asked() == [BLOCK]
    story.run(0.6)
    assert story.state is S.READY
    assert story.asked() == [BLOCK, RELEASE]


@BOTH_LAYOUTS
def test_a_launched_one_that_restarts_is_launched_as_soon_as_it_hears_the_trigger(layout):
    story = armed(layout)
    story.ask("DEPLOY")
    story.at(30.0, vertical_speed=-5.0).run(1.0)
    assert story.state is S.LAUNCHED
    story.forget()
    story.restart()
    story.run(0.3)
    assert story.states() == [S.NOT_READY, S.LAUNCHED]
    story.at(0.0).run(5.5)
    assert story.state is S.TOUCHDOWN
    assert KILL not in story.asked()


def test_a_restart_forgets_a_launch_that_waits():
    story = unanswered()
    story.ask("DEPLOY")
    story.run(0.1)
    story.restart()
    assert not story.run(3.0).trigger.fired


# What it tells


def test_the_status_tells_what_it_feels_and_what_is_not_known_stops_nothing():
    # The status tells what it feels.
    story = ready().at(12.5, vertical_speed=-1.5).run(0.2)
    assert story.status["height_of_home"] == pytest.approx(12.5)
    assert story.status["vz"] == pytest.approx(-1.5)
    assert story.status["is_enable_auto_launch"]
    assert story.status["backup_power_voltage"] > 5.0
    # What is not known stops nothing.
    story = ready()
    story.controller.motion = Motion(math.nan, math.nan, math.nan, math.nan)
    story.run(1.0)
    assert math.isnan(story.status["height_of_home"])
    assert story.state is S.READY


def test_its_deadline_is_when_it_has_something_to_do():
    story = ready()
    assert story.now <= story.controller.next_deadline() <= story.now + 0.02
    assert story.bus.next_deadline() <= story.controller.next_deadline()
    assert story.heard(NODE_STATUS, CONTROLLER)
