"""A deploy is a ladder: each step until its own device confirms or its time is over; no silence
at its end."""

import itertools
from typing import Any

import pytest
from story import DOWN, LINK, Story, parachute

from chute_ros.errors import ParameterError
from chute_ros.model import Action, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.machine import Stage

K, D = Action.KILL, Action.DEPLOY
UPF = "upf_can"
LADDER = (Rung(LINK), Rung(LINK, "1/162"), Rung(UPF), Rung(UPF, "trigger"))


def deploying(*ladder: Rung, **settings: Any) -> Story:
    """In flight; a person asks for a deploy at 1.0, the kill is confirmed at 1.0 as well."""
    links = (LINK, UPF)
    config = SupervisorConfig(deploy_links=links, deploy_ladder=ladder or LADDER, **settings)
    story = Story(config).flying()
    story.at(0.9, story.heartbeat(), story.heartbeat(UPF))
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.0, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYING
    return story


def steps(story: Story) -> list[tuple[str, str]]:
    """Link and device of every deploy, in their order."""
    return [(d.targets[0], d.device) for d in story.decisions(D)]


ALL = [(rung.link, rung.device) for rung in LADDER]


def test_the_primary_comes_first_and_alone() -> None:
    story = deploying()
    decision = story.newest(D)
    assert (decision.targets, decision.device) == ((LINK,), "")
    story.alive(2.9, LINK, UPF)
    assert steps(story) == ALL[:1]


def test_a_step_that_is_not_confirmed_in_its_time_is_followed_by_the_next_and_says_why() -> None:
    story = deploying()
    story.at(1.1, story.report(D, Outcome.SENT))
    story.alive(3.05, LINK, UPF)
    assert steps(story) == ALL[:2]
    assert (
        "step 1 of 4, mavlink_parachute: not confirmed: mavlink_parachute: told (2.00 s)"
        in (story.newest(D).reasons[-1])
    )


def test_a_step_that_failed_is_followed_at_once() -> None:
    story = deploying()
    story.at(1.3, story.report(D, Outcome.FAILED, detail="denied"))
    assert steps(story) == ALL[:2]
    assert "not confirmed: mavlink_parachute: denied (0.30 s)" in story.newest(D).reasons[-1]


def test_a_step_whose_device_refuses_for_now_is_followed_at_once_and_may_still_confirm() -> None:
    story = deploying()
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


def test_the_last_step_goes_on_though_its_device_refuses_for_now() -> None:
    story = deploying(Rung(LINK))
    story.at(1.1, story.report(D, Outcome.REFUSED, detail="temporarily rejected"))
    story.alive(8.9, LINK, UPF)
    assert story.state.stage is Stage.DEPLOYING
    assert not any(one.token == 5 for _, one in story.outputs if isinstance(one, i.Finish))
    story.at(8.9, story.report(D, Outcome.ACCEPTED), story.report(D, Outcome.CONFIRMED))
    assert story.answer(5).success


def test_a_refusal_is_no_step_forward() -> None:
    story = deploying(Rung(LINK))
    story.at(1.1, story.report(D, Outcome.REFUSED))
    assert not story.state.deploying.deploys[0].reached(Outcome.SENT)
    assert not story.state.deploying.deploys[0].all_failed()


@pytest.mark.parametrize("outcome", [Outcome.SENT, Outcome.ACCEPTED])
def test_an_ack_is_no_confirmation(outcome: Outcome) -> None:
    story = deploying()
    for n in range(19):
        story.at(1.05 + n * 0.1, story.heartbeat(), story.report(D, outcome))
    assert steps(story) == ALL[:1]
    assert story.state.stage is Stage.DEPLOYING
    story.alive(3.05, LINK, UPF)
    assert steps(story) == ALL[:2]


