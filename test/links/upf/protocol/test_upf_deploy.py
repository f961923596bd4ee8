"""Deploying: through the controller, round a silent one, and without any."""

import pytest
from upf_link_bench import BY_REQUEST

from chute_ros.links.upf.protocol import parameters as p

SERVICE, TRIGGER, LAUNCH = (
    "flyfire.ParachuteService",
    "flyfire.TriggerService",
    "flyfire.TriggerLaunch",
)


def deploy(story, force=False, token=1, node_id=0):
    return story.call("deploy", token, force, node_id=node_id)


def armed(story):
    """A made-up controller, armed, and a trigger."""
    return story.trigger_status().status("ARMED").at(0.1).clear()


def answered(story, result):
    """The controller answers the first request."""
    return story.answer_result(story.requests(SERVICE)[0], result)


def fired_at(story):
    """Whether the triggers were fired directly."""
    return bool(story.requests(TRIGGER) or story.messages(LAUNCH))


@pytest.mark.parametrize("force", [False, True])
def test_deploy_is_done_when_the_controller_says_launched(bench, force):
    story = deploy(bench().in_flight(), force).after(3.0)
    name = "TYPE_DEPLOY_FORCE" if force else "TYPE_DEPLOY"
    assert story.controller.requests_heard == [name]
    assert story.steps(1) == ["SENT", "ACCEPTED", "CONFIRMED"]
    assert story.trigger.fired
    assert not fired_at(story)
    assert ("KILL", "33") in story.asked()


def test_forced_deploy_works_on_the_ground_where_a_plain_one_does_not(bench):
    story = deploy(bench().ready()).after(1.0)
    assert not story.end(1).success
    assert "its state is READY: force sends TYPE_DEPLOY_FORCE" in story.end(1).message
    assert deploy(story, True, token=2).after(2.0).end(2).success


def test_deploy_through_the_service_is_the_same(bench):
    assert bench().in_flight().call("service", 1, "TYPE_DEPLOY", 0).after(2.0).end(1).success
    story = bench().ready().call("service", 1, "TYPE_DEPLOY_FORCE", 33)
    assert story.after(2.0).end(1).success


def test_deploy_is_urgent_on_the_bus(bench):
    story = armed(bench(""))
    story.link.deploy(1, False, story.now)
    story.link.update(story.now)
    identifiers = [int.from_bytes(data[:4], "little") for data in story.link.take_output()]
    assert 2 in [(identifier >> 24) & 0x1F for identifier in identifiers]


def test_deploy_that_is_lost_is_sent_again(bench):
    story = bench().in_flight()
    story.loses = lambda from_link, data: from_link
    deploy(story).after(0.4)
    story.loses = lambda from_link, data: False
    assert story.after(2.0).end(1).success
    assert story.controller.requests_heard == ["TYPE_DEPLOY"]
    assert not fired_at(story)


def test_deploy_whose_answers_are_lost_is_done_by_the_status_or_the_triggers(bench):
    story = deploy(armed(bench(""))).at(0.3).status("LAUNCHED")
    assert (story.end(1).success, story.end(1).accepted) == (True, False)
    assert not fired_at(story.at(9.0))
    assert deploy(armed(bench(""))).at(0.3).trigger_fired().end(1).success


def test_deploy_of_a_parachute_that_is_out_sends_nothing(bench):
    for state in ("LAUNCHED", "TOUCHDOWN"):
        story = deploy(bench("").status(state).clear())
        assert story.end(1).success, state
        assert "nothing was sent" in story.end(1).message
        assert story.requests(SERVICE) == []
        assert not fired_at(story.at(9.0)), state


def test_deploy_believes_no_status_from_before_a_loss(bench):
    story = deploy(bench("").status("LAUNCHED").at(9.0).clear())
    assert len(story.requests(SERVICE)) == 1
    assert story.ends(1) == []
    assert story.status("LAUNCHED").ends(1) == []  # of the same moment
    assert story.after(0.01).status("LAUNCHED").end(1).success


def test_deploy_can_name_its_controller(bench):
    story = armed(bench("")).status("ARMED", 35).clear()
    assert deploy(story, node_id=35).status("LAUNCHED", 33).ends(1) == []
    assert story.after(0.1).status("LAUNCHED", 35).end(1).success
    assert "no controller 77" in deploy(story, token=2, node_id=77).end(2).message


def test_refused_deploy_fails_and_is_not_gone_round(bench):
    story = answered(deploy(armed(bench(""))), "REJECTED").at(9.0)
    assert not story.end(1).success
    assert "rejected" in story.end(1).message
    assert not fired_at(story)


