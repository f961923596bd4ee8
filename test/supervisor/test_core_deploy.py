"""A person's deploy: refused for stated reasons, the kill first, each step until confirmed."""

import pytest
from story import LINK, Story, parachute

from chute_ros.model import Action, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage

K, D = Action.KILL, Action.DEPLOY


def out(link: str = LINK, device: str = "1/161", deployed: bool = True) -> i.ParachuteReport:
    return parachute(link, device, deployed, ())


def deploying(config: SupervisorConfig | None = None) -> Story:
    """In flight, deploy asked for at t = 1 (token 5), the kill confirmed at 1.1."""
    story = Story(config or SupervisorConfig()).flying()
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYING
    return story


def test_on_the_ground_it_is_refused_with_the_reason() -> None:
    story = Story().ready()
    story.at(0.1, i.DeployRequest(1, False, "no"))
    answer = story.answer(1)
    assert not answer.success
    assert "READY, not in flight; force" in answer.message
    assert story.decisions(K) == []
    assert story.decisions(D) == []


def test_on_the_ground_force_deploys_all_the_same_kill_first() -> None:
    story = Story().ready()
    story.at(0.1, i.DeployRequest(1, True, "test"))
    assert story.state.stage is Stage.KILLING
    story.at(0.2, story.report(K, Outcome.CONFIRMED))
    assert "operator, forced: test" in story.newest(D).reasons[0]


def test_the_deploy_follows_the_kill_at_its_confirmation() -> None:
    story = deploying()
    assert story.when(K) == 1.0
    assert story.when(D) == 1.1
    assert story.newest(D).id > story.newest(K).id
    assert "kill confirmed after 0.10 s (limit 0.5 s)" in story.newest(D).reasons[1]


def test_the_deploy_follows_the_kill_after_the_delay_without_confirmation() -> None:
    story = Story().flying()
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(3.0)
    assert story.when(D) == pytest.approx(1.5)
    assert "kill not confirmed after 0.50 s" in story.newest(D).reasons[1]


@pytest.mark.parametrize("outcome", [Outcome.SENT, Outcome.ACCEPTED, Outcome.FAILED])
def test_less_than_a_confirmation_waits_for_the_delay(outcome: Outcome) -> None:
    story = Story().flying()
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.report(K, outcome))
    story.at(1.4)
    assert story.decisions(D) == []
    story.at(1.6)
    assert len(story.decisions(D)) == 1


def test_success_is_the_devices_own_confirmation() -> None:
    story = deploying()
    story.at(1.2, story.report(D, Outcome.SENT))
    story.at(1.3, story.report(D, Outcome.ACCEPTED))
    assert story.answers(5) == []
    story.at(1.4, story.report(D, Outcome.CONFIRMED, detail="PARACHUTE_STATUS reports deployed"))
    assert story.state.stage is Stage.DEPLOYED
    answer = story.answer(5)
    assert answer.success
    assert answer.accepted
    assert "PARACHUTE_STATUS reports deployed" in answer.message


def test_a_status_that_says_released_is_believed_and_the_report_awaited_for_the_answer() -> None:
    story = deploying()
    story.at(1.2, out())
    assert story.state.stage is Stage.DEPLOYED
    assert story.answers(5) == []
    story.at(1.25, story.report(D, Outcome.ACCEPTED), story.report(D, Outcome.CONFIRMED))
    assert story.answer(5).accepted


def test_the_answer_does_not_wait_for_a_report_for_ever() -> None:
    story = deploying()
    story.at(1.2, out())
    story.at(3.0)
    answer = story.answer(5)
    assert answer.success
    assert not answer.accepted


def test_a_failure_after_the_acknowledgement_is_a_fault_and_says_accepted() -> None:
    story = deploying()
    story.at(1.2, story.report(D, Outcome.ACCEPTED))
    story.at(6.0, story.report(D, Outcome.FAILED, detail="never showed"))
    assert story.state.stage is Stage.FAULT
    answer = story.answer(5)
    assert (answer.success, answer.accepted) == (False, True)
    assert "never showed" in answer.message
    assert "no parachute confirmed" in story.alarms()[0]


def test_no_report_at_all_is_a_fault_after_the_limit() -> None:
    story = deploying()
    story.at(9.0)
    assert story.state.stage is Stage.DEPLOYING
    story.at(9.2)
    assert story.state.stage is Stage.FAULT
    assert "no device node reported" in story.answer(5).message


