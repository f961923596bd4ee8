"""What a leader tells those that follow, and how one goes on where it stopped."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from types import MappingProxyType
from typing import Any, get_args, get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st
from story import FLYING, LINK, START, Story, changed, parachute, vehicle

from chute_ros.errors import RecordError
from chute_ros.model import Action, Decision, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.codec import INLINE
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.counter import RuleEvidence
from chute_ros.supervisor.handover import followed, told
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.link_evidence import LinkEvidence
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import Measured, Sample
from chute_ros.supervisor.pending import Ask, Pending, Time
from chute_ros.supervisor.state import (
    Alarms,
    DeployUnderWay,
    HeardHere,
    Killing,
    Own,
    State,
    ThisFlight,
)

K, D = Action.KILL, Action.DEPLOY
CONFIG = SupervisorConfig(standby=True)
#: The other host's monotonic clock is ahead by this, s.
AHEAD = 5000.0


def follower(now: float = START) -> State:
    return State(epoch=1, started_at=now + AHEAD, own=Own(leading=False))


def handed(story: Story, to: State | None = None) -> State:
    """The follower's state after the leader's newest claim."""
    now = START + story.t
    return followed(to or follower(), told(story.state, now), now + AHEAD)


def take_over(state: State, t: float) -> tuple[State, tuple[i.Output, ...]]:
    return update(CONFIG, state, (i.TakeOver(8),), START + AHEAD + t)


def decided(outputs: tuple[i.Output, ...], action: Action) -> list[i.Decide]:
    return [o for o in outputs if isinstance(o, i.Decide) and o.decision.action is action]


def falling() -> Story:
    """In flight, a deploy asked for at t = 1."""
    story = Story(CONFIG).flying()
    story.at(1.0, story.heartbeat(), i.DeployRequest(5, False, "it falls"))
    return story


def test_one_that_follows_decides_and_answers_nothing():
    story = Story(CONFIG).flying()
    state = handed(story)
    for one in (
        i.DeployRequest(1, True, "now"),
        i.KillRequest(2, "operator", "now"),
        i.ArmRequest(3, True, 0),
        i.ResetRequest(4),
        i.ModeRequest(6, i.Mode.SHADOW, True),
    ):
        state, outputs = update(CONFIG, state, (one,), START + AHEAD + 1.0)
        (answer,) = outputs
        assert isinstance(answer, i.Finish)
        assert "another supervisor decides" in answer.message
        assert state.stage is Stage.IN_FLIGHT
    state, outputs = update(
        CONFIG, state, (i.KillRequest(0, "upf_can 33", "about to launch"),), START + AHEAD + 2.0
    )
    assert outputs == ()
    # Who takes over within the time that the wish lasts follows it.
    state, outputs = take_over(state, 2.5)
    assert decided(outputs, K)


def test_a_deploy_that_waits_for_its_kill_goes_on_at_its_time():
    story = falling()
    state = handed(story)
    state, outputs = take_over(state, 1.3)
    # The kill was not reported as begun: it leaves again, under the new number.
    (kill,) = decided(outputs, K)
    assert kill.decision.epoch == 8
    assert decided(outputs, D) == []
    state, outputs = update(CONFIG, state, (), START + AHEAD + 1.5)
    (deploy,) = decided(outputs, D)
    assert (deploy.decision.epoch, state.stage) == (8, Stage.DEPLOYING)


@pytest.mark.parametrize("outcome", [Outcome.SENT, Outcome.ACCEPTED])
def test_a_shot_that_a_device_has_begun_is_not_shot_again(outcome):
    story = falling()
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, story.heartbeat(), story.report(D, outcome))
    number = story.newest(D)
    state, outputs = take_over(handed(story), 1.3)
    assert decided(outputs, D) == []
    confirmed = i.ActionReport(number.epoch, number.id, LINK, Outcome.CONFIRMED, "out")
    state, _ = update(CONFIG, state, (confirmed,), START + AHEAD + 1.4)
    assert state.stage is Stage.DEPLOYED


def test_a_shot_that_nobody_has_begun_is_not_lost():
    story = falling()
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    _, outputs = take_over(handed(story), 1.3)
    (deploy,) = decided(outputs, D)
    assert deploy.decision.epoch == 8


def test_a_parachute_that_is_out_stays_out_for_the_next_leader():
    story = falling()
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    story.at(1.2, parachute(deployed=True))
    state, outputs = take_over(handed(story), 9.0)
    assert state.stage is Stage.DEPLOYED
    assert decided(outputs, K) == decided(outputs, D) == []


def test_a_parachute_that_the_follower_has_heard_to_be_out_is_not_ordered_once_more():
    """The leader has not, as nothing reaches it any more."""
    story = falling()
    story.at(1.1, story.report(K, Outcome.CONFIRMED))
    assert story.state.stage is Stage.DEPLOYING
    state, outputs = take_over(handed(story), 1.2)
    assert decided(outputs, D), "it has not heard of it either"
    now = START + AHEAD
    state, _ = update(CONFIG, follower(), (story.heartbeat(), parachute()), now + 1.0)
    heard, _ = update(CONFIG, state, (story.heartbeat(), parachute(deployed=True)), now + 1.15)
    state, outputs = take_over(handed(story, heard), 1.2)
    assert state.stage is Stage.DEPLOYED
    assert not decided(outputs, D)


def spoilt(**fields: object) -> str:
    """What a leader in flight tells, with other values in these fields."""
    return json.dumps(json.loads(told(falling().state, START)) | fields)


@pytest.mark.parametrize(
    "fields",
    [
        {"epoch": 2**70},
        {"epoch": 2**32},
        {"epoch": 0},
        {"epoch": -5},
        {"next_id": 2**64 - 1},
        {"next_id": 0},
        {"alarms": ["\ud800"]},
        {"device_blocks": [["\udfff", "why"]]},
    ],
    ids=str,
)
def test_what_cannot_be_decided_nor_told_is_not_followed(fields):
    assert followed(follower(), spoilt(), START).stage is Stage.KILLING
    with pytest.raises(RecordError):
        followed(follower(), spoilt(**fields), START)


def test_a_decision_under_way_whose_number_no_message_holds_is_not_followed():
    kill = json.loads(spoilt())["kill"]
    kill["decision"]["id"] = 2**64
    with pytest.raises(RecordError, match="there is no decision"):
        followed(follower(), spoilt(kill=kill), START)


#: When it is told, by the clock of each host, s.
THERE, HERE = 1024.0, 512.0


def frozen(**parts: Any) -> Mapping[str, Any]:
    return MappingProxyType(parts)


def pending(action: Action, clock: float) -> Pending:
    """Decided 8 s ago, sent again 4 s ago, not all well."""
    return Pending(
        Decision(9, 5, action, "rule", ("why",), (LINK,), device="1/161"),
        (LINK, "upf_can"),
        clock - 8.0,
        clock - 4.0,
        MappingProxyType({LINK: frozenset({Outcome.SENT})}),
        ("sent",),
        frozenset({(9, 4)}),
        given_up=True,
    )


def every_field(state: State) -> dict[str, str]:
    """Each field, as it is written, under its name; a group's one by one."""
    told: dict[str, str] = {}
    for field in fields(state):
        value = getattr(state, field.name)
        told |= every_field(value) if field.metadata == INLINE else {field.name: repr(value)}
    return told