def test_refused_forced_deploy_is_tried_again_but_not_gone_round(bench):
    """A disabled parachute does not deploy, not even by force (document, Enable Parachute)."""
    story = bench(parameters={**BY_REQUEST, p.ENABLE_PARACHUTE: False}).in_flight()
    deploy(story, True).after(8.0)
    assert not story.end(1).success
    assert len(story.controller.requests_heard) > 5
    assert "Enable Parachute is off: it never deploys, not even by force" in story.end(1).message
    assert not fired_at(story)
    assert not story.trigger.fired


def test_deploy_that_is_not_possible_yet_goes_on_until_it_is_and_is_not_gone_round(bench):
    story = bench(settings={"minimum_height": 5.0}).in_flight()
    deploy(story).after(2.0)
    assert story.ends(1) == []
    assert not fired_at(story)
    story.controller.motion = type(story.controller.motion)(height=20.0)
    assert story.after(1.5).end(1).success


def test_acknowledged_deploy_that_is_never_shown_is_a_failure_that_says_so(bench):
    story = bench().in_flight()
    story.trigger.stuck = True
    deploy(story).after(8.0)
    assert not story.end(1).success
    assert "never showed that ParachuteStatus reports LAUNCHED" in story.end(1).message


def test_answer_to_another_request_is_no_answer_to_a_deploy(bench):
    story = armed(bench("").status("READY")).call("service", 2, "TYPE_DISARM", 33)
    (disarm,) = story.step().requests(SERVICE)
    deploy(story).answer_result(disarm, "REJECTED")
    assert fired_at(story.at(1.3))


ROUND = "the controller does not answer: firing the triggers directly"


def test_silent_controller_is_gone_round_again_and_again_until_a_trigger_says_that_it_has(bench):
    story = deploy(armed(bench("")))
    assert not fired_at(story.at(1.0))
    story.at(1.15)
    assert len(story.requests(TRIGGER, "TYPE_LAUNCH")) == len(story.messages(LAUNCH)) == 1
    constants = story.layout.types.message(LAUNCH).constants
    assert story.messages(LAUNCH)[0]["magic_number"] == constants["MAGIC_NUMBER"]
    assert 4 <= len(story.at(2.0).messages(LAUNCH)) <= 5
    assert len(story.requests(TRIGGER)) == len(story.messages(LAUNCH))
    assert story.trigger_fired().end(1).success
    count = len(story.messages(LAUNCH))
    assert len(story.at(9.0).messages(LAUNCH)) == count
    assert story.notices().count(ROUND) == 1


def test_real_trigger_is_fired_round_a_mute_controller(bench):
    story = bench().in_flight()
    story.controller.mute = True
    assert deploy(story).after(2.0).end(1).success
    assert story.trigger.fired


def test_lost_controller_is_gone_round_at_once(bench):
    story = armed(bench("")).at(5.0).trigger_status().clear()
    assert fired_at(deploy(story))


def test_triggers_that_never_say_so_end_the_request_in_time(bench):
    story = deploy(armed(bench(""))).at(9.0)
    assert not story.end(1).success
    count = len(story.messages(LAUNCH))
    assert len(story.at(20.0).messages(LAUNCH)) == count


def test_triggers_nobody_has_heard_are_told_by_broadcast(bench):
    story = deploy(bench("").status("ARMED").clear()).at(2.0)
    assert story.messages(LAUNCH)
    assert not story.requests(TRIGGER)


def test_controller_that_answers_late_stops_the_last_resort(bench):
    story = deploy(armed(bench(""))).at(1.3)
    count = len(story.messages(LAUNCH))
    story.answer_result(story.requests(SERVICE)[-1], "REJECTED").at(9.0)
    assert len(story.messages(LAUNCH)) == count


def restarts(story):
    return story.after(0.5).trigger_status().node_status(uptime=0).status("NOT_READY")


def accepts(story):
    return answered(story, "SUCCESS")


#: Settings, what the controller does once it is ordered, and whether it is gone round by then.
WHEN_ROUND = [
    ({}, [accepts], {1.4: False, 1.8: True}),
    ({}, [lambda story: answered(story, "TEMPORARILY_REJECTED")], {1.2: False, 2.5: True}),
    ({}, [restarts], {1.05: False, 1.15: True}),
    ({}, [accepts, restarts], {0.65: True}),
    ({"last_resort": False}, [], {9.0: False}),
    ({"last_resort_after": 0.3}, [], {0.39: False, 0.41: True}),
]


