"""A trigger that says "launched" though nobody ordered it: one frame may have been damaged."""

import pytest

from chute_ros.model import LinkState, ParachuteState

COUNT = "launched without an order, not believed yet"
DOUBT = (
    "trigger 34 reports fired, without an order from this node: believed once it repeats "
    "this, or its controller reports it"
)


def flying(bench, **config):
    """An armed controller and its trigger, both made up."""
    return bench("", **config).trigger_status().status("ARMED").at(0.1).clear()


def damaged(story):
    """READY, whose bit for "launched" was turned over between the adapter and us."""
    return story.trigger_status(is_launched=True, **no_bit(story))


def no_bit(story):
    """The types that have no such bit tell it by the state alone."""
    has = "is_launched" in story.layout.types.message("flyfire.TriggerStatus").fields
    return {} if has else {"state": "LAUNCHED"}


def test_one_damaged_status_opens_no_parachute(bench):
    story = flying(bench)
    damaged(story)
    assert not any(one.deployed for one in story.pictures())
    assert story.picture().state is ParachuteState.ARMED
    assert story.notices() == [DOUBT]
    assert story.link.counts[COUNT] == 1
    story.after(0.2).trigger_status()
    assert not story.picture().deployed
    assert story.link.devices.triggers[34].sound


def test_damage_again_and_again_but_never_three_times_in_a_row_opens_none(bench):
    story = flying(bench)
    for number in range(5):
        for _ in range(1 + number % 2):
            damaged(story.after(0.2).status("ARMED"))
        story.after(0.2).status("ARMED").trigger_status()
    assert not any(one.deployed for one in story.pictures())
    assert not story.link.devices.triggers[34].launched
    assert story.link.counts[COUNT] == 7


def test_trigger_that_says_so_again_is_believed(bench):
    """APS, whose controller died; or we were started while the parachute is out."""
    story = flying(bench).trigger_status("LAUNCHED").after(0.2).trigger_status("LAUNCHED")
    assert not story.picture().deployed
    story.after(0.2).trigger_status("LAUNCHED")
    assert story.picture().deployed
    assert story.pictures()[-1].state is ParachuteState.LAUNCHED
    assert story.notices() == [DOUBT, "trigger 34 has fired"]
    assert story.after(0.2).trigger_status("LAUNCHED").picture().deployed
    assert story.link.counts[COUNT] == 2


def test_started_while_it_is_out_the_third_status_tells(bench):
    story = bench("", without_controller=True).trigger_status("LAUNCHED")
    assert (story.picture().deployed, story.picture().state) == (False, ParachuteState.UNKNOWN)
    assert not story.link.devices.triggers[34].sound, "it may be out"
    story.after(0.2).trigger_status("LAUNCHED").after(0.2).trigger_status("LAUNCHED")
    assert story.picture().deployed


def test_two_triggers_do_not_speak_for_each_other(bench):
    story = flying(bench).trigger_status(node_id=36)
    story.trigger_status("LAUNCHED").trigger_status("LAUNCHED", 36).trigger_status("LAUNCHED")
    assert not story.picture().deployed
    assert story.trigger_status("LAUNCHED").picture().deployed


def test_first_is_believed_when_the_controller_says_so_before_or_after_it(bench):
    """Whichever is heard first: a node that started anew must not order what is out."""
    story = flying(bench).status("LAUNCHED").trigger_status("LAUNCHED")
    assert story.link.devices.triggers[34].launched
    assert not story.link.counts[COUNT]
    story = flying(bench).trigger_status("LAUNCHED")
    assert not story.after(0.05).picture().deployed
    assert story.status("LAUNCHED").picture().deployed
    assert story.link.devices.triggers[34].launched
    assert story.notices()[-1] == "trigger 34 has fired"
    assert story.call("fire_triggers", 1).end(1).success
    assert story.requests("flyfire.TriggerService") == []


def test_one_of_several_controllers_does_not_speak_for_a_trigger(bench):
    story = flying(bench).status("ARMED", 37).trigger_status("LAUNCHED").status("LAUNCHED", 37)
    assert story.link.devices.triggers[34].doubted
    story = flying(bench).status("READY", 35).status("LAUNCHED").trigger_status("LAUNCHED")
    assert not story.link.devices.triggers[34].launched


@pytest.mark.parametrize("config", [{}, {"without_controller": True}])
def test_second_is_believed_when_a_deploy_is_under_way(bench, config):
    story = flying(bench, **config).call("deploy", 1, False)
    story.after(0.05).trigger_status("LAUNCHED")
    assert story.ends(1) == []
    assert not story.picture().deployed
    story.after(0.1).trigger_status("LAUNCHED")
    assert story.end(1).success
    assert story.picture().deployed
    assert story.after(0.2).trigger_status("LAUNCHED").picture().deployed, "and stays so"
    assert not story.link.counts[COUNT]


@pytest.mark.parametrize("config", [{}, {"without_controller": True}])
def test_one_damaged_status_after_an_order_does_not_end_it(bench, config):
    """Given an order that was lost on its way."""
    story = flying(bench, **config).call("deploy", 1, True).clear()
    damaged(story.after(0.02)).after(0.1).trigger_status()
    story.after(0.3)
    assert story.ends(1) == []
    assert not any("has fired" in text for text in story.notices())
    again = "flyfire.TriggerService" if config else "flyfire.ParachuteService"
    assert story.requests(again), "it is sent again"
    assert story.trigger_fired().end(1).success


@pytest.mark.parametrize("config", [{}, {"without_controller": True}])
def test_damage_before_an_order_keeps_nothing_from_being_sent(bench, config):
    story = flying(bench, **config)
    damaged(story)
    story.call("deploy", 1, False)
    assert story.requests("flyfire.ParachuteService") or story.requests("flyfire.TriggerService")
    assert story.ends(1) == []
    assert story.after(0.05).trigger_status("LAUNCHED").end(1).success


def test_trigger_that_is_doubted_was_heard(bench):
    story = flying(bench)
    for _ in range(5):
        damaged(story.after(0.7)).trigger_status()
    trigger = story.link.devices.triggers[34]
    assert trigger.liveness.state is LinkState.OK
    damaged(story.after(0.4))
    assert not trigger.overdue(story.now + 0.5)