def leader(clock: float) -> State:
    """Nothing is as at the start. clock: that host's, to which all times belong."""
    return State(
        epoch=9,
        started_at=clock - 100.0,
        stage=Stage.KILLING,
        stage_since=clock - 8.0,
        mode=Mode.SHADOW,
        next_id=6,
        rules=frozen(tested=RuleEvidence(level=0.5, shown=(3.0,))),
        asks=MappingProxyType({"upf_can 33": Ask(clock - 0.5, "upf_can", "launching")}),
        block=pending(Action.FLIGHT_BLOCK, clock),
        newest=pending(Action.KILL, clock).decision,
        device_blocks=MappingProxyType({"upf_can 33": "it burns"}),
        block_refused=True,
        own=Own(
            leading=True,
            updated_at=clock - 0.5,
            late_count=2,
            vehicle_rests_until=clock + 0.125,
            not_seen="height",
            kill_tokens=(5,),
            deploy_tokens=(6,),
        ),
        heard=HeardHere(
            links=frozen(umbilical=LinkEvidence(heard=clock)),
            vehicle=replace(FLYING, source="the leader's"),
            vehicle_received=clock - 0.25,
            disputed=frozenset({"attitude"}),
            measurements=frozen(height=Measured(30.0, clock, clock, 9)),
            heights=((clock - 0.25, 30.0),),
            pressure_heights=((clock - 0.25, 520.0),),
            pressure_before=(clock - 0.75, 522.0),
            motion=((clock - 0.25, 1.0, 9.8, 1.0),),
            denied=frozen(acceleration="why"),
            denied_since=frozen(acceleration=clock - 0.5),
            commanded=frozen(tilt_deg="why"),
            unfit=frozen(acceleration="0"),
            fitness_since=frozen(acceleration=clock - 0.25),
            at_ground_since=clock - 0.5,
            still_since=clock - 0.5,
            rests_since=clock - 0.5,
            commanded_speed=Sample(-1.0, clock - 0.5),
            faults_told=("slow",),
        ),
        released_since_reset=frozenset({("upf_can", "34")}),
        last_armed=frozenset({("upf_can", "35")}),
        flight=ThisFlight(
            home_altitude=480.0,
            ground_pressure_altitude=490.0,
            up_for=1.0,
            armed_on_ground=True,
            flown=True,
            airborne=True,
            down_since=clock - 3.0,
            landed_at=clock - 64.0,
            was_high=True,
            airborne_since=clock - 32.0,
            rebooted=True,
            steady_since=clock - 1.5,
            reboots_before=3,
            armed_height=2.0,
            took_off_height=3.0,
            home=(48.0, 11.0),
            released_before=frozenset({("upf_can", "33")}),
        ),
        killing=Killing(
            kill_only=True,
            kill=pending(Action.KILL, clock),
            killed_in_flight=True,
            killed_at=clock - 4.0,
            killed_height=80.0,
            killed_sinking=1.5,
            killed_standing=True,
            killed_low=True,
        ),
        alarming=Alarms(canopy_fails=True, alarms=("beware",), alarm_at=clock + 2.0),
        deploying=DeployUnderWay(
            deploys=(pending(Action.DEPLOY, clock), pending(Action.DEPLOY, clock)),
            deploy_rule="rule",
            deploy_reasons=("why",),
            deploy_ladder=(Rung(LINK, "1/161"),),
            deploy_due=clock + 0.5,
            deploy_height=4.0,
        ),
    )


