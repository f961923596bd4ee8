"""What the types of rules say by themselves, written once more."""

import pytest
from story import SINKS, Story, parachute

from chute_ros.model import Action
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions.autopilot import AutopilotFact
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import DEVICE_RULES, BelowMinimum, Clears, Profile, Rule

#: Stage -> the rules of any vehicle that live in it.
ALIVE = {
    Stage.IN_FLIGHT: ["device asks for a kill", "parachute open"],
    Stage.DEPLOYED: ["device asks for a kill", "parachute open"],
}


@pytest.mark.parametrize("stage", Stage)
def test_where_the_rules_of_any_vehicle_live(stage):
    alive = [rule.name for rule in DEVICE_RULES if stage in rule.states]
    assert alive == ALIVE.get(stage, ["device asks for a kill"])


def test_the_rules_of_any_vehicle_stop_the_motors_at_the_first_sign():
    asks, opened = DEVICE_RULES
    assert asks.conditions == (DeviceCondition(DeviceFact.ASKS_FOR_KILL, "any", 1.0),)
    assert opened.conditions == (DeviceCondition(DeviceFact.DEPLOYED, "any", 1.0),)
    for rule in DEVICE_RULES:
        assert (rule.action, rule.needed, rule.hold) == (Action.KILL, 1.0, 0.0)
    assert asks.clears is opened.clears is Clears.BY_ITSELF


def test_a_device_that_asks_is_obeyed_again_once_it_has_stopped_asking():
    story = Story().ready()
    story.at(0.1, i.KillRequest(0, "upf_can 33", "smoke"))
    assert story.state.rule("device asks for a kill").latched
    story.at(2.0)
    assert not story.state.rule("device asks for a kill").latched


def test_a_parachute_that_stays_open_is_acted_on_once():
    story = Story().flying()
    story.at(0.1, parachute(deployed=True))
    story.at(0.2, parachute())
    story.at(0.3, parachute(deployed=True))
    assert story.fired() == ["KILL"]


def test_what_a_profile_leaves_out_is_as_its_page_says():
    rule = Rule("sinks", (SINKS,), Action.DEPLOY, (Stage.IN_FLIGHT,), needed=1.0)
    assert (rule.hold, rule.leak, rule.samples) == (0.0, 0.5, 1)
    assert (rule.clears, rule.says, rule.source) == (Clears.NEVER, "", "")
    profile = Profile("bare", (rule,))
    assert (profile.minimum_height, profile.below_minimum) == (0.0, BelowMinimum.DEPLOY)
    assert (profile.moving_speed, profile.landed_hold) == (2.0, 0.0)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (Clears, "never on_disarm by_itself"),
        (BelowMinimum, "deploy kill nothing"),
        (AutopilotFact, "lost rebooted disarmed emergency killed_aloft motors_stopped"),
        (DeviceFact, "asks_for_kill deployed abnormal nothing_out drogue_out"),
    ],
)
def test_the_words_of_a_profile_are_those_of_its_page(kind, words):
    assert " ".join(one.value for one in kind) == words
