"""The state in a sentence: a vehicle that nobody guards never looks like one that is, and what was
done has who ordered it, why, when and where."""

from typing import Any

import pytest
from story import DOWN, FLYING, LINK, STANDING, START, Story, parachute, shipped, vehicle

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import Rung
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.state_text import alarms

UPF = "upf_can"
NOT_OURS = "not by an order of this supervisor"
BOTH: dict[str, Any] = {"required_links": (LINK, UPF), "deploy_links": (LINK, UPF)}


def told(story: Story) -> tuple[str, ...]:
    """Its alarms now."""
    return alarms(story.config, story.state, START + story.t)


def flying(profile: str = "multirotor", **settings: Any) -> Story:
    """Guarded, by two parachutes."""
    story = Story(shipped(profile, **{**BOTH, **settings}))
    story.at(0.0, story.heartbeat(), story.heartbeat(UPF))
    story.flying()
    return goes_on(story, 1.0)


def goes_on(story: Story, until: float, healthy: bool = True, **states: LinkState) -> Story:
    """It flies well; each link as states has it, else OK."""
    while story.t < until - 1e-9:
        beats = [
            story.heartbeat(link, healthy, states.get(link, LinkState.OK)) for link in (LINK, UPF)
        ]
        story.at(story.t + 0.05, *beats, story.told())
    return story


# Guarded, and not


def test_a_vehicle_that_is_guarded_says_no_more_than_that_it_flies():
    story = flying()
    assert story.text() == "IN_FLIGHT"
    assert told(story) == ()


def test_one_lost_link_of_two_warns_and_the_vehicle_is_still_guarded():
    story = goes_on(flying(), 2.0, upf_can=LinkState.LOST)
    warning = "rule 'link lost' warns: nothing is received from a device"
    assert story.text() == f"IN_FLIGHT: {warning}"
    assert told(story) == (warning,)
    # When it is heard again, then the warning is over.
    story = goes_on(story, 4.0)
    assert story.text() == "IN_FLIGHT"
    assert told(story) == ()


def test_a_vehicle_none_of_whose_parachutes_is_received_is_not_guarded():
    story = goes_on(flying(), 2.0, mavlink_parachute=LinkState.LOST, upf_can=LinkState.LOST)
    why = f"no parachute can be reached: {LINK} is LOST, {UPF} is LOST"
    assert story.text() == f"IN_FLIGHT, NOT GUARDED: {why}"
    assert told(story) == ("rule 'link lost' warns: nothing is received from a device", why)
    assert goes_on(story, 4.0).text() == "IN_FLIGHT"


def test_parachutes_that_are_received_and_not_fit_guard_nobody():
    story = goes_on(flying(), 2.0, healthy=False)
    why = f"no parachute can be relied on: {LINK} is not healthy, {UPF} is not healthy"
    assert story.text() == f"IN_FLIGHT, NOT GUARDED: {why}"
    story = goes_on(flying(), 2.0, healthy=False, upf_can=LinkState.LOST)
    why = f"no parachute can be relied on: {LINK} is not healthy, {UPF} is LOST"
    assert story.text() == f"IN_FLIGHT, NOT GUARDED: {why}"


def test_a_vehicle_of_which_nothing_is_measured_is_not_guarded():
    story = flying()
    # When its link is cut, then its nodes are heard and nothing of it is,
    while story.t < 4.0:
        story.at(story.t + 0.1, story.heartbeat(), story.heartbeat(UPF))
    why = "nothing reports whether it falls: no vertical speed, acceleration or height"
    assert story.text() == f"IN_FLIGHT, NOT GUARDED: {why}"
    # and both of what is wrong is an alarm.
    lost = "rule 'autopilot lost' warns: the autopilot is silent; if it falls, deploy by hand"
    assert told(story) == (lost, why)


def test_heights_alone_are_enough_to_see_a_fall():
    story = flying()
    flies = {"armed": FLYING.armed, "landed_state": FLYING.landed_state}
    step = 0
    while story.t < 4.0:
        step += 1
        moved = {**flies, "height": 50.0 + 0.01 * (step % 7)}
        story.at(story.t + 0.1, story.heartbeat(), story.heartbeat(UPF), vehicle(**moved))
    assert "nothing reports" not in story.text()


