"""flyfire.VehicleService: what devices ask of the vehicle is answered by what really happened."""

import pytest
from upf_link_bench import US, Bench, flying, landed, layout_of

from chute_ros.links.upf.protocol.config import Policy
from chute_ros.links.upf.protocol.vehicle_service import KILL_MEMORY, MOST_PENDING

KILL, BLOCK, RELEASE = "TYPE_KILLSWITCH", "TYPE_FLIGHT_BLOCK", "TYPE_FLIGHT_BLOCK_RELEASE"


@pytest.fixture
def alone(bench):
    """A link without devices, whose supervisor does nothing by itself."""

    def make(**config):
        story = bench("", **config).step()
        story.supervised = False
        return story.clear()

    return make


def failed(story):
    """The result for what was wanted but did not happen, in these types."""
    return {"ours": "FAILED", "other": "REJECTED"}[story.layout.name]


TYPES = pytest.mark.parametrize("type_name", [KILL, BLOCK, RELEASE])
BLOCKED, RELEASED = ("FLIGHT_BLOCK", "33"), ("FLIGHT_BLOCK_RELEASE", "33")


def test_kill_is_answered_with_success_once_the_motors_are_off(alone):
    story = alone().ask(KILL)
    assert story.asked() == [("KILL", "33")]
    assert story.at(0.3).answers() == []
    story.call("kill_confirmed")
    assert story.step().answers() == ["SUCCESS"]
    assert story.link.vehicle_service.newest_answer == "TYPE_KILLSWITCH of 33: SUCCESS"
    assert story.at(5.0).answers() == ["SUCCESS"]


def test_a_kill_that_a_decided_deploy_has_waited_for_is_not_waited_for_again(alone):
    """Given a kill that nobody confirms; then the deploy is decided all the same."""
    story = alone().ask(KILL).at(0.3)
    assert story.answers() == []
    story.call("kill_waited_for")
    assert story.at(0.34).answers() == []
    assert story.at(0.36).answers() == [failed(story)]
    story.ask(KILL, number=1).at(0.42)
    assert story.answers() == [failed(story)] * 2, "so it is with one that asks after it"
    assert story.asked() == [("KILL", "33")] * 3, "the supervisor hears of it as ever"


def test_one_that_was_confirmed_all_the_same_has_happened(alone):
    """Given the word that the motors are off a little behind the deploy that rests on it."""
    story = alone().ask(KILL).call("kill_waited_for")
    story.at(0.03).link.kill_confirmed(story.now)
    assert story.step().answers() == ["SUCCESS"]
    assert story.ask(KILL, number=1).step().answers() == ["SUCCESS"] * 2


def test_a_kill_is_waited_for_again_long_after_the_deploy_and_a_block_always(alone):
    # A kill long after the deploy is another one.
    story = alone().call("kill_waited_for").at(5.1).ask(KILL).step()
    assert story.answers() == []
    assert story.at(6.0).answers() == [failed(story)]
    # A flight block is waited for also after a deploy.
    story = alone().call("kill_waited_for")
    assert story.ask(BLOCK).step().answers() == []


def test_what_does_not_happen_is_answered_with_a_failure_in_time(alone):
    story = alone().ask(KILL).at(0.79)
    assert story.answers() == []
    assert story.at(0.81).answers() == [failed(story)]
    assert story.call("kill_confirmed").answers() == [failed(story)]
    assert story.link.counts["KILL not done in time"] == 1
    story = alone().ask(BLOCK).at(2.0)
    assert story.answers() == [failed(story)]
    story = alone(vehicle_service_timeout=2.0).ask(KILL).at(1.9)
    assert story.answers() == []
    assert story.at(2.1).answers() == [failed(story)]


def test_kill_of_a_moment_ago_answers_a_request_that_comes_after_it(alone):
    story = alone().call("kill_confirmed")
    assert story.at(KILL_MEMORY - 0.1).ask(KILL).answers() == ["SUCCESS"]
    assert story.at(KILL_MEMORY + 0.1).ask(KILL, number=1).at(9.0).answers() == [
        "SUCCESS",
        failed(story),
    ]


def test_vehicle_that_is_armed_again_has_forgotten_the_kill(alone):
    story = alone().call("vehicle", flying()).call("kill_confirmed")
    story.at(0.5).link.vehicle(flying(armed_age=0.6), story.now)  # said before the kill
    assert story.ask(KILL, number=1).answers() == ["SUCCESS"]
    story.at(1.0).link.vehicle(landed(), story.now)
    assert story.ask(KILL, number=2).answers() == ["SUCCESS"] * 2
    story.at(1.5).link.vehicle(flying(), story.now)
    assert story.ask(KILL, number=3).at(3.0).answers() == ["SUCCESS", "SUCCESS", failed(story)]


