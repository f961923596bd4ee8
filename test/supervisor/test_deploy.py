"""A deploy: the kill first, each step of the ladder until its device confirms or its time is over,
no silence at its end, and the answer in its words."""

import itertools
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import pytest
from story import DOWN, FLYING, LINK, SINKS, STANDING, Story, parachute, rule, with_rules

from chute_ros.model import Action, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkLimits
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import BelowMinimum

K, D = Action.KILL, Action.DEPLOY
UPF = "upf_can"
BOTH = (LINK, UPF)
LADDER = (Rung(LINK), Rung(LINK, "1/162"), Rung(UPF), Rung(UPF, "trigger"))
ALL = [(rung.link, rung.device) for rung in LADDER]
MINIMUM: dict[str, Any] = {"minimum_height": 10.0, "below_minimum": BelowMinimum.KILL}


def ordered(**settings: Any) -> Story:
    """In flight, all links heard at 0.9; a person asks for a deploy at 1.0 (token 5)."""
    return Story(SupervisorConfig(**settings)).ordered(*BOTH)


def deploying(**settings: Any) -> Story:
    """The same, the kill confirmed at 1.0 as well."""
    return Story(SupervisorConfig(**settings)).deploying(*BOTH, confirmed=1.0)


def climbing(*ladder: Rung, **settings: Any) -> Story:
    """The same with a ladder, on two links."""
    return deploying(deploy_links=BOTH, deploy_ladder=ladder or LADDER, **settings)


def failed(story: Story, link: str = LINK) -> i.ActionReport:
    return story.report(D, Outcome.FAILED, link, detail="denied")


def at_its_end(**settings: Any) -> Story:
    """The only step has failed at 1.1."""
    story = deploying(**settings)
    story.at(1.1, failed(story))
    assert story.state.stage is Stage.FAULT
    return story


def by_rule() -> Story:
    """In flight at 11 m, 10 m are needed; a rule deploys at 1.0."""
    story = Story(with_rules(rule(SINKS), profile=MINIMUM)).flying().fly(0.95, height=11.0)
    story.at(1.0, story.heartbeat(), story.told(height=11.0, vertical_speed=-13.0))
    assert story.state.stage is Stage.KILLING
    return story


def steps(story: Story) -> list[tuple[str, str]]:
    """Link and device of every deploy, in their order."""
    return [(d.targets[0], d.device) for d in story.decisions(D)]


def alarm_times(story: Story) -> list[float]:
    return [
        t
        for t, o in story.outputs
        if isinstance(o, i.LogMessage) and o.alarm and "no parachute" in o.text
    ]


# -- until it leaves -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("outcome", "t", "why"),
    [
        (Outcome.CONFIRMED, 1.25, "kill confirmed after 0.25 s"),
        (None, 1.5, "kill not confirmed after 0.50 s"),
        (Outcome.SENT, 1.5, "kill not confirmed after 0.50 s"),
        (Outcome.ACCEPTED, 1.5, "kill not confirmed after 0.50 s"),
        (Outcome.FAILED, 1.5, "kill not confirmed after 0.50 s"),
    ],
)
def test_the_deploy_follows_the_kill_at_its_confirmation_or_after_the_delay_and_says_which(
    outcome, t, why
):
    story = ordered()
    if outcome is not None:
        story.at(1.25, story.report(K, outcome))
    story.at(1.55)
    assert (story.when(K), story.when(D)) == (1.0, pytest.approx(t))
    assert story.newest(D).id > story.newest(K).id
    assert story.newest(D).rule == "operator"
    assert story.newest(D).reasons == ("operator: it falls", f"{why} (limit 0.5 s)")
    assert (
        "KILLING -> DEPLOYING: the kill is confirmed or its time is over, "
        f"and a deploy follows ({why})"
    ) in story.said().splitlines()


def test_a_deploy_after_a_kill_alone_leaves_at_once_when_the_delay_is_over():
    story = Story().flying()
    story.at(1.0, i.KillRequest(4, "operator", "stop"))
    story.at(2.0)
    assert story.decisions(D) == []
    story.at(2.0, i.DeployRequest(5, False, "now this"))
    assert story.when(D) == 2.0
    assert len(story.decisions(K)) == 1