def test_one_failed_parachute_of_two_is_no_failure_while_the_other_may_come() -> None:
    config = SupervisorConfig(deploy_links=(LINK, "upf_can"))
    story = deploying(config)
    story.at(1.2, story.report(D, Outcome.FAILED))
    assert story.state.stage is Stage.DEPLOYING
    story.at(1.3, story.report(D, Outcome.CONFIRMED, link="upf_can"))
    assert story.state.stage is Stage.DEPLOYED


def test_a_failure_reported_after_the_confirmation_undoes_nothing() -> None:
    story = deploying()
    story.at(1.2, story.report(D, Outcome.CONFIRMED))
    story.at(1.3, story.report(D, Outcome.FAILED))
    assert story.state.stage is Stage.DEPLOYED


def test_a_second_parachute_on_the_same_link_does_not_hide_the_first() -> None:
    story = deploying()
    story.at(1.2, out(device="1/161"), out(device="1/162", deployed=False))
    assert story.state.stage is Stage.DEPLOYED


def test_after_a_fault_a_person_may_try_again_and_a_late_parachute_still_counts() -> None:
    story = deploying()
    story.at(1.2, story.report(D, Outcome.FAILED))
    assert story.state.stage is Stage.FAULT
    story.at(2.0, i.DeployRequest(6, False, "again"))
    story.at(2.1, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 2
    story.at(2.2, out())
    story.at(3.0)
    assert story.answer(6).success


def test_a_second_caller_joins_and_both_are_answered_and_it_fires_once() -> None:
    story = deploying()
    story.at(1.2, i.DeployRequest(6, False, "me too"))
    story.at(1.3, story.report(D, Outcome.CONFIRMED))
    assert story.answer(5).success
    assert story.answer(6).success
    assert len(story.decisions(D)) == 1


def test_a_parachute_that_is_out_is_not_deployed_again() -> None:
    story = deploying()
    story.at(1.2, story.report(D, Outcome.CONFIRMED))
    story.at(2.0, i.DeployRequest(6, True, "again"))
    assert "out already" in story.answer(6).message
    assert len(story.decisions(D)) == 1


def test_a_deploy_after_a_kill_alone_leaves_at_once_when_the_delay_is_over() -> None:
    story = Story().flying()
    story.at(1.0, i.KillRequest(4, "operator", "stop"))
    story.at(2.0)
    assert story.decisions(D) == []
    story.at(2.0, i.DeployRequest(5, False, "now this"))
    assert story.when(D) == 2.0
    assert len(story.decisions(K)) == 1


def test_a_decision_is_sent_again_until_a_node_reports_and_with_the_same_number() -> None:
    story = deploying()
    story.at(1.45)
    again = [o for _, o in story.outputs if isinstance(o, i.Decide) and o.again]
    deploys = [o.decision for o in again if o.decision.action is D]
    assert len(deploys) == 10
    assert {d.id for d in deploys} == {story.newest(D).id}
    story.at(1.46, story.report(D, Outcome.SENT))
    count = len(story.outputs)
    story.at(2.5)
    assert not [o for _, o in story.outputs[count:] if isinstance(o, i.Decide)]


@pytest.mark.parametrize("delay", [0.42, 0.5, 0.53, 0.57])
def test_a_kill_that_is_not_reported_is_said_again_before_each_deploy(delay: float) -> None:
    """The node is dead, and may be started again between any two of them."""
    story = Story(SupervisorConfig(kill_to_deploy_delay=delay)).flying()
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(2.4)
    decided = [(t, o) for t, o in story.outputs if isinstance(o, i.Decide) and o.again]
    again = [(t, o.decision.action) for t, o in decided if t > story.when(D)]
    deploys = [number for number, (_, action) in enumerate(again) if action is D]
    assert len(deploys) >= 5
    assert all(again[number - 1] == (again[number][0], K) for number in deploys)
    kills = [t for t, action in again if action is K]
    assert len(kills) <= len(deploys) + 1, "and not more often than that"


def test_a_node_that_restarts_in_between_hears_of_it_under_a_new_number() -> None:
    story = deploying()
    story.at(1.2, story.report(D, Outcome.SENT))
    story.seq = -1
    story.at(1.3, story.heartbeat())
    assert len(story.decisions(D)) == 2


def test_a_node_that_restarts_after_a_failed_deploy_fires_nothing() -> None:
    story = deploying()
    story.at(1.2, story.report(D, Outcome.FAILED))
    story.seq = -1
    story.at(60.0, story.heartbeat())
    assert len(story.decisions(D)) == 1
    assert len(story.decisions(K)) == 1


def test_a_node_that_restarts_after_the_confirmation_is_not_asked_again() -> None:
    story = deploying()
    story.at(1.2, story.report(D, Outcome.CONFIRMED))
    story.seq = -1
    story.at(1.3, story.heartbeat())
    assert len(story.decisions(D)) == 1


def test_a_report_for_an_older_decision_confirms_nothing() -> None:
    story = deploying()
    kill = story.newest(K)
    story.at(1.2, i.ActionReport(kill.epoch, kill.id, LINK, Outcome.CONFIRMED, "old", kill.epoch))
    story.at(1.2, i.ActionReport(6, story.newest(D).id, LINK, Outcome.CONFIRMED, "old", 6))
    assert story.state.stage is Stage.DEPLOYING


def test_a_report_of_a_link_that_was_not_asked_confirms_nothing() -> None:
    story = deploying()
    story.at(1.2, story.report(D, Outcome.CONFIRMED, link="stranger"))
    assert story.state.stage is Stage.DEPLOYING


def test_a_parachute_that_opens_by_itself_in_flight_stops_the_motors() -> None:
    story = Story().flying()
    story.at(1.0, out())
    assert story.state.stage is Stage.DEPLOYED
    assert story.newest(K).rule == "parachute open"
    assert story.decisions(D) == []


def test_a_released_parachute_on_the_ground_fires_nothing_and_is_named() -> None:
    story = Story().ready()
    story.at(0.1, out(), story.heartbeat(healthy=False))
    assert story.state.stage is Stage.BLOCKED
    assert "1/161 is released" in "; ".join(story.newest(Action.FLIGHT_BLOCK).reasons)
    assert story.decisions(K) == []


def test_what_a_lost_parachute_said_last_is_not_believed_and_it_is_deployed_all_the_same() -> None:
    story = Story().ready()
    story.at(0.1, out(), parachute(LINK, "1/161", True, (), alive=False))
    story.at(10.0, i.DeployRequest(5, True, "once more"))
    story.at(10.1, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 1
    assert story.answers(5) == []


def test_what_a_parachute_said_before_its_node_fell_silent_is_not_believed() -> None:
    story = Story().ready()
    story.at(0.1, out())
    story.at(10.0, i.DeployRequest(5, True, "once more"))
    story.at(10.1, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 1


def test_after_a_deploy_flight_stays_blocked_until_a_reset() -> None:
    story = deploying()
    story.at(1.2, story.report(D, Outcome.CONFIRMED))
    block = story.newest(Action.FLIGHT_BLOCK)
    assert "DEPLOYED: needs a reset" in "; ".join(block.reasons)


def test_a_kill_that_a_node_missed_goes_out_under_a_new_number_after_a_newer_decision() -> None:
    story = Story().flying()
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    first = story.newest(K)
    story.at(1.65)
    # Sent again under its number, which a node that has it takes for a repetition ...
    assert story.newest(K) == first
    # ... until one that saw the deploy first refuses it.
    story.at(1.66, story.report(K, Outcome.FAILED, detail="older"))
    assert story.newest(K).id > story.decisions(D)[0].id > first.id
    assert "saw a newer decision first" in story.newest(K).reasons[-1]
    story.at(1.7, story.report(K, Outcome.CONFIRMED), story.report(D, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYED


def test_a_new_number_for_a_missing_node_does_not_forget_what_the_other_said() -> None:
    both = (LINK, "upf_can")
    story = Story(SupervisorConfig(kill_links=both, deploy_links=both)).flying()
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    first = story.newest(K)
    refused = story.report(K, Outcome.FAILED, link="upf_can", detail="older")
    # It refuses each time that it was sent.
    story.at(1.3, refused, refused)
    again = story.newest(K)
    assert again.targets == ("upf_can",)
    assert len(story.decisions(K)) == 2
    # What the other still says of the first number counts.
    story.at(1.4, i.ActionReport(7, first.id, LINK, Outcome.FAILED, "late", 7))
    assert story.state.killing.kill is not None
    assert story.state.killing.kill.confirmed
    assert Outcome.FAILED in story.state.killing.kill.of(LINK)
    assert story.state.killing.kill.unreported() == ("upf_can",)
    # A number that was never ours does not.
    story.at(1.5, i.ActionReport(7, 99, "upf_can", Outcome.SENT, "?", 7))
    assert story.state.killing.kill.unreported() == ("upf_can",)