#: What the one that follows has heard and counted itself.
OWN: dict[str, Any] = {
    "updated_at": HERE - 0.125,
    "late_count": 1,
    "links": frozen(mavlink_parachute=LinkEvidence(heard=HERE)),
    "vehicle": replace(FLYING, source="its own"),
    "vehicle_received": HERE - 0.125,
    "disputed": frozenset({"height"}),
    "measurements": frozen(height=Measured(31.0, HERE, HERE, 8)),
    "heights": ((HERE - 0.125, 31.0),),
    "pressure_heights": ((HERE - 0.125, 521.0),),
    "pressure_before": (HERE - 0.5, 523.0),
    "motion": ((HERE - 0.125, 0.5, 9.8, 1.0),),
    "denied": frozen(vertical_speed="why"),
    "denied_since": frozen(vertical_speed=HERE - 0.5),
    "commanded": frozen(vertical_speed="why"),
    "commanded_speed": Sample(-2.0, HERE - 0.125),
    "unfit": frozen(acceleration="99"),
    "fitness_since": frozen(acceleration=HERE - 0.125),
    "still_since": HERE - 1.0,
    "rests_since": HERE - 1.0,
    "at_ground_since": HERE - 1.0,
    "faults_told": ("other",),
    "vehicle_rests_until": -math.inf,
}
#: Nobody waits at the one that follows, which does not decide, nor says what the rules do not see.
NOBODY: dict[str, Any] = {
    "leading": False,
    "not_seen": "",
    "kill_tokens": (),
    "deploy_tokens": (),
}


