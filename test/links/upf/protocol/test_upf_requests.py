"""Take-off, arm, disarm, land: sent, answered, shown by the controller's own status."""

import pytest
from upf_link_bench import BY_REQUEST, CONTROLLER_PARAMETERS

from chute_ros.errors import ParameterError
from chute_ros.links.upf.protocol import parameters as p

SERVICE = "flyfire.ParachuteService"
#: Request -> the state in which it is possible, and the states that show it.
CASES = {
    "TYPE_TAKEOFF": ("READY", ("TAKEOFF", "ARMED")),
    "TYPE_ARM": ("TAKEOFF", ("ARMED",)),
    "TYPE_DISARM": ("ARMED", ("TAKEOFF", "READY")),
    "TYPE_LAND": ("TAKEOFF", ("READY",)),
}
EACH = pytest.mark.parametrize("type_name", CASES)


def standing_at(story, state):
    """The simulated controller is in this state."""
    story.ready()
    way = {"READY": [], "TAKEOFF": ["TYPE_TAKEOFF"], "ARMED": ["TYPE_TAKEOFF", "TYPE_ARM"]}[state]
    for name in way:
        story.call("service", -50, name, 0).after(0.3)
    assert story.controller.state.name == state
    return story.clear()


def made_up(bench, state="READY"):
    """A made-up controller in this state."""
    return bench("").status(state).after(0.1).clear()


def ask(story, type_name, token=1, node_id=0):
    return story.call("service", token, type_name, node_id)


@EACH
def test_request_is_sent_once_and_done_when_the_status_shows_it(bench, type_name):
    before, shown_by = CASES[type_name]
    story = ask(standing_at(bench(), before), type_name).after(2.0)
    assert story.controller.requests_heard == [type_name]
    assert story.steps(1) == ["SENT", "ACCEPTED", "CONFIRMED"]
    assert story.end(1).success
    assert story.end(1).message.startswith(f"ParachuteStatus reports {' or '.join(shown_by)}")


@EACH
def test_request_that_is_lost_or_whose_answer_is_is_done_by_the_status(bench, type_name):
    before, shown_by = CASES[type_name]
    story = standing_at(bench(), before)
    story.loses = lambda from_link, data: from_link
    ask(story, type_name).after(0.4)
    assert story.controller.requests_heard == []
    story.loses = lambda from_link, data: False
    assert story.after(2.0).end(1).success
    story = ask(made_up(bench, before), type_name).after(0.1).status(shown_by[0])
    assert (story.end(1).success, story.end(1).accepted) == (True, False)


@EACH
def test_request_that_is_done_already_or_excluded_sends_nothing(bench, type_name):
    before, shown_by = CASES[type_name]
    story = ask(bench("").status(shown_by[0]).clear(), type_name)
    assert story.requests(SERVICE) == []
    assert story.end(1).success
    assert "already; nothing was sent" in story.end(1).message
    if type_name == "TYPE_TAKEOFF":
        story = bench(parameters={**BY_REQUEST, p.EXCLUDES[type_name]: True}).ready()
    else:
        # The automatic function has nothing to do here: only the request for it is refused.
        story = made_up(bench, before)
        story.link.devices.controllers[33].parameters[p.EXCLUDES[type_name]] = True
    ask(story.clear(), type_name)
    assert story.requests(SERVICE) == []
    assert not story.end(1).success
    assert f"{p.EXCLUDES[type_name]} of controller 33 is on" in story.end(1).message
    assert story.end(1).message.endswith("nothing was sent")


@EACH
def test_rejection_tells_the_state_and_what_may_be_behind(bench, type_name):
    before, switch = CASES[type_name][0], p.EXCLUDES[type_name]
    for known in (None, False):
        story = made_up(bench, before)
        if known is not None:
            story.link.devices.controllers[33].parameters[switch] = known
        ask(story, type_name).answer_result(story.requests(SERVICE)[0], "REJECTED")
        end = story.end(1)
        assert not end.success
        assert end.message.startswith(type_name)
        assert "rejected" in end.message
        assert f"; its state is {before}" in end.message
        behind = f"it rejects {type_name} while its parameter '{switch}' is on"
        assert (behind in end.message) is (known is None)
        assert known is None or end.message.endswith(f"; its state is {before}")


def test_rejection_after_the_parameter_has_changed_says_so(bench):
    story = bench("").status("READY").clear()
    ask(story, "TYPE_TAKEOFF")
    story.link.devices.controllers[33].parameters[p.AUTO_TAKEOFF] = True
    story.answer_result(story.requests(SERVICE)[0], "REJECTED")
    assert "Enable Auto-Takeoff of controller 33 is on" in story.end(1).message


def test_request_that_is_temporarily_rejected_is_tried_again(bench):
    story = ask(bench("").status("READY").clear(), "TYPE_TAKEOFF")
    story.answer_result(story.requests(SERVICE)[0], "TEMPORARILY_REJECTED").after(0.3)
    assert len(story.requests(SERVICE)) == 2
    story.answer_result(story.requests(SERVICE)[1], "SUCCESS").status("TAKEOFF")
    assert story.end(1).success