def test_a_profile_that_releases_nothing_itself_says_who_does():
    story = flying("by_hand")
    assert story.text() == (
        "IN_FLIGHT: only a person releases: profile by_hand has no rule that does"
    )
    assert told(story) == (), "it was chosen"


def test_on_the_ground_nobody_needs_a_guard():
    story = Story(shipped("multirotor", **BOTH))
    story.at(
        0.0, story.heartbeat(state=LinkState.LOST), story.heartbeat(UPF, True, LinkState.LOST)
    )
    story.at(20.0)
    assert story.state.stage is Stage.BLOCKED
    assert told(story) == ()


# What was done


def test_a_kill_says_by_which_rule_why_when_and_where():
    story = Story(shipped("multirotor")).flying().fly(2.0, height=100.0)
    story.fall(3.05, height=100.0)
    assert story.state.stage is Stage.KILLING
    rule = story.newest(Action.KILL).rule
    says = next(one.says for one in story.config.profile.rules if one.name == rule)
    assert f"by rule '{rule}' ({says})" in story.text()
    assert story.text().startswith("KILLING: the motors are being stopped, ordered 0 s ago at 9")
    assert story.text().endswith("; the deploy follows")


def test_a_kill_by_a_person_says_whose_and_that_no_deploy_follows():
    story = Story(shipped("multirotor")).flying().fly(1.0)
    story.at(1.0, i.KillRequest(3, "operator", "Anna: the wind", kill_only=True))
    assert story.text() == (
        "KILLING: the motors are being stopped, ordered 0 s ago at 50.0 m by operator: Anna: the "
        "wind; no deploy follows"
    )
    story.at(1.2, story.heartbeat(), story.report(Action.KILL, Outcome.CONFIRMED))
    assert story.text().startswith("KILLING: the motors are off, ordered 0 s ago")


def test_a_deploy_says_which_step_for_whom_and_whose_order():
    story = Story(shipped("multirotor")).flying().fly(1.0)
    story.at(1.0, i.DeployRequest(5, False, "Anna: it burns"))
    story.at(1.1, story.heartbeat(), story.report(Action.KILL, Outcome.CONFIRMED))
    assert story.text() == (
        f"DEPLOYING: {LINK} is to release (step 1 of 1), ordered 0 s ago at 50.0 m by operator: "
        "Anna: it burns"
    )
    # When it is out, then it says which, when and where,
    story.fly(2.0, height=42.0)
    story.at(2.0, parachute(deployed=True))
    story.fly(4.0, height=40.0)
    assert story.text() == (
        f"DEPLOYED: {LINK} 1/161 released 2 s ago at 42.0 m, by operator: Anna: it burns"
    )


def test_a_parachute_that_opens_by_itself_was_not_ordered():
    story = Story(shipped("multirotor")).flying().fly(1.0)
    story.at(1.0, story.heartbeat(), parachute(deployed=True))
    assert story.text() == (
        f"DEPLOYED: {LINK} 1/161 released 0 s ago at 50.0 m, not by an order of this supervisor"
    )


def test_each_parachute_that_is_out_has_the_order_that_was_for_it():
    """Given a UPF that launches itself, and a rule that then orders the other one."""
    story = flying(deploy_ladder=(Rung(LINK),)).fly(1.5)
    story.at(story.t, parachute(UPF, "33", deployed=True), parachute())
    assert story.text().endswith("upf_can 33 released 0 s ago at 50.0 m, " + NOT_OURS)
    story = flying(deploy_ladder=(Rung(LINK),)).fly(1.5)
    story.at(story.t, i.DeployRequest(5, True, "Anna: it burns"))
    story.at(story.t, story.heartbeat(), story.report(Action.KILL, Outcome.CONFIRMED))
    story.at(story.t, parachute(UPF, "33", deployed=True), parachute(deployed=True))
    assert story.text() == (
        f"DEPLOYED: {LINK} 1/161 released 0 s ago at 50.0 m, by operator, forced: Anna: it burns; "
        f"upf_can 33 released, {NOT_OURS}"
    )