def test_a_rule_that_got_too_low_while_the_kill_was_awaited_says_so():
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


def test_a_person_deploys_also_below_the_minimum_height_and_is_tried_again_for():
    story = Story(with_rules(profile=MINIMUM)).flying().fly(0.95, height=11.0)
    story.at(1.0, story.heartbeat(), i.DeployRequest(5, False, "it falls"))
    story.at(1.2, story.told(height=9.0, vertical_speed=-13.0))
    story.at(1.6)
    assert story.fired() == ["KILL", "DEPLOY"]
    story.at(1.7, story.report(K, Outcome.CONFIRMED), failed(story))
    story.fly(10.5, height=9.0)
    assert len(story.decisions(K)) == 2


# -- sent until it is reported -------------------------------------------------------------------


def test_a_decision_is_sent_again_until_a_node_reports_and_with_the_same_number():
    story = Story().deploying()
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
def test_a_kill_that_is_not_reported_is_said_again_before_each_deploy(delay):
    """The node is dead, and may be started again between any two of them."""
    story = Story(SupervisorConfig(kill_to_deploy_delay=delay)).ordered()
    story.at(2.4)
    left = story.sent(K, D, start=story.when(D))
    assert [(action, again) for _, action, again in left[:2]] == [(K, True), (D, False)]
    deploys = [number for number, (_, action, _) in enumerate(left) if action is D]
    assert len(deploys) >= 6
    assert all(left[number - 1] == (left[number][0], K, True) for number in deploys)
    kills = [t for t, action, _ in left if action is K]
    assert len(kills) <= len(deploys) + 1, "and not more often than that"


@pytest.mark.parametrize(
    ("outcome", "t", "deploys"),
    [(Outcome.SENT, 1.3, 2), (Outcome.FAILED, 60.0, 1), (Outcome.CONFIRMED, 1.3, 1)],
)
def test_a_node_that_restarts_hears_of_what_still_goes_on_under_a_new_number(outcome, t, deploys):
    story = Story().deploying()
    story.at(1.2, story.report(D, outcome))
    story.seq = -1
    story.at(t, story.heartbeat())
    assert (len(story.decisions(D)), len(story.decisions(K))) == (deploys, 1)


def test_a_new_number_for_a_missing_node_does_not_forget_what_the_other_said():
    story = Story(SupervisorConfig(kill_links=BOTH, deploy_links=BOTH)).ordered()
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    first = story.newest(K)
    refused = story.report(K, Outcome.FAILED, link=UPF, detail="older")
    # It refuses each time that it was sent.
    story.at(1.3, refused, refused)
    assert story.newest(K).targets == (UPF,)
    assert len(story.decisions(K)) == 2
    # What the other still says of the first number counts.
    story.at(1.4, i.ActionReport(7, first.id, LINK, Outcome.FAILED, "late", 7))
    assert story.state.killing.kill is not None
    assert story.state.killing.kill.confirmed
    assert Outcome.FAILED in story.state.killing.kill.of(LINK)
    assert story.state.killing.kill.unreported() == (UPF,)
    # A number that was never ours does not.
    story.at(1.5, i.ActionReport(7, 99, UPF, Outcome.SENT, "?", 7))
    assert story.state.killing.kill.unreported() == (UPF,)


# -- what confirms it ----------------------------------------------------------------------------


def test_success_is_the_devices_own_confirmation_and_flight_is_blocked_until_a_reset():
    story = Story().deploying()
    story.at(1.2, story.report(D, Outcome.SENT))
    story.at(1.3, story.report(D, Outcome.ACCEPTED))
    assert story.answers(5) == []
    story.at(1.4, story.report(D, Outcome.CONFIRMED, detail="deployed"))
    text = "mavlink_parachute: told; mavlink_parachute: deployed"
    assert story.answer(5) == i.Finish(5, True, True, text)
    assert (
        f"DEPLOYING -> DEPLOYED: a parachute says that it was released ({text})"
        in story.said().splitlines()
    )
    block = story.newest(Action.FLIGHT_BLOCK)
    assert "DEPLOYED: needs a reset" in "; ".join(block.reasons)
    story.at(1.5, story.report(D, Outcome.FAILED))
    assert story.state.stage is Stage.DEPLOYED, "a later failure undoes nothing"