def test_request_that_is_never_shown_or_not_answered_fails_in_time(bench):
    story = ask(made_up(bench), "TYPE_TAKEOFF")
    while story.t < 8.0:
        for one in story.requests(SERVICE):
            story.answer_result(one, "SUCCESS")
        story.heard.clear()
        story.after(0.1).status("READY")
    assert not story.end(1).success
    assert "never showed that ParachuteStatus reports TAKEOFF or ARMED" in story.end(1).message
    story = ask(made_up(bench), "TYPE_TAKEOFF").after(8.0)
    assert not story.end(1).success
    assert "given up after 5.0 s" in story.end(1).message


def test_status_from_before_a_loss_shows_nothing(bench):
    story = bench("").status("TAKEOFF").at(10.0).clear()
    ask(story, "TYPE_TAKEOFF")
    assert len(story.requests(SERVICE)) == 1
    assert story.ends(1) == []
    assert story.after(0.1).status("TAKEOFF").end(1).success


def test_request_can_name_its_controller(bench):
    story = bench("").status("READY", 33).status("READY", 35).clear()
    ask(story, "TYPE_TAKEOFF", node_id=35)
    story.puppet(35)
    story.status("TAKEOFF", 33)
    assert story.ends(1) == []
    assert story.status("TAKEOFF", 35).end(1).success


def test_request_without_its_controller_is_refused(bench):
    nobody = "no controller was received on this link (received: none"
    for story, node_id, why in (
        (bench(""), 0, f"{nobody})"),
        (
            bench("").status("READY"),
            40,
            "no controller 40 was received on this link (received: 33)",
        ),
        (bench("").trigger_status(), 0, f"{nobody}; triggers received: 34)"),
    ):
        assert ask(story, "TYPE_ARM", node_id=node_id).end(1).message == why
        assert story.requests(SERVICE) == []


def test_request_that_the_document_does_not_know_is_the_callers_mistake(bench):
    for type_name in ("", "TYPE_DANCE", "TYPE_DEPLOY_NEVER", "DEPLOY"):
        story = made_up(bench)
        with pytest.raises(ParameterError, match="need one of TYPE_TAKEOFF"):
            ask(story, type_name)
        assert story.step().requests(SERVICE) == [], type_name


def arm(story, on=True, token=1, triggers=0):
    return story.call("arm", token, on, triggers)


def test_single_triggers_are_refused_as_it_has_none_to_choose(bench):
    for on in (True, False):
        story = arm(standing_at(bench(), "ARMED"), on, triggers=16)
        assert story.requests(SERVICE) == []
        assert story.end(1).message == (
            "triggers 16: a UPF parachute has none to choose, need 0; nothing was sent"
        )
    story = arm(standing_at(bench(), "TAKEOFF"), triggers=4).after(1.0)
    assert story.end(1).success, "the vehicle's own is the one that it has"


def test_arming_a_ready_controller_takes_off_first(bench):
    for state, sent in (("READY", ["TYPE_TAKEOFF", "TYPE_ARM"]), ("TAKEOFF", ["TYPE_ARM"])):
        story = arm(standing_at(bench(), state)).after(1.0)
        assert story.controller.requests_heard == sent
        assert story.controller.state.name == "ARMED"
        assert story.steps(1) == ["SENT", "ACCEPTED", "CONFIRMED"]
        assert story.end(1).message.startswith("ParachuteStatus reports ARMED")
    story = arm(standing_at(bench(), "ARMED")).after(1.0)
    assert story.controller.requests_heard == []
    assert story.end(1).success


def test_arming_ends_with_the_take_off_that_fails(bench):
    story = arm(bench("").status("READY").clear())
    story.answer_result(story.requests(SERVICE)[0], "REJECTED")
    assert story.steps(1) == ["FAILED"]
    assert story.end(1).message.startswith("TYPE_TAKEOFF")
    assert "rejected" in story.end(1).message
    assert len(story.requests(SERVICE)) == 1


def test_arming_is_refused_where_it_or_take_off_is_automatic_before_anything_takes_off(bench):
    for automatic, name in ((p.AUTO_TAKEOFF, "Auto-Takeoff"), (p.AUTO_ARM, "Auto-Arm")):
        story = arm(bench(parameters={**BY_REQUEST, automatic: True}).ready())
        assert f"Enable {name} of controller 33 is on" in story.end(1).message
        assert story.after(1.0).controller.requests_heard == []
        assert story.controller.state.name == "READY"


def test_disarming(bench):
    story = arm(standing_at(bench(), "ARMED"), on=False).after(1.0)
    assert story.controller.requests_heard == ["TYPE_DISARM"]
    assert story.end(1).success


@pytest.mark.parametrize("on", [True, False])
def test_arming_without_a_controller_is_refused(bench, on):
    assert not arm(bench(""), on).end(1).success


def test_controller_as_delivered_does_all_by_itself(bench):
    story = bench(parameters={}).ready()
    assert story.controller.values == CONTROLLER_PARAMETERS
    for token, type_name in enumerate(("TYPE_TAKEOFF", "TYPE_ARM"), start=1):
        ask(story, type_name, token)
        assert "is on: the controller does this by itself" in story.end(token).message
    assert story.controller.requests_heard == []