def test_a_deploy_long_after_a_kill_alone_does_not_make_that_kill_slow():
    story = Story(shipped("multirotor")).flying().fly(1.0)
    story.at(1.0, i.KillRequest(5, "operator", "Anna: stop", kill_only=True))
    story.at(1.01, story.heartbeat(), story.report(Action.KILL, Outcome.CONFIRMED))
    story.fly(9.0, **DOWN)
    story.at(story.t, i.DeployRequest(6, True, "Anna: it burns"))
    reasons = story.newest(Action.DEPLOY).reasons
    assert reasons[1:] == ("kill confirmed before this deploy was wanted",)
    # Motors that turn again are killed anew, and of that kill nothing is confirmed.
    at_once = {"kill_to_deploy_delay": 0.0, "low_kill_to_deploy_delay": 0.0}
    story = Story(shipped("multirotor", **at_once)).flying().fly(1.0)
    story.at(1.0, i.KillRequest(5, "operator", "Anna: stop", kill_only=True))
    story.at(1.01, story.heartbeat(), story.report(Action.KILL, Outcome.CONFIRMED))
    story.fly(9.0, height=50.0)
    story.at(story.t, i.DeployRequest(6, True, "Anna: it burns"))
    reasons = story.newest(Action.DEPLOY).reasons
    assert reasons[1:] == ("kill not confirmed after 0.00 s (limit 0 s)",)


# Armed, whatever the state


def on_the_ground(until: float = 1.0, **armed: bool) -> Story:
    """Both parachutes received; who is armed."""
    story = Story(shipped("multirotor", **BOTH))
    for t in (0.5 * k for k in range(round(2.0 * until) + 1)):
        beats = [story.heartbeat(), story.heartbeat(UPF), i.VehicleReport(STANDING)]
        mavlink = parachute(armed=armed.get(LINK, False))
        story.at(t, *beats, mavlink, parachute(UPF, "33", armed=armed.get(UPF, False)))
    return story


def test_a_kill_on_the_ground_hides_no_armed_parachute():
    """The moment when somebody walks up to it."""
    story = on_the_ground(upf_can=True)
    story.at(1.1, i.KillRequest(5, "operator", "Anna: stop"))
    story.at(1.2, story.heartbeat(), story.report(Action.KILL, Outcome.CONFIRMED))
    assert story.state.stage is Stage.KILLING
    assert story.text().endswith("; ARMED all the same: upf_can 33 (safety/arm disarms)")
    # In the air it is no news.
    story = flying()
    story.at(1.1, parachute(UPF, "33", armed=True))
    story.at(1.2, i.KillRequest(5, "operator", "Anna: stop"))
    assert "ARMED" not in story.text()


def test_one_of_two_that_is_not_armed_is_named():
    story = on_the_ground(5.0, upf_can=True)
    assert story.text() == f"ARMED: upf_can 33; NOT armed: {LINK} 1/161"
    assert on_the_ground(5.0, upf_can=True, mavlink_parachute=True).text() == "ARMED"


def test_one_whose_node_is_silent_was_armed_when_it_was_last_received():
    story = on_the_ground(upf_can=True)
    for k in range(1, 60):
        story.at(1.0 + 0.2 * k, story.heartbeat(), i.VehicleReport(STANDING))
    assert story.text().endswith("; ARMED when it was last received: upf_can 33")
    assert "all the same" not in story.text()


def test_a_fault_is_one_sentence_and_its_detail_is_an_alarm_once():
    story = Story(shipped("multirotor")).flying().fly(1.0)
    story.at(1.0, i.DeployRequest(5, False, "Anna: it burns"))
    story.at(1.1, story.heartbeat(), story.report(Action.KILL, Outcome.CONFIRMED))
    failed = story.report(Action.DEPLOY, Outcome.FAILED, detail="denied: three lines of protocol")
    story.at(1.2, story.heartbeat(), failed)
    assert story.state.stage is Stage.FAULT
    assert story.text() == (
        "FAULT: no parachute confirmed that it was released, ordered 0 s ago at 50.0 m by "
        "operator: Anna: it burns"
    )
    (alarm,) = told(story)
    assert "three lines of protocol" in alarm


@pytest.mark.parametrize("mode", [i.Mode.SHADOW, i.Mode.INHIBITED])
def test_a_mode_in_which_nobody_is_protected_comes_first(mode):
    story = Story(shipped("multirotor"), mode).flying().fly(1.0)
    assert story.text().startswith(f"{mode.name}: ")
    assert story.text().endswith("; IN_FLIGHT: this supervisor guards no vehicle in this mode")
