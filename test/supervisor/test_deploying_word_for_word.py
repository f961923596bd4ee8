"""The deploy as it goes on, word for word."""

from types import MappingProxyType
from typing import Any

import pytest
from story import FLYING, LINK, SINKS, STANDING, Story, parachute, rule, with_rules

from chute_ros.model import Action, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkLimits
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import BelowMinimum

K, D = Action.KILL, Action.DEPLOY
UPF = "upf_can"
BOTH = (LINK, UPF)
DEPLOYS = rule(SINKS)
MINIMUM: dict[str, Any] = {"minimum_height": 10.0, "below_minimum": BelowMinimum.KILL}


def ordered(**settings: Any) -> Story:
    """In flight; a person asks for a deploy at 1.0 (token 5)."""
    story = Story(SupervisorConfig(**settings)).flying()
    story.at(0.9, story.heartbeat(), story.heartbeat(UPF))
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    return story


def deploying(**settings: Any) -> Story:
    """The same, the kill confirmed at 1.0 as well."""
    story = ordered(**settings)
    story.at(1.0, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYING
    return story


def failed(story: Story, link: str = LINK) -> i.ActionReport:
    return story.report(D, Outcome.FAILED, link, detail="denied")


def at_its_end(**settings: Any) -> Story:
    """The only step has failed at 1.5."""
    story = deploying(**settings)
    story.at(1.5, failed(story))
    assert story.state.stage is Stage.FAULT
    return story


def by_rule() -> Story:
    """In flight at 11 m, 10 m are needed; a rule deploys at 1.0."""
    story = Story(with_rules(DEPLOYS, profile=MINIMUM)).flying().fly(0.95, height=11.0)
    story.at(1.0, story.heartbeat(), story.told(height=11.0, vertical_speed=-13.0))
    assert story.state.stage is Stage.KILLING
    return story


# -- until it leaves -----------------------------------------------------------------------------


def test_the_log_names_every_parachute_that_is_out() -> None:
    story = Story(SupervisorConfig(deploy_links=BOTH)).flying()
    story.at(0.1, story.heartbeat(UPF), parachute(UPF, "33", True), parachute(deployed=True))
    assert (
        "IN_FLIGHT -> DEPLOYED: a parachute says that it was released "
        "(mavlink_parachute 1/161, upf_can 33 says deployed)"
    ) in story.said().splitlines()


@pytest.mark.parametrize(
    ("confirmed", "why"),
    [(True, "kill confirmed after 0.25 s"), (False, "kill not confirmed after 0.50 s")],
)
def test_the_deploy_says_how_the_kill_went(confirmed: bool, why: str) -> None:
    story = ordered()
    if confirmed:
        story.at(1.25, story.report(K, Outcome.CONFIRMED))
    story.at(1.55)
    assert story.newest(D).rule == "operator"
    assert story.newest(D).reasons == ("operator: it falls", f"{why} (limit 0.5 s)")
    assert (
        "KILLING -> DEPLOYING: the kill is confirmed or its time is over, "
        f"and a deploy follows ({why})"
    ) in story.said().splitlines()


def test_a_rule_that_got_too_low_while_the_kill_was_awaited_says_so() -> None:
    story = by_rule()
    story.at(1.2, story.told(height=9.0, vertical_speed=-13.0))
    story.at(1.6)
    low = "height 9.0 m is below the minimum 10 m"
    assert story.alarms() == [f"no deploy by rule 'tested' after the kill: {low}"]
    assert story.fired() == ["KILL"]
    assert (story.state.deploying.deploy_rule, story.state.deploying.deploy_reasons) == ("", ())
    story.at(60.0)
    assert story.fired() == ["KILL"], "and it is not pursued any more"
    assert len(story.alarms()) == 2
    assert "no kill confirmed" in story.alarms()[-1]


def test_a_person_deploys_also_below_the_minimum_height() -> None:
    story = Story(with_rules(profile=MINIMUM)).flying().fly(0.95, height=11.0)
    story.at(1.0, story.heartbeat(), i.DeployRequest(5, False, "it falls"))
    story.at(1.2, story.told(height=9.0, vertical_speed=-13.0))
    story.at(1.6)
    assert story.fired() == ["KILL", "DEPLOY"]


# -- its steps -----------------------------------------------------------------------------------


def test_a_step_says_why_it_was_taken() -> None:
    story = deploying(deploy_links=BOTH)
    story.alive(3.05, *BOTH)
    assert story.newest(D).rule == "operator"
    assert story.newest(D).reasons == (
        "operator: it falls",
        "step 1 of 2, mavlink_parachute: not confirmed: no device node reported (2.00 s)",
    )


def test_a_step_whose_node_is_silent_says_so() -> None:
    story = deploying(deploy_links=BOTH, deploy_ladder=(Rung(UPF, "trigger"), Rung(LINK)))
    story.alive(2.05, LINK)
    assert story.newest(D).targets == (LINK,)
    assert story.newest(D).reasons[-1] == (
        "step 1 of 2, upf_can:trigger: its node is silent (0.90 s)"
    )


def test_each_link_may_be_silent_for_its_own_time_and_its_step_ends_all_the_same() -> None:
    patient = MappingProxyType({LINK: LinkLimits(lost_after=2.0)})
    story = deploying(deploy_links=BOTH, link_limits=patient)
    story.at(1.0, story.heartbeat())
    story.alive(2.9, UPF)
    assert len(story.decisions(D)) == 1
    story.at(3.0, story.heartbeat(UPF))
    assert story.newest(D).reasons[-1] == (
        "step 1 of 2, mavlink_parachute: not confirmed: no device node reported (2.00 s)"
    )


def test_the_end_of_the_ladder_says_how_long_it_took() -> None:
    story = deploying(deploy_links=BOTH)
    story.at(1.25, story.heartbeat(), story.heartbeat(UPF), failed(story))
    story.at(1.5, failed(story, UPF))
    assert story.said().splitlines()[-2:] == [
        "DEPLOYING -> FAULT: no parachute confirmed in time (upf_can: denied)",
        "no parachute confirmed within 0.5 s: upf_can: denied",
    ]
    assert story.alarms() == ["no parachute confirmed within 0.5 s: upf_can: denied"]


# -- its end -------------------------------------------------------------------------------------


def test_the_alarm_is_said_again_with_its_words() -> None:
    story = at_its_end(alarm_interval=4.0)
    first = "no parachute confirmed within 0.5 s: mavlink_parachute: denied"
    story.at(1.6, i.VehicleReport(STANDING))
    story.at(5.4)
    assert story.alarms() == [first]
    story.at(9.6)
    assert story.alarms() == [first, *[f"still no parachute confirmed: {first}"] * 2]


def test_it_is_tried_again_with_the_first_rule_and_says_why() -> None:
    story = at_its_end()
    for tick in range(85):
        story.at(1.6 + tick * 0.1, story.heartbeat(), i.VehicleReport(FLYING))
    assert len(story.decisions(K)) == 2
    again = story.newest(K)
    assert again.rule == "operator"
    assert again.reasons == ("tried again 8.0 s after the ladder's end: it is still in the air",)


def test_a_link_that_comes_back_is_told_at_once() -> None:
    story = at_its_end()
    story.at(3.0, i.VehicleReport(FLYING), story.heartbeat())
    assert story.newest(K).reasons == (
        "tried again 1.5 s after the ladder's end: it is still in the air",
    )


def test_one_that_came_back_with_the_end_of_the_ladder_is_no_reason_to_try_again() -> None:
    story = deploying()
    story.at(1.1, story.report(D, Outcome.SENT))
    story.at(2.5, story.heartbeat(), failed(story))
    assert story.state.stage is Stage.FAULT
    story.at(2.6, i.VehicleReport(FLYING), story.heartbeat())
    assert len(story.decisions(K)) == 1


@pytest.mark.parametrize(("height", "fired"), [(9.0, 1), (11.0, 2)])
def test_a_rule_tries_again_only_above_the_minimum_height(height: float, fired: int) -> None:
    story = by_rule()
    story.at(1.1, story.heartbeat(), story.report(K, Outcome.CONFIRMED))
    story.at(1.2, story.heartbeat(), failed(story))
    assert story.state.stage is Stage.FAULT
    story.fly(10.0, height=height)
    assert len(story.decisions(K)) == fired
    assert {one.rule for one in story.decisions(K)} == {"tested"}


def test_a_person_is_tried_again_for_also_below_the_minimum_height() -> None:
    story = Story(with_rules(profile=MINIMUM)).flying().fly(0.95, height=11.0)
    story.at(1.0, story.heartbeat(), i.DeployRequest(5, False, "it falls"))
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, failed(story))
    story.fly(10.0, height=9.0)
    assert len(story.decisions(K)) == 2