def test_every_kill_is_answered_and_asked_for_until_it_is(alone):
    # Every repetition of a kill is answered.
    story = alone().ask(KILL, number=0).at(0.3).ask(KILL, number=1).call("kill_confirmed")
    assert story.step().answers() == ["SUCCESS"] * 2
    assert set(story.asked()) == {("KILL", "33")}
    # A supervisor that has just started has not heard the first.
    story = alone().ask(KILL).at(0.5)
    assert len(story.asked()) == 3
    story.call("kill_confirmed").at(3.0)
    assert len(story.asked()) == 3


def test_nodes_that_are_not_our_controller_are_rejected_and_counted(alone):
    story = alone(controller_node_id=40).ask(KILL).ask(BLOCK, number=1)
    assert story.answers() == ["REJECTED"] * 2
    assert story.asked() == []
    assert story.link.counts["requests of nodes that are not our controller"] == 2


def test_block_of_a_device_that_is_gone_does_not_outlive_a_reset_of_the_supervisor(alone):
    story = alone().ask(BLOCK).call("supervisor_said", True, {"33"}).at(20.0)
    asked = len(story.asked())
    story.call("supervisor_said", False, set()).at(30.0)  # reset by a person
    assert len(story.call("supervisor_said", False, set()).asked()) == asked


def test_block_is_answered_once_the_supervisor_says_so_for_this_device(alone):
    story = alone().ask(BLOCK)
    assert story.asked() == [BLOCKED]
    for blocked, whose, answers in (
        (True, "34", []),  # blocked, but for another
        (False, "33", []),  # known, but not in force
        (True, "33", ["SUCCESS"]),
    ):
        assert story.call("supervisor_said", blocked, {whose}).answers() == answers


def test_release_is_answered_once_the_supervisor_has_let_go(alone):
    story = alone().ask(BLOCK).call("supervisor_said", True, {"33"}).at(1.0).ask(RELEASE, number=1)
    assert story.asked() == [BLOCKED, RELEASED]
    assert story.answers() == ["SUCCESS"]
    assert story.call("supervisor_said", False, set()).answers() == ["SUCCESS"] * 2


def test_supervisor_that_has_not_heard_is_asked_again(alone):
    story = alone().ask(BLOCK).at(0.1).call("supervisor_said", False, set())
    assert len(story.asked()) == 1  # too soon to wonder
    assert story.at(0.6).call("supervisor_said", False, set()).asked() == [BLOCKED] * 2


def test_supervisor_that_started_anew_or_missed_a_release_is_told(bench, alone):
    story = bench("").status("ABNORMAL").at(2.0).clear()
    assert story.standing == {"33"}
    story.standing.clear()
    assert story.supervisor_says().step().asked() == [BLOCKED]
    assert story.standing == {"33"}
    story = alone().ask(BLOCK).at(0.1).ask(RELEASE, number=1).clear().at(1.0)
    assert story.call("supervisor_said", True, {"33"}).asked() == [RELEASED]


def test_block_from_before_we_started_stands_until_its_device_is_ready(alone):
    """A link that starts anew knows nothing: that is no reason to let the vehicle fly."""
    story = alone()
    for t in (0.0, 1.0, 2.0):
        story.at(t).call("supervisor_said", True, {"33"})
    assert story.asked() == []
    story.status("ABNORMAL").after(1.0).call("supervisor_said", True, {"33"})
    assert RELEASED not in story.asked()
    story = alone().status("READY").call("supervisor_said", True, {"33"})
    assert story.asked() == [RELEASED]


def test_block_and_release_follow_the_state_when_their_request_was_lost(alone):
    for state in ("NOT_READY", "ABNORMAL"):
        story = alone().status(state)
        assert story.asked() == [BLOCKED], state
        assert story.asks[0][1].reason == f"it is {state}"
        assert len(story.at(0.1).status(state).asked()) == 1
    for state in ("READY", "TAKEOFF", "ARMED"):
        story = alone().status("ABNORMAL").at(0.1).status(state)
        assert story.asked() == [BLOCKED, RELEASED], state
    for state in ("LAUNCHED", "TOUCHDOWN"):
        story = alone().status("ABNORMAL").at(0.1).status(state).at(3.0).status(state)
        assert story.asked() == [BLOCKED], "one whose parachute is out releases nothing"