@pytest.mark.parametrize(("config", "happens", "fired"), WHEN_ROUND)
def test_when_a_controller_that_falls_silent_is_gone_round(bench, config, happens, fired):
    story = deploy(armed(bench("", **config)).node_status(uptime=60), force=True)
    for step in happens:
        step(story)
    for t, expected in fired.items():
        assert fired_at(story.at(t).trigger_status()) is expected, t
    if config.get("last_resort", True):
        assert story.trigger_fired().end(1).success
    else:
        assert not story.end(1).success


def test_parachute_that_is_switched_off_is_not_gone_round(bench):
    story = armed(bench(""))
    story.link.devices.controllers[33].parameters[p.ENABLE_PARACHUTE] = False
    assert not fired_at(deploy(story).at(4.0))


def test_controller_that_accepts_and_goes_on_speaking_is_not_gone_round(bench):
    story = deploy(armed(bench("")))
    story.answer_result(story.requests(SERVICE)[0], "SUCCESS")
    while story.t < 4.0:
        story.after(0.1).status("ARMED").trigger_status()
    assert not fired_at(story)


def test_refusal_that_comes_after_the_call_was_given_up_counts(bench):
    """Answers 0.8 s late, each after its call has ended: they are refusals all the same."""
    story = deploy(armed(bench("")))
    answered = 0
    while story.t < 4.0:
        story.after(0.05).status("ARMED").trigger_status()
        for asked in story.requests(SERVICE)[answered:]:
            if story.t < 0.8:
                break
            story.answer_result(asked, "REJECTED")
            answered += 1
    assert answered >= 3
    assert not fired_at(story)


def test_refusal_of_one_deploy_says_nothing_of_another(bench):
    story = deploy(armed(bench("")), True).call("deploy", 2, False)
    plain = [
        one
        for one in story.requests(SERVICE)
        if story.definitions.type_name(SERVICE, one.values) == "TYPE_DEPLOY"
    ]
    story.answer_result(plain[0], "REJECTED")
    assert not story.end(2).success
    assert fired_at(story.at(1.3)), "the forced one has no answer"


def test_controller_that_falls_silent_is_gone_round_for_each_deploy(bench):
    """The one that it had accepted, and the one that it had not answered."""
    story = answered(deploy(armed(bench("")), True), "SUCCESS")
    deploy(story, token=2).at(1.4).trigger_status()
    assert story.notices().count(ROUND) == 1, "of the first its silence says nothing yet"
    assert story.at(1.8).notices().count(ROUND) == 2
    story.trigger_fired()
    assert (story.end(1).success, story.end(2).success) == (True, True)


def test_named_one_of_several_controllers_is_not_gone_round_nor_confirmed_by_a_trigger(bench):
    """Nobody says which trigger is whose."""
    story = armed(bench("")).status("ARMED", 40).clear()
    assert not fired_at(deploy(story, node_id=33).at(9.0))
    story = armed(bench("")).status("ARMED", 40).trigger_out().clear()
    assert deploy(story, node_id=40).after(0.2).ends(1) == []
    assert len(story.requests(SERVICE)) == 1


def test_only_our_trigger_is_launched_where_it_is_named(bench):
    story = deploy(armed(bench("", trigger_node_id=34))).at(1.3)
    assert story.requests(TRIGGER, "TYPE_LAUNCH")
    assert {one.get("node_id") for one in story.messages(LAUNCH)} <= {34}


def test_without_last_resort_a_trigger_alone_is_not_fired(bench):
    story = deploy(bench("", last_resort=False).trigger_status().clear())
    assert not story.end(1).success
    assert not fired_at(story.at(4.0))


def test_after_a_stall_nothing_is_fired_for_a_request_that_has_ended(bench):
    story = deploy(armed(bench("")))
    story.t += 6.0
    story.step()
    assert not story.end(1).success
    assert not fired_at(story)


def test_trigger_is_fired_where_there_is_no_controller(bench):
    story = deploy(bench("trigger", without_controller=True).ready()).after(1.0)
    assert story.end(1).success
    assert story.end(1).message.startswith("TriggerStatus of 34 reports launched")
    assert story.trigger.fired
    assert story.picture().deployed


def test_trigger_that_does_not_hear_is_asked_again(bench):
    story = deploy(bench("").trigger_status().clear()).at(1.5)
    assert len(story.requests(TRIGGER, "TYPE_LAUNCH")) >= 4
    assert story.trigger_fired().end(1).success