def test_a_status_that_says_released_is_believed_and_the_report_awaited_for_the_answer():
    story = Story().deploying()
    story.at(1.2, parachute(deployed=True), parachute(device="1/162"))
    assert story.state.stage is Stage.DEPLOYED, "the second does not hide the first"
    assert story.answers(5) == []
    story.at(1.25, story.report(D, Outcome.ACCEPTED), story.report(D, Outcome.CONFIRMED))
    assert story.answer(5).accepted
    story = deploying(report_wait=1.0)
    story.at(1.25, parachute(deployed=True))
    story.at(2.2)
    assert story.answers(5) == []
    story.at(2.25)
    assert story.answer(5) == i.Finish(5, True, False, "its own status says deployed")


def test_one_failed_parachute_of_two_is_no_failure_while_the_other_may_come():
    story = deploying(deploy_links=BOTH)
    story.at(1.2, failed(story))
    assert story.state.stage is Stage.DEPLOYING
    story.at(1.3, story.report(D, Outcome.CONFIRMED, link=UPF))
    assert story.state.stage is Stage.DEPLOYED


def test_a_second_caller_joins_and_both_are_answered_and_it_fires_once():
    story = Story().deploying()
    story.at(1.2, i.DeployRequest(6, False, "me too"))
    story.at(1.3, story.report(D, Outcome.CONFIRMED))
    assert story.answer(5).success
    assert story.answer(6).success
    assert len(story.decisions(D)) == 1


@pytest.mark.parametrize(
    ("epoch", "number", "link"),
    [
        (7, 1, LINK),
        (7, 2, LINK),
        (7, 999, LINK),
        (6, None, LINK),
        (7, None, UPF),
        (7, None, "stranger"),
    ],
)
def test_a_confirmation_of_another_number_or_link_confirms_nothing(epoch, number, link):
    story = climbing()
    assert story.newest(K).id == 2
    told = story.newest(D).id if number is None else number
    story.at(1.1, i.ActionReport(epoch, told, link, Outcome.CONFIRMED, "out", 7, told))
    assert story.state.stage is Stage.DEPLOYING