def test_state_without_a_name_changes_nothing(alone):
    story = alone().status("ABNORMAL").clear()
    free = next(n for n in range(8) if story.definitions.state(n) is None)
    story.puppet(33).broadcast("flyfire.ParachuteStatus", {"state": free})
    story.deliver(story.puppet(33)).after(0.5).supervisor_says()
    assert ("FLIGHT_BLOCK_RELEASE", "33") not in story.asked()


def test_late_repetition_of_a_block_does_not_stay_when_the_state_is_ready(alone):
    story = alone().status("NOT_READY").at(0.5).status("READY").at(0.6).ask(BLOCK).clear()
    for tenth in range(7, 30):
        story.at(tenth / 10).status("READY")
    ((t, ask),) = story.asks
    assert ask.ask.name == "FLIGHT_BLOCK_RELEASE"
    assert 1.5 <= t <= 1.7


def test_request_of_the_state_or_of_another_is_passed_on_once(alone):
    # Request that the state has said before is not passed on twice.
    story = alone().status("NOT_READY").ask(BLOCK)
    assert story.asked() == [BLOCKED]
    assert story.call("supervisor_said", True, {"33"}).answers() == ["SUCCESS"]
    # Two controllers block each for itself.
    story = alone().status("ABNORMAL").status("ABNORMAL", 35).at(1.0).status("READY")
    assert story.asked() == [BLOCKED, ("FLIGHT_BLOCK", "35"), RELEASED]


@TYPES
def test_policy_accept_or_reject_answers_at_once_and_forward_waits(alone, type_name):
    story = alone(kill_policy=Policy.ACCEPT, flight_block_policy=Policy.ACCEPT).ask(type_name)
    assert (story.answers(), len(story.asked())) == (["SUCCESS"], 1)
    story = alone(kill_policy=Policy.REJECT, flight_block_policy=Policy.REJECT).ask(type_name)
    assert (story.status("ABNORMAL").answers(), story.asked()) == (["REJECTED"], [])
    story = alone().ask(BLOCK).call("supervisor_said", True, {"33"}).at(1.0).clear()
    story.ask(type_name, number=5)
    if type_name == BLOCK:
        assert story.answers() == ["SUCCESS"]  # it stands
    else:
        assert (story.answers(), len(story.asked())) == ([], 1)


def test_one_policy_does_not_touch_the_other(alone):
    story = alone(kill_policy=Policy.REJECT).ask(KILL).ask(BLOCK, number=1)
    assert (story.answers(), story.asked()) == (["REJECTED"], [BLOCKED])


def test_bad_magic_number_is_rejected_and_counted(alone):
    story = alone().ask(KILL, magic_number=1)
    wanted = {"ours": "BAD_MAGIC_NUMBER", "other": "REJECTED"}[story.layout.name]
    assert story.answers() == [wanted]
    assert story.asked() == []
    assert story.link.counts["requests with a bad magic number"] == 1


def test_type_that_is_not_known_is_rejected_and_counted(alone):
    story = alone().ask(KILL, type=99)
    assert story.answers() == ["REJECTED"]
    assert story.asked() == []
    assert story.link.counts["requests of an unknown type"] == 1
    assert story.link.vehicle_service.newest_answer == "bad request of 33: REJECTED"


def test_service_that_the_vehicle_does_not_offer_is_counted(alone):
    story = alone()
    puppet = story.puppet(33)
    puppet.request(US, "flyfire.TriggerService", 0, {}, 16)
    story.deliver(puppet)
    assert story.link.counts["requests that this node does not serve"] == 1


def test_flood_of_requests_is_bounded_and_answered(alone):
    story = alone()
    for number in range(100):
        story.ask(KILL, node_id=40 + number % 50, number=number % 32)
    assert story.answers() == [failed(story)] * (100 - MOST_PENDING)
    assert story.link.counts["requests refused: too many at once"] == 100 - MOST_PENDING
    assert len(story.asked()) == 100  # the supervisor hears of each all the same
    story.call("kill_confirmed")
    assert story.step().answers().count("SUCCESS") == MOST_PENDING


def test_controller_blocks_while_it_starts_and_releases_when_it_is_ready(bench):
    story = bench("controller").at(2.0)
    assert story.asked() == [("FLIGHT_BLOCK", "33"), ("FLIGHT_BLOCK_RELEASE", "33")]
    assert set(story.answers()) == {"SUCCESS"}
    assert story.standing == set()


def test_controller_that_fails_blocks_until_it_is_whole():
    story = Bench(layout_of("ours"), "controller").ready()
    story.devices.act("error=IMU")
    assert story.after(0.2).standing == {"33"}
    assert story.picture().state.name == "ABNORMAL"
    story.devices.act("clear-errors")
    assert story.after(0.2).standing == set()