def test_the_whole_ladder_ends_at_the_triggers_themselves() -> None:
    story = deploying()
    story.alive(7.05, LINK, UPF)
    assert steps(story) == ALL
    last = story.newest(D)
    assert (last.targets, last.device) == ((UPF,), "trigger")
    new = [(t, o) for t, o in story.outputs if isinstance(o, i.Decide) and not o.again]
    times = [t for t, o in new if o.decision.action is D]
    assert times == pytest.approx([1.0, 3.0, 5.0, 7.0])


@pytest.mark.parametrize("number", range(4))
def test_the_step_that_is_confirmed_is_the_last(number: int) -> None:
    story = deploying()
    for _ in range(number):
        story.at(story.t + 0.1, story.report(D, Outcome.FAILED, steps(story)[-1][0]))
    story.at(story.t + 0.1, story.report(D, Outcome.CONFIRMED, steps(story)[-1][0]))
    assert story.state.stage is Stage.DEPLOYED
    story.at(story.t + 60.0)
    assert steps(story) == ALL[: number + 1]
    assert story.answer(5).success
    assert "still no parachute confirmed" not in story.said()


def test_a_step_that_confirms_late_ends_the_climb() -> None:
    story = deploying()
    first = story.newest(D)
    story.alive(3.05, LINK, UPF)
    story.at(3.1, i.ActionReport(first.epoch, first.id, LINK, Outcome.CONFIRMED, "out"))
    assert story.state.stage is Stage.DEPLOYED
    story.at(60.0)
    assert steps(story) == ALL[:2]


def test_the_status_of_any_parachute_ends_the_climb() -> None:
    story = deploying()
    story.alive(3.05, LINK, UPF)
    story.at(3.1, parachute(UPF, "33", deployed=True))
    assert story.state.stage is Stage.DEPLOYED
    story.at(60.0)
    assert steps(story) == ALL[:2]


@pytest.mark.parametrize(
    ("epoch", "number", "link"),
    [(7, 1, LINK), (7, 999, LINK), (6, None, LINK), (7, None, UPF), (7, None, "stranger")],
)
def test_a_confirmation_of_another_number_or_link_confirms_nothing(
    epoch: int, number: int | None, link: str
) -> None:
    story = deploying()
    told = story.newest(D).id if number is None else number
    report = i.ActionReport(epoch, told, link, Outcome.CONFIRMED, "out", 7, told)
    story.at(1.1, report)
    assert story.state.stage is Stage.DEPLOYING