def test_a_kill_that_is_confirmed_late_is_no_confirmation_of_the_deploy():
    story = Story().ordered()
    story.at(1.6)
    assert story.state.stage is Stage.DEPLOYING
    story.at(1.7, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYING


def test_a_parachute_that_is_out_before_any_step_was_taken_is_the_answer():
    story = ordered()
    story.at(1.1, parachute(deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    text = "WARNING, the motors may still turn (nobody reported): its own status says deployed"
    assert story.answer(5) == i.Finish(5, True, False, text)


def test_a_parachute_that_opens_by_itself_in_flight_stops_the_motors_and_all_are_named():
    story = Story(SupervisorConfig(deploy_links=BOTH)).flying()
    story.at(0.1, story.heartbeat(UPF), parachute(UPF, "33", True), parachute(deployed=True))
    assert story.newest(K).rule == "parachute open"
    assert story.decisions(D) == []
    assert (
        "IN_FLIGHT -> DEPLOYED: a parachute says that it was released "
        "(mavlink_parachute 1/161, upf_can 33 says deployed)"
    ) in story.said().splitlines()


def test_a_released_parachute_on_the_ground_fires_nothing_and_is_named():
    story = Story().ready()
    story.at(0.1, parachute(deployed=True), story.heartbeat(healthy=False))
    assert story.state.stage is Stage.BLOCKED
    assert "1/161 is released" in "; ".join(story.newest(Action.FLIGHT_BLOCK).reasons)
    assert story.decisions(K) == []


@pytest.mark.parametrize("alive", [True, False])
def test_what_was_said_before_a_parachute_or_its_node_fell_silent_is_not_believed(alive):
    story = Story().ready()
    story.at(0.1, parachute(deployed=True), parachute(deployed=True, alive=alive))
    story.at(10.0, i.DeployRequest(5, True, "once more"))
    story.at(10.1, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 1
    assert story.answers(5) == []


# -- the steps of the ladder ---------------------------------------------------------------------


def test_the_whole_ladder_is_climbed_step_by_step_to_the_triggers_themselves():
    story = climbing()
    story.alive(2.9, *BOTH)
    assert steps(story) == ALL[:1]
    assert story.newest(D).targets == (LINK,)
    story.alive(7.05, *BOTH)
    assert steps(story) == ALL
    assert story.newest(D).targets == (UPF,)
    times = [t for t, _, again in story.sent(D) if not again]
    assert times == pytest.approx([1.0, 3.0, 5.0, 7.0])


LAUNCHES = i.KillRequest(0, f"{UPF} 33", "it is about to launch (TYPE_KILLSWITCH)")


def launching(deploy_at: float, ask_at: float = 1.0, by: str = f"{UPF} 33") -> Story:
    """A device asks for the kill at ask_at, and a person for a deploy at deploy_at; the kill is
    confirmed at 1.3."""
    story = Story(SupervisorConfig(deploy_links=BOTH, deploy_ladder=LADDER)).flying()
    story.alive(0.9, *BOTH)
    deploy = i.DeployRequest(5, False, "it falls")
    asked = [(ask_at, replace(LAUNCHES, by=by)), (deploy_at, deploy)]
    for t, request in sorted(asked, key=lambda one: one[0]):
        story.alive(t - 0.04, *BOTH)
        story.at(t, request)
    story.alive(1.26, *BOTH)
    story.at(max(1.3, story.t), story.report(K, Outcome.CONFIRMED))
    return story


@pytest.mark.parametrize("deploy_at", [0.95, 1.1, 1.9])
def test_beside_a_parachute_that_launches_itself_no_other_is_released(deploy_at):
    """Its step is the first, also where the deploy was wanted before it asked for the kill."""
    story = launching(deploy_at)
    assert steps(story) == [(UPF, "")]
    told = "upf_can 33 asks for the kill to launch by itself: its step is the first"
    assert told in story.newest(D).reasons[-1]
    story.at(story.t + 0.1, parachute(UPF, "33", deployed=True))
    story.alive(12.0, *BOTH)
    assert story.state.stage is Stage.DEPLOYED
    assert steps(story) == [(UPF, "")]


def test_one_that_was_about_to_launch_and_does_not_come_out_is_followed_by_the_others():
    story = launching(1.1)
    story.alive(3.25, *BOTH)
    assert steps(story) == [(UPF, "")]
    story.alive(8.0, *BOTH)
    assert steps(story) == [(UPF, ""), (LINK, ""), (LINK, "1/162"), (UPF, "trigger")]


@pytest.mark.parametrize(("deploy_at", "by"), [(2.05, f"{UPF} 33"), (1.1, "umbilical 1")])
def test_one_that_asked_long_ago_or_is_on_no_step_changes_none(deploy_at, by):
    assert steps(launching(deploy_at, by=by)) == ALL[:1]


def test_of_two_on_one_link_the_one_that_launches_itself_is_the_first():
    assert steps(launching(1.1, by=f"{LINK} 1/162"))[0] == (LINK, "1/162")


@pytest.mark.parametrize("outcome", [Outcome.SENT, Outcome.ACCEPTED])
def test_an_ack_is_no_confirmation(outcome):
    story = climbing()
    for n in range(19):
        story.at(1.05 + n * 0.1, story.heartbeat(), story.report(D, outcome))
    assert steps(story) == ALL[:1]
    assert story.state.stage is Stage.DEPLOYING
    story.alive(3.05, *BOTH)
    assert steps(story) == ALL[:2]


@pytest.mark.parametrize("number", range(4))
def test_the_step_that_is_confirmed_is_the_last(number):
    story = climbing()
    for _ in range(number):
        story.at(story.t + 0.1, story.report(D, Outcome.FAILED, steps(story)[-1][0]))
    story.at(story.t + 0.1, story.report(D, Outcome.CONFIRMED, steps(story)[-1][0]))
    assert story.state.stage is Stage.DEPLOYED
    story.at(story.t + 60.0)
    assert steps(story) == ALL[: number + 1]
    assert story.answer(5).success
    assert "still no parachute confirmed" not in story.said()


def test_an_earlier_step_that_confirms_late_or_any_parachutes_status_ends_the_climb():
    for late in (True, False):
        story = climbing()
        first = story.newest(D)
        story.alive(3.05, *BOTH)
        confirms = i.ActionReport(first.epoch, first.id, LINK, Outcome.CONFIRMED, "out")
        story.at(3.1, confirms if late else parachute(UPF, "33", deployed=True))
        assert story.state.stage is Stage.DEPLOYED
        story.at(60.0)
        assert steps(story) == ALL[:2]


def test_the_last_step_goes_on_though_its_device_refuses_for_now():
    story = climbing(Rung(LINK))
    story.at(1.1, story.report(D, Outcome.REFUSED, detail="temporarily rejected"))
    (deploy,) = story.state.deploying.deploys
    assert not deploy.reached(Outcome.SENT), "a refusal is no step forward"
    assert not deploy.all_failed()
    story.alive(8.9, *BOTH)
    assert story.state.stage is Stage.DEPLOYING
    assert story.answers(5) == []
    story.at(8.9, story.report(D, Outcome.ACCEPTED), story.report(D, Outcome.CONFIRMED))
    assert story.answer(5).success


def test_a_ladder_of_silent_nodes_is_sent_at_once_and_the_last_step_awaited():
    story = Story(SupervisorConfig(deploy_links=BOTH, deploy_ladder=LADDER)).flying()
    story.at(30.0, i.DeployRequest(5, False, "it falls"))
    story.at(30.5)
    assert steps(story) == ALL
    story.at(38.4)
    assert story.state.stage is Stage.DEPLOYING
    story.at(38.6)
    assert story.state.stage is Stage.FAULT


def test_each_step_says_why_it_was_taken():
    story = deploying(deploy_links=BOTH)
    story.alive(3.05, *BOTH)
    assert story.newest(D).rule == "operator"
    assert story.newest(D).reasons == (
        "operator: it falls",
        "step 1 of 2, mavlink_parachute: not confirmed: no device node reported (2.00 s)",
    )
    story = climbing()
    story.at(1.1, story.report(D, Outcome.SENT))
    story.alive(3.05, *BOTH)
    assert story.newest(D).reasons[-1] == (
        "step 1 of 4, mavlink_parachute: not confirmed: mavlink_parachute: told (2.00 s)"
    )
    story = climbing()
    story.at(1.3, failed(story))
    assert steps(story) == ALL[:2], "at once"
    assert story.newest(D).reasons[-1] == (
        "step 1 of 4, mavlink_parachute: not confirmed: mavlink_parachute: denied (0.30 s)"
    )
    story = climbing(Rung(UPF, "trigger"), Rung(LINK))
    story.alive(2.05, LINK)
    assert steps(story) == [(UPF, "trigger"), (LINK, "")]
    assert story.newest(D).reasons[-1] == (
        "step 1 of 2, upf_can:trigger: its node is silent (0.90 s)"
    )


def test_a_step_whose_device_refuses_for_now_is_followed_at_once_and_may_still_confirm():
    story = climbing()
    first = story.newest(D)
    story.at(1.1, story.report(D, Outcome.SENT))
    story.at(1.3, story.report(D, Outcome.REFUSED, detail="temporarily rejected"))
    assert steps(story) == ALL[:2]
    why = (
        "not confirmed: mavlink_parachute: told; mavlink_parachute: temporarily rejected (0.30 s)"
    )
    assert why in story.newest(D).reasons[-1]
    story.at(1.4, i.ActionReport(first.epoch, first.id, LINK, Outcome.CONFIRMED, "out"))
    assert story.state.stage is Stage.DEPLOYED
    story.at(60.0)
    assert steps(story) == ALL[:2]


def test_each_link_may_be_silent_for_its_own_time_and_its_step_ends_all_the_same():
    patient = MappingProxyType({LINK: LinkLimits(lost_after=2.0)})
    story = deploying(deploy_links=BOTH, link_limits=patient)
    story.at(1.0, story.heartbeat())
    story.alive(2.9, UPF)
    assert len(story.decisions(D)) == 1
    story.at(3.0, story.heartbeat(UPF))
    assert story.newest(D).reasons[-1] == (
        "step 1 of 2, mavlink_parachute: not confirmed: no device node reported (2.00 s)"
    )


# -- its end without a parachute -----------------------------------------------------------------


def test_the_end_of_the_ladder_says_how_long_it_took():
    story = deploying(deploy_links=BOTH)
    story.at(1.25, story.heartbeat(), story.heartbeat(UPF), failed(story))
    story.at(1.5, failed(story, UPF))
    assert story.said().splitlines()[-2:] == [
        "DEPLOYING -> FAULT: no parachute confirmed in time (upf_can: denied)",
        "no parachute confirmed within 0.5 s: upf_can: denied",
    ]
    assert story.alarms() == ["no parachute confirmed within 0.5 s: upf_can: denied"]


def test_the_answer_after_the_end_says_what_was_reported():
    story = deploying()
    story.at(1.1, story.report(D, Outcome.ACCEPTED, detail="acknowledged"), failed(story))
    assert story.answer(5) == i.Finish(
        5, False, True, "mavlink_parachute: acknowledged; mavlink_parachute: denied"
    )
    assert "no parachute confirmed" in story.alarms()[0]


@pytest.mark.parametrize("limit", [8.0, 4.0])
def test_without_a_report_the_last_step_ends_after_its_own_limit_and_says_so(limit):
    story = deploying(deploy_timeout=limit)
    story.alive(0.95 + limit)
    assert story.state.stage is Stage.DEPLOYING
    story.alive(1.1 + limit)
    assert story.state.stage is Stage.FAULT
    assert story.answer(5) == i.Finish(5, False, False, "no device node reported")
    text = f"no parachute confirmed within {limit:.1f} s: no device node reported"
    assert story.alarms()[-1] == text


def test_its_end_is_an_alarm_that_does_not_stop():
    story = at_its_end(alarm_interval=4.0)
    first = "no parachute confirmed within 0.1 s: mavlink_parachute: denied"
    story.at(1.2, i.VehicleReport(STANDING))
    story.at(5.0)
    assert story.alarms() == [first]
    story.at(9.2)
    assert story.alarms() == [first, *[f"still no parachute confirmed: {first}"] * 2]
    story = at_its_end()
    story.at(61.2)
    times = alarm_times(story)
    assert len(times) == 31
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert gaps == pytest.approx([2.0] * 30)


def test_the_alarm_goes_on_while_somebody_kills_and_stops_when_a_parachute_is_out():
    story = at_its_end()
    story.at(1.5, i.KillRequest(9, "operator", "stop"))
    story.at(20.0)
    assert story.state.stage is Stage.FAULT
    assert len(alarm_times(story)) == 10
    story.at(20.5, story.heartbeat(), parachute(deployed=True))
    story.at(60.0)
    assert story.state.stage is Stage.DEPLOYED
    assert len(alarm_times(story)) == 10


def test_the_alarm_stops_at_a_reset_on_the_ground():
    story = at_its_end()
    story.at(1.2, story.told(**DOWN))
    story.at(1.3, i.ResetRequest(6))
    assert story.answer(6).success
    story.at(60.0)
    assert len(alarm_times(story)) == 1


@pytest.mark.parametrize("kills", [False, True])
def test_a_confirmation_that_comes_after_the_end_counts_and_nothing_fires_again(kills):
    story = at_its_end()
    if kills:
        story.at(1.2, i.KillRequest(6, "operator", "stop"))
    story.at(1.3, story.report(D, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYED
    for token, force in ((7, True), (8, False)):
        story.at(2.0, i.DeployRequest(token, force, "again"))
        assert "out already" in story.answer(token).message
    assert len(story.decisions(D)) == 1
    story.at(60.0)
    assert len(alarm_times(story)) == 1


# -- once more -----------------------------------------------------------------------------------


def test_after_a_fault_a_person_may_try_again_from_the_first_step():
    for confirms in (parachute(deployed=True), None):
        story = at_its_end()
        story.at(2.0, i.DeployRequest(6, False, "again"))
        story.at(2.1, story.report(K, Outcome.CONFIRMED))
        assert len(story.decisions(D)) == 2
        story.at(2.2, confirms or story.report(D, Outcome.CONFIRMED))
        story.at(3.0)
        assert story.answer(6).success


def test_a_confirmation_that_comes_with_another_request_is_its_answer():
    story = at_its_end()
    story.at(1.3, story.report(D, Outcome.CONFIRMED), i.DeployRequest(6, False, "again"))
    assert story.answer(6).success
    assert story.fired() == ["KILL", "DEPLOY"]


def test_an_acknowledgement_of_the_last_deploy_is_not_that_of_the_next():
    story = deploying()
    story.at(1.1, story.report(D, Outcome.ACCEPTED))
    story.at(1.2, story.report(D, Outcome.FAILED))
    story.at(1.3, i.DeployRequest(6, False, "again"))
    story.at(1.4, story.report(K, Outcome.CONFIRMED))
    assert story.fired() == ["KILL", "DEPLOY", "KILL", "DEPLOY"]
    assert story.answers(6) == []


def test_a_person_who_insists_after_a_confirmation_gets_the_next_parachute_alone():
    story = deploying(deploy_links=BOTH)
    story.at(1.1, story.report(D, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYED
    both = (story.heartbeat(), story.heartbeat(UPF))
    story.at(1.2, *both, i.DeployRequest(6, True, "it did not open"))
    assert story.answers(6) == []
    story.at(1.3, story.report(K, Outcome.CONFIRMED))
    assert [d.targets for d in story.decisions(D)] == [(LINK,), (UPF,)]
    story.at(1.4, story.report(D, Outcome.CONFIRMED, UPF))
    assert story.answer(6).success


def test_it_is_tried_again_with_the_first_rule_and_says_why():
    story = at_its_end()
    for tick in range(85):
        story.at(1.2 + tick * 0.1, story.heartbeat(), i.VehicleReport(FLYING))
    assert len(story.decisions(K)) == 2
    again = story.newest(K)
    assert again.rule == "operator"
    assert again.reasons == ("tried again 8.0 s after the ladder's end: it is still in the air",)
    story = at_its_end()
    story.at(2.6, i.VehicleReport(FLYING), story.heartbeat())
    assert story.newest(K).reasons == (
        "tried again 1.5 s after the ladder's end: it is still in the air",
    ), "a link that comes back is told at once"


def test_one_that_came_back_with_the_end_of_the_ladder_is_no_reason_to_try_again():
    story = deploying()
    story.at(1.1, story.report(D, Outcome.SENT))
    story.at(2.5, story.heartbeat(), failed(story))
    assert story.state.stage is Stage.FAULT
    story.at(2.6, i.VehicleReport(FLYING), story.heartbeat())
    assert len(story.decisions(K)) == 1


@pytest.mark.parametrize(("height", "fired"), [(9.0, 1), (11.0, 2)])
def test_a_rule_tries_again_only_above_the_minimum_height(height, fired):
    story = by_rule()
    story.at(1.1, story.heartbeat(), story.report(K, Outcome.CONFIRMED))
    story.at(1.2, story.heartbeat(), failed(story))
    assert story.state.stage is Stage.FAULT
    story.fly(10.0, height=height)
    assert len(story.decisions(K)) == fired
    assert {one.rule for one in story.decisions(K)} == {"tested"}
