"""Every field that is handed over or is not."""

import json
import math
from collections.abc import Mapping
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Any

import pytest
from story import FLYING, LINK, Story, vehicle

from chute_ros.errors import RecordError
from chute_ros.model import Action, Decision, Outcome
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.counter import RuleEvidence
from chute_ros.supervisor.handover import followed, told
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.link_evidence import LinkEvidence
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import Measured
from chute_ros.supervisor.state import Ask, Pending, State

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


def leader(clock: float) -> State:
    """Nothing is as at the start. clock: that host's, to which all times belong."""
    return State(
        epoch=9,
        started_at=clock - 100.0,
        stage=Stage.KILLING,
        stage_since=clock - 8.0,
        mode=Mode.SHADOW,
        leading=True,
        next_id=6,
        updated_at=clock - 0.5,
        late_count=2,
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
        fitness_since=clock - 0.25,
        home_altitude=480.0,
        ground_pressure_altitude=490.0,
        kill_only=True,
        up_for=1.0,
        at_ground_since=clock - 0.5,
        armed_by_us=True,
        still_since=clock - 0.5,
        faults_told=("slow",),
        canopy_fails=True,
        vehicle_rests_until=clock + 0.125,
        rules=frozen(tested=RuleEvidence(level=0.5, shown=(3.0,))),
        asks=MappingProxyType({"upf_can 33": Ask(clock - 0.5, "upf_can", "launching")}),
        block=pending(Action.FLIGHT_BLOCK, clock),
        kill=pending(Action.KILL, clock),
        deploys=(pending(Action.DEPLOY, clock), pending(Action.DEPLOY, clock)),
        deploy_rule="rule",
        deploy_reasons=("why",),
        deploy_ladder=(Rung(LINK, "1/161"),),
        deploy_due=clock + 0.5,
        flown=True,
        airborne=True,
        killed_in_flight=True,
        killed_at=clock - 4.0,
        killed_height=80.0,
        killed_sinking=1.5,
        down_since=clock - 3.0,
        killed_standing=True,
        landed_at=clock - 64.0,
        was_high=True,
        airborne_since=clock - 32.0,
        rebooted=True,
        reboots_before=3,
        armed_height=2.0,
        took_off_height=3.0,
        newest=pending(Action.KILL, clock).decision,
        home=(48.0, 11.0),
        released_before=frozenset({("upf_can", "33")}),
        device_blocks=MappingProxyType({"upf_can 33": "it burns"}),
        block_refused=True,
        kill_tokens=(5,),
        deploy_tokens=(6,),
        alarms=("beware",),
        alarm_at=clock + 2.0,
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
    "unfit": frozen(acceleration="99"),
    "fitness_since": HERE - 0.125,
    "still_since": HERE - 1.0,
    "at_ground_since": HERE - 1.0,
    "faults_told": ("other",),
    "vehicle_rests_until": -math.inf,
}
#: Nobody waits at the one that follows, which does not decide.
NOBODY: dict[str, Any] = {"leading": False, "kill_tokens": (), "deploy_tokens": ()}


def test_every_field_is_told_in_the_time_of_the_other_host_or_is_heard_there() -> None:
    follower = State(epoch=1, started_at=HERE, leading=False, **OWN)
    state = followed(follower, told(leader(THERE), THERE), HERE)
    expected = replace(leader(HERE), **OWN, **NOBODY)
    for field in fields(State):
        assert getattr(state, field.name) == getattr(expected, field.name), field.name


def test_in_the_test_above_no_field_is_as_at_the_start() -> None:
    start = State(epoch=0, started_at=math.nan)
    one = replace(leader(THERE), leading=False)
    same = [f.name for f in fields(State) if getattr(one, f.name) == getattr(start, f.name)]
    assert same == []


def test_what_never_happened_has_not_happened_for_the_other_host_either() -> None:
    state = followed(State(1, HERE), told(State(9, THERE), THERE), HERE)
    assert (state.block, state.kill, state.deploys) == (None, None, ())
    assert math.isnan(state.landed_at)


def test_one_that_follows_goes_on_knowing_the_sink_from_the_heights() -> None:
    """Of a source without a vertical speed: it would have to begin anew at every takeover."""
    story = Story(SupervisorConfig(standby=True))
    for tick in range(9):
        story.at(tick / 8, vehicle(height=90.0 - tick))
    heights = story.state.heights
    assert len(heights) == 9
    assert followed(story.state, told(leader(THERE), THERE), THERE).heights == heights


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
def test_what_does_not_fit_is_refused_in_these_words(text: str, words: str) -> None:
    with pytest.raises(RecordError) as refused:
        followed(State(1, HERE), text, HERE)
    assert str(refused.value) == words