def test_a_kill_that_is_confirmed_late_is_no_confirmation_of_the_deploy() -> None:
    story = Story(SupervisorConfig()).flying()
    story.at(1.0, i.DeployRequest(5, False, "it falls"))
    story.at(1.6)
    assert story.state.stage is Stage.DEPLOYING
    story.at(1.7, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYING


def test_a_step_whose_node_is_silent_is_sent_and_the_next_not_put_off() -> None:
    story = deploying(Rung(UPF), Rung(LINK))
    story.alive(2.0, LINK)
    assert steps(story) == [(UPF, ""), (LINK, "")]
    assert "its node is silent" in story.newest(D).reasons[-1]


def test_a_ladder_of_silent_nodes_is_sent_at_once_and_the_last_step_awaited() -> None:
    config = SupervisorConfig(deploy_links=(LINK, UPF), deploy_ladder=LADDER)
    story = Story(config).flying()
    story.at(30.0, i.DeployRequest(5, False, "it falls"))
    story.at(30.5)
    assert steps(story) == ALL
    story.at(38.4)
    assert story.state.stage is Stage.DEPLOYING
    story.at(38.6)
    assert story.state.stage is Stage.FAULT


def test_without_a_ladder_the_deploy_links_are_its_steps() -> None:
    config = SupervisorConfig(deploy_links=(LINK, UPF))
    assert config.ladder == (Rung(LINK), Rung(UPF))


# -- its end -------------------------------------------------------------------------------------


def at_its_end(**settings: Any) -> Story:
    """The only step has failed at 1.1."""
    story = deploying(Rung(LINK), **settings)
    story.at(1.1, story.report(D, Outcome.FAILED, detail="denied"))
    assert story.state.stage is Stage.FAULT
    return story


def alarm_times(story: Story) -> list[float]:
    return [
        t
        for t, o in story.outputs
        if isinstance(o, i.LogMessage) and o.alarm and "no parachute" in o.text
    ]


def test_its_end_without_a_parachute_is_an_alarm_that_does_not_stop() -> None:
    story = at_its_end()
    assert not story.answer(5).success
    story.at(61.2)
    times = alarm_times(story)
    assert len(times) == 31
    gaps = [b - a for a, b in itertools.pairwise(times)]
    assert gaps == pytest.approx([2.0] * 30)


def test_its_last_step_has_a_limit_of_its_own() -> None:
    story = deploying(Rung(LINK), deploy_timeout=4.0)
    story.alive(4.95)
    assert story.state.stage is Stage.DEPLOYING
    story.alive(5.1)
    assert story.state.stage is Stage.FAULT
    assert "no parachute confirmed within 4.0 s: no device node reported" in story.alarms()[-1]


def test_the_alarm_goes_on_while_somebody_kills_once_more() -> None:
    story = at_its_end()
    story.at(1.5, i.KillRequest(9, "operator", "stop"))
    story.at(20.0)
    assert story.state.stage is Stage.FAULT
    assert len(alarm_times(story)) == 10


def test_the_alarm_stops_when_a_parachute_is_out() -> None:
    story = at_its_end()
    story.at(5.0, story.heartbeat(), parachute(deployed=True))
    count = len(alarm_times(story))
    story.at(60.0)
    assert story.state.stage is Stage.DEPLOYED
    assert len(alarm_times(story)) == count


def test_a_confirmation_that_comes_after_the_end_counts_and_nothing_fires_again() -> None:
    story = at_its_end()
    story.at(1.3, story.report(D, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYED
    story.at(2.0, i.DeployRequest(6, True, "again"))
    assert "out already" in story.answer(6).message
    assert len(story.decisions(D)) == 1
    story.at(60.0)
    assert len(alarm_times(story)) == 1


def test_the_alarm_stops_at_a_reset_on_the_ground() -> None:
    story = at_its_end()
    story.at(1.2, story.told(**DOWN))
    story.at(1.3, i.ResetRequest(6))
    assert story.answer(6).success
    story.at(60.0)
    assert len(alarm_times(story)) == 1


def test_after_its_end_a_person_climbs_from_the_first_step_again() -> None:
    story = at_its_end()
    story.at(2.0, i.DeployRequest(6, False, "again"))
    story.at(2.1, story.report(K, Outcome.CONFIRMED))
    assert len(story.decisions(D)) == 2
    story.at(2.2, story.report(D, Outcome.CONFIRMED))
    assert story.answer(6).success


# -- its steps in words --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "rung"),
    [
        ("upf_can", Rung("upf_can")),
        ("upf_can:trigger", Rung("upf_can", "trigger")),
        ("mavlink_parachute:1/162", Rung("mavlink_parachute", "1/162")),
    ],
)
def test_a_step_is_read_as_it_is_written(text: str, rung: Rung) -> None:
    assert Rung.parse(text) == rung
    assert str(rung) == text


@pytest.mark.parametrize("text", ["", ":", ":trigger", "upf_can:"])
def test_a_step_that_is_none_says_how_to_write_it(text: str) -> None:
    with pytest.raises(ParameterError, match="need LINK or LINK:DEVICE, for example"):
        Rung.parse(text)


def test_a_step_must_be_on_a_link_that_deploys() -> None:
    with pytest.raises(ParameterError, match=r"deploy_ladder names upf_can:trigger: need a link"):
        SupervisorConfig(deploy_ladder=(Rung(UPF, "trigger"),))