def test_a_confirmation_that_comes_after_the_end_and_another_kill_counts() -> None:
    story = at_its_end()
    story.at(1.6, i.KillRequest(6, "operator", "stop"))
    story.at(1.7, story.report(D, Outcome.CONFIRMED, detail="deployed"))
    assert story.state.stage is Stage.DEPLOYED
    story.at(2.0, i.DeployRequest(7, False, "again"))
    assert "out already" in story.answer(7).message
    story.at(60.0)
    assert "still no parachute confirmed" not in story.said()


# -- its answer ----------------------------------------------------------------------------------


def test_the_answer_after_the_end_says_what_was_reported() -> None:
    story = deploying()
    story.at(1.1, story.report(D, Outcome.ACCEPTED, detail="acknowledged"), failed(story))
    assert story.answer(5) == i.Finish(
        5, False, True, "mavlink_parachute: acknowledged; mavlink_parachute: denied"
    )


def test_the_answer_after_an_end_without_a_report_says_so() -> None:
    story = deploying()
    story.at(9.1)
    assert story.answer(5) == i.Finish(5, False, False, "no device node reported")


def test_the_answer_after_a_parachute_is_out_has_the_words_of_its_node() -> None:
    story = deploying()
    story.at(1.1, story.report(D, Outcome.CONFIRMED, detail="deployed"))
    assert story.answer(5) == i.Finish(5, True, True, "mavlink_parachute: deployed")
    assert (
        "DEPLOYING -> DEPLOYED: a parachute says that it was released "
        "(mavlink_parachute: deployed)"
    ) in story.said().splitlines()


def test_the_answer_without_the_words_of_its_node_comes_after_its_wait() -> None:
    story = deploying(report_wait=1.0)
    story.at(1.25, parachute(deployed=True))
    story.at(2.2)
    assert story.answers(5) == []
    story.at(2.25)
    assert story.answer(5) == i.Finish(5, True, False, "its own status says deployed")


def test_a_parachute_that_is_out_before_any_step_was_taken_is_the_answer() -> None:
    story = ordered()
    story.at(1.1, parachute(deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    text = "WARNING, the motors may still turn (nobody reported): its own status says deployed"
    assert story.answer(5) == i.Finish(5, True, False, text)
