"""What a kind of condition must bring along before a rule can have it."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

import pytest
from story import START, Story, with_rules

from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.conditions import CONDITIONS
from chute_ros.supervisor.conditions.autopilot import AutopilotCondition, AutopilotFact
from chute_ros.supervisor.conditions.base import JUST_AFTER, Condition, Finding
from chute_ros.supervisor.conditions.device import DeviceCondition, DeviceFact
from chute_ros.supervisor.record import CODEC

#: What a kind of condition says of itself, written once more.
OWN: dict[str, Any] = {
    "weight": 1.0,
    "is_silence": False,
    "parse": classmethod(lambda cls, *_: cls()),
    "find": lambda *_: Finding(True, str),
    "deadlines": lambda *_: (),
}


def test_one_that_says_all_of_itself_can_be_made() -> None:
    made = type("Whole", (Condition,), OWN)()
    assert made.counted
    assert [made.measured, made.rests_on_the_vehicle, made.goes_on] == [(), False, False]


@pytest.mark.parametrize("missing", OWN)
def test_one_that_forgets_something_cannot_be_made(missing: str) -> None:
    kind = type("Half", (Condition,), {key: OWN[key] for key in OWN if key != missing})
    with pytest.raises(TypeError, match=missing):
        kind()


@pytest.mark.parametrize(("key", "kind"), CONDITIONS.items())
def test_every_kind_is_read_under_its_key_and_kept_in_the_black_box(
    key: str, kind: type[Condition]
) -> None:
    assert kind.key == key
    assert is_dataclass(kind)
    assert {"weight"} <= {one.name for one in fields(kind)}
    assert CODEC._classes[kind.__name__] is kind


@pytest.mark.parametrize("fact", AutopilotFact)
def test_every_fact_of_the_autopilot_is_found_and_waited_for(fact: AutopilotFact) -> None:
    story, one = Story().flying(), AutopilotCondition(fact)
    now = START + story.t
    assert one.find(story.config, story.state, now).text
    received = story.state.heard.vehicle_received + story.config.vehicle_state_age + JUST_AFTER
    assert received in one.deadlines(story.config, story.state, None, False, now)


def test_the_end_of_a_wish_is_waited_for_by_the_rule_that_looks_at_it() -> None:
    asked = DeviceCondition(DeviceFact.ASKS_FOR_KILL)
    story = Story(with_rules()).flying()
    story.at(1.0, i.KillRequest(0, "upf_can 33", "smoke"))
    (ask,) = story.state.asks.values()
    assert ask.ends_at == START + 2.0
    deadlines = asked.deadlines(story.config, story.state, True, False, START + 1.0)
    assert list(deadlines) == [START + 2.0]
    for fact in (DeviceFact.DEPLOYED, DeviceFact.ABNORMAL):
        other = replace(asked, fact=fact)
        assert not list(other.deadlines(story.config, story.state, True, False, START + 1.0))