def test_every_trigger_is_fired_again_and_again_where_there_is_no_controller(bench):
    story = deploy(bench("").trigger_status().trigger_status(node_id=36).clear()).at(1.5)
    assert len(story.messages(LAUNCH)) >= 4
    assert len(story.requests(TRIGGER)) > 1.5 * len(story.messages(LAUNCH)), "both are asked"
    assert story.trigger_fired(36).end(1).success


def test_trigger_that_refuses_is_asked_until_time_is_up(bench):
    story = deploy(bench("").trigger_status().clear())
    answered = 0
    while story.t < 8.0:
        for request in story.requests(TRIGGER)[answered:]:
            story.answer_result(request, "REJECTED", 34)
            answered += 1
        story.after(0.1).trigger_status()
    assert answered > 5
    assert not story.end(1).success


def test_trigger_that_has_fired_is_not_fired_again(bench):
    for order in (deploy, fire):
        story = order(bench("").trigger_out().clear())
        assert story.end(1).success
        assert not fired_at(story.at(9.0))


def test_deploy_without_anybody_is_refused_and_waits_until_somebody_was_heard(bench):
    story = deploy(bench(""))
    assert story.end(1).message == "no controller was received on this link (received: none)"
    assert not fired_at(story)
    for story in (bench("").status("READY"), bench("").trigger_status()):
        assert story.at(60.0).link.has_parachute()
    assert not bench("").link.has_parachute()


def fire(story, token=1):
    return story.call("fire_triggers", token)


def test_triggers_are_fired_past_a_controller_that_is_well(bench):
    story = fire(bench().in_flight()).after(1.0)
    assert story.end(1).success
    assert story.trigger.fired
    assert story.controller.requests_heard == []


def test_triggers_are_fired_at_once_and_again_until_one_says_that_it_has(bench):
    story = fire(armed(bench("")))
    assert len(story.requests(TRIGGER, "TYPE_LAUNCH")) == len(story.messages(LAUNCH)) == 1
    assert story.requests(SERVICE) == []
    story.at(1.5)
    assert len(story.messages(LAUNCH)) >= 4
    assert story.trigger_fired().end(1).success
    count = len(story.messages(LAUNCH))
    assert len(story.at(9.0).messages(LAUNCH)) == count


def test_triggers_that_were_never_heard_may_listen(bench):
    story = fire(bench("").status("ARMED").clear())
    assert not story.end(1).success
    assert story.end(1).message == "no trigger was received yet; TriggerLaunch was broadcast"
    assert len(story.messages(LAUNCH)) == 1


def test_a_controller_that_came_back_under_another_node_id_is_the_only_one(bench):
    """Its document lets the static node id be 0, and a device forgets what it was given."""
    story = bench("").status("READY", 33).node_status(33).at(4.0)
    for second in range(3):
        story.status("ARMED", 125).node_status(125, uptime=5 + second).trigger_status()
        story.after(1.0)
    deploy(story.clear())
    story.after(1.2).trigger_fired()
    assert story.end(1).success


def test_of_two_that_were_heard_at_one_time_none_is_the_only_one(bench):
    story = bench("").status("READY", 33).node_status(33).status("READY", 125).at(4.0)
    story.status("ARMED", 125).node_status(125).trigger_status().after(1.0)
    assert story.link.devices.only_controller() is None


def test_without_controller_the_trigger_is_the_parachute_whoever_else_speaks(bench):
    story = bench("", without_controller=True).trigger_status().at(1.0).status("READY", 33)
    story.at(2.0).clear().trigger_out()
    assert {one.device for one in story.pictures()} == {"34"}
    assert story.picture().deployed


def test_a_deploy_that_is_overdue_when_the_triggers_are_ordered_goes_on_as_well(bench):
    """After a stall both are due in the same moment."""
    story = deploy(armed(bench("")))
    story.t += 1.2
    fire(story, token=2)
    assert ROUND in story.notices()
    assert len(story.messages(LAUNCH)) == 2
    story.trigger_fired()
    assert (story.end(1).success, story.end(2).success) == (True, True)


def test_what_makes_the_parachute_less_ready_gives_way(bench):
    for type_name in ("TYPE_DISARM", "TYPE_LAND"):
        story = deploy(armed(bench(""))).call("service", 2, type_name, 0)
        assert "a deploy is under way" in story.end(2).message, type_name
        assert len(story.requests(SERVICE)) == 1
        for order in (deploy, fire):
            story = order(armed(bench("")).call("service", 2, type_name, 0))
            assert not story.end(2).success, type_name
            assert "given up: a release was ordered" in story.end(2).message