def test_every_field_is_told_in_the_time_of_the_other_host_or_is_heard_there():
    follower = changed(State(epoch=1, started_at=HERE), **OWN, leading=False)
    state = followed(follower, told(leader(THERE), THERE), HERE)
    expected = changed(leader(HERE), **OWN, **NOBODY)
    assert every_field(state) == every_field(expected)


def test_in_the_test_above_no_field_is_as_at_the_start():
    start = State(epoch=0, started_at=math.nan)
    one = replace(leader(THERE), own=replace(leader(THERE).own, leading=False))
    first = every_field(start)
    assert [name for name, value in every_field(one).items() if value == first[name]] == []


#: Numbers of a state that others share, and of what it holds, that are no times.
NO_TIMES = {
    *("killed_height", "killed_sinking", "took_off_height", "armed_height", "home_altitude"),
    *("ground_pressure_altitude", "up_for", "level", "unknown", "deploy_height"),
}


def numbers(hint: Any) -> Iterator[tuple[str, bool]]:
    """Each float that is held somewhere in this type: its field, and whether it is a Time."""
    if is_dataclass(hint):
        for name, one in get_type_hints(hint, include_extras=True).items():
            if one == Time or one is float:
                yield name, one == Time
            elif not (hint is State and name in ("heard", "own")):
                yield from numbers(one)
    for argument in get_args(hint):
        yield from numbers(argument)


def test_every_number_that_is_shared_is_a_time_that_is_moved_or_none():
    plain = {name for name, is_time in numbers(State) if not is_time}
    assert plain >= NO_TIMES, "gone"
    assert plain <= NO_TIMES, "add them here, or make them a Time"


@given(st.integers(-(2**20), 2**20), st.integers(-(2**20), 2**20))
def test_what_is_told_is_what_is_followed_with_every_time_moved(there, here):
    """Whatever the clocks of the two hosts tell; in parts of a second that add up exactly."""
    state = followed(State(1, 0.0), told(leader(there / 8.0), there / 8.0), here / 8.0)
    expected = replace(leader(here / 8.0), heard=HeardHere(), own=Own(leading=False))
    assert every_field(state) == every_field(expected)
    # What never happened has not happened for the other host either.
    nothing = followed(State(1, here / 8.0), told(State(9, there / 8.0), there / 8.0), here / 8.0)
    assert every_field(nothing) == every_field(State(9, here / 8.0, own=Own(leading=False)))


def test_one_that_follows_goes_on_knowing_the_sink_from_the_heights():
    """Of a source without a vertical speed: it would have to begin anew at every takeover."""
    story = Story(SupervisorConfig(standby=True))
    for tick in range(9):
        story.at(tick / 8, vehicle(height=90.0 - tick))
    heights = story.state.heard.heights
    assert len(heights) == 9
    assert followed(story.state, told(leader(THERE), THERE), THERE).heard.heights == heights


NO_STATE = "[" + "1," * 50 + "1]"
ASK = '{"is":"Ask","at":1,"link":"a","reason":"b"}'
AN_ASK = json.loads(ASK)
STATE = '{"is":"State","epoch":1,"started_at":'
ASK_AS_DEPLOY, ASK_AS_TIME = f'{STATE}0,"deploys":[{ASK}]}}', f"{STATE}{ASK}}}"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[]", "not a state: '[]'"),
        (NO_STATE, f"not a state: {NO_STATE[:80]!r}"),
        (ASK_AS_DEPLOY, f"cannot be read: {AN_ASK} is no Pending in {ASK_AS_DEPLOY[:80]!r}"),
        (ASK_AS_TIME, f"cannot be read: {AN_ASK} is no float in {ASK_AS_TIME[:80]!r}"),
    ],
)
def test_what_does_not_fit_is_refused_in_these_words(text, words):
    with pytest.raises(RecordError) as refused:
        followed(State(1, HERE), text, HERE)
    assert str(refused.value) == words
