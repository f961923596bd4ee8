"""What the black box writes comes back to the last bit, and what does not fit is said."""

import contextlib
import enum
import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import pytest
from hypothesis import given
from hypothesis import strategies as st
from story import FLYING, LINK, START, Story, shipped

from chute_ros.errors import RecordError
from chute_ros.model import (
    Action,
    Armed,
    Decision,
    LinkState,
    Outcome,
    ParachuteStatus,
    TriggerFlags,
    VehicleState,
)
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.codec import Codec
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.record import CODEC
from chute_ros.supervisor.state import State, ThisFlight


def there_and_back(value: object) -> object:
    return CODEC.from_json(CODEC.to_json(value))


def bits(value: float) -> bytes:
    return struct.pack("<d", value)


def test_the_fields_of_a_group_stand_in_the_state_as_they_did_before_it_had_groups():
    text = '{"is":"State","epoch":7,"started_at":0.0,"mode":1,"airborne":true}'
    state = State(7, 0.0, mode=i.Mode.SHADOW, flight=ThisFlight(airborne=True))
    assert CODEC.from_json(text) == state
    assert CODEC.to_json(state) == text
    with pytest.raises(RecordError, match="State has no flight: written by another version"):
        CODEC.from_json('{"is":"State","epoch":7,"started_at":0.0,"flight":{}}')


def test_a_line_for_the_log_is_read_under_its_former_name():
    said = i.LogMessage("it falls", alarm=True)
    assert CODEC.from_json('{"is":"Say","text":"it falls","alarm":true}') == said
    assert CODEC.to_json(said) == '{"is":"LogMessage","text":"it falls","alarm":true}'


def test_the_golden_lines():
    beat = i.LinkHeartbeat(LINK, LinkState.OK, True, 12, clock_difference=0.015)
    assert CODEC.to_json(beat) == (
        '{"is":"LinkHeartbeat","link":"mavlink_parachute","link_state":1,"device_healthy":true,'
        '"seq":12,"clock_difference":0.015}'
    )
    decision = Decision(7, 3, Action.DEPLOY, "free fall", ("a", "b"), ("upf_can",), device="33")
    assert CODEC.to_json(i.Decide(decision, again=True)) == (
        '{"is":"Decide","decision":{"is":"Decision","epoch":7,"id":3,"action":4,'
        '"rule":"free fall","reasons":["a","b"],"targets":["upf_can"],"device":"33"},'
        '"again":true}'
    )
    assert CODEC.to_json(i.VehicleReport(FLYING)) == (
        '{"is":"VehicleReport","state":{"is":"VehicleState","armed":2,"armed_age":0.0,'
        '"landed_state":2,"landed_state_age":0.0}}'
    )


def test_the_golden_lines_are_read():
    line = '{"is":"Finish","token":5,"success":true,"accepted":false,"message":"out"}'
    assert CODEC.from_json(line) == i.Finish(5, True, False, "out")
    assert CODEC.from_json('{"is":"Rung","link":"upf_can"}') == Rung("upf_can")


@pytest.mark.parametrize(
    "value", [0.0, -0.0, math.inf, -math.inf, 5e-324, 0.1, 1e308, -2.5e-8, START + 0.1]
)
def test_a_number_keeps_every_bit(value):
    told = there_and_back(VehicleState(height=value, height_age=value))
    assert isinstance(told, VehicleState)
    assert bits(told.height) == bits(value)
    assert bits(told.height_age) == bits(value)


def test_not_a_number_stays_so_where_it_is_not_the_default():
    told = there_and_back(i.Finish(1, True, True, "nan"))
    assert told == i.Finish(1, True, True, "nan")
    config = SupervisorConfig()
    assert "NaN" in CODEC.to_json(State(epoch=1, started_at=math.nan))
    back = there_and_back(State(epoch=1, started_at=math.nan))
    assert isinstance(back, State)
    assert math.isnan(back.started_at)
    assert there_and_back(config) == config


@given(st.floats())
def test_any_number_comes_back_as_it_was(value):
    told = there_and_back(State(epoch=1, started_at=value, flight=ThisFlight(armed_height=value)))
    assert isinstance(told, State)
    for one in (told.started_at, told.flight.armed_height):
        assert bits(one) == bits(value) or (math.isnan(one) and math.isnan(value))


def test_whole_numbers_and_truth_do_not_become_each_other():
    told = there_and_back(i.ArmRequest(1, True, 0, 0))
    assert isinstance(told, i.ArmRequest)
    assert (type(told.arm), type(told.triggers), type(told.day)) == (bool, int, int)


def test_enumerations_and_flags_come_back_as_they_were():
    status = ParachuteStatus("1", LinkState.STALE, armed_triggers=TriggerFlags(1 << 40))
    told = there_and_back(i.ParachuteReport(LINK, status))
    assert told == i.ParachuteReport(LINK, status)
    assert isinstance(told, i.ParachuteReport)
    assert type(told.status.armed_triggers) is TriggerFlags
    assert type(told.status.link_state) is LinkState


def told_story() -> Story:
    """A flight that ends under the parachute, with all that there is to remember."""
    story = Story(shipped("multirotor")).ready().fly(0.5)
    story.at(0.5, i.BlockRequest("upf_can", "33", True, "why"))
    story.fall(2.0)
    story.at(2.0, story.report(Action.KILL, Outcome.CONFIRMED))
    story.at(2.1, story.report(Action.DEPLOY, Outcome.ACCEPTED))
    assert story.state.stage is Stage.DEPLOYING
    assert story.state.flight.home
    return story


@pytest.mark.parametrize("whole", [False, True])
def test_a_whole_state_and_its_settings_come_back(whole):
    story = told_story()
    for value in (story.state, story.config):
        text = CODEC.to_json(value, whole)
        assert CODEC.to_json(CODEC.from_json(text), whole) == text
    assert str(CODEC.from_json(CODEC.to_json(story.state, whole))) == str(story.state)


def test_a_whole_record_does_not_rest_on_defaults():
    short, whole = (CODEC.to_json(SupervisorConfig(), one) for one in (False, True))
    assert short == '{"is":"SupervisorConfig"}'
    assert '"kill_to_deploy_delay":0.5' in whole


def test_every_output_comes_back():
    outputs = [output for _, output in told_story().outputs]
    assert {type(output).__name__ for output in outputs} >= {"Decide", "LogMessage"}
    for output in outputs:
        assert there_and_back(output) == output


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"is":"Parachute"}', "class Parachute is not known: written by another version"),
        ('{"is":"Rung","link":"a","colour":1,"age":2}', "Rung has no age, colour: written by an"),
        ('{"is":"Rung"}', "missing 1 required positional argument: 'link'"),
        ('{"link":"a"}', "'is'"),
        ('{"is":["Rung"]}', "unhashable"),
        ('{"is":"LinkHeartbeat","link":"a","link_state":99,"device_healthy":true,"seq":1}', "99"),
        ('{"is":"VehicleState","height":"high"}', "high"),
        ('{"is":"VehicleState","height":null}', "float"),
        ('{"is":"State","epoch":1,"started_at":0,"home":[1]}', "zip"),
        ('{"is":"State","epoch":1,"started_at":0,"links":[["a"]]}', "unpack"),
        ('{"is":"State","epoch":1,"started_at":0,"deploys":7}', "int"),
        ('{"is":"Rung","link":', "cannot be read"),
        ("", "cannot be read"),
        ("Rung(link='a')", "Rung"),
        (
            '{"is":"LinkLimits","stale_after":9.0}',
            "stale_after is 9.0 and lost_after is 1.0: a link is STALE before",
        ),
        ('{"is":"VehicleState","height":1%s}' % ("0" * 400), "int too large"),
        ('{"is":"VehicleState","height":"1.5"}', "'1.5' is no float"),
        ('{"is":"State","epoch":"1","started_at":0}', "'1' is no int"),
        ('{"is":"State","epoch":1,"started_at":{"is":"Rung","link":"a"}}', "is no float"),
        ('{"is":"DeployRequest","token":1,"force":0,"reason":"x"}', "0 is no bool"),
        ('{"is":"DeployRequest","token":1,"force":false,"reason":null}', "None is no str"),
        ('{"is":"VehicleReport","state":{"is":"Rung","link":"a"}}', "is no VehicleState"),
    ],
)
def test_what_does_not_fit_is_said(text, words):
    with pytest.raises(RecordError) as caught:
        CODEC.from_json(text)
    assert words in str(caught.value)


@given(st.text(max_size=60))
def test_no_text_raises_anything_else(text):
    with contextlib.suppress(RecordError):
        CODEC.from_json(text)


def test_the_armed_state_of_the_vehicle_is_not_lost_on_the_way():
    for armed in Armed:
        told = there_and_back(VehicleState(armed=armed))
        assert isinstance(told, VehicleState)
        assert told.armed is armed


def test_what_must_be_of_one_class_is_of_no_other():
    told = CODEC.to_json(i.DeployRequest(1, False, "why"))
    assert CODEC.from_json(told, i.Input) == i.DeployRequest(1, False, "why")
    for kind in (State, i.Output):
        with pytest.raises(RecordError, match="is no "):
            CODEC.from_json(told, kind)
    with pytest.raises(RecordError, match="None is no "):
        CODEC.from_json("null", i.Input)


class Colour(enum.Enum):
    RED = 1


@dataclass(frozen=True)
class Leaf:
    number: int = 3


@dataclass(frozen=True)
class Tree:
    leaf: Leaf
    leaves: tuple[Leaf, ...] = ()
    named: Mapping[Leaf, Leaf] = field(default_factory=lambda: MappingProxyType({}))
    picked: frozenset[Leaf] = frozenset()
    painted: Mapping[Colour, int] = field(default_factory=lambda: MappingProxyType({}))
    only: tuple[Colour] = (Colour.RED,)


@dataclass(frozen=True)
class Wood:
    trees: tuple[Tree, ...] = ()


@dataclass(frozen=True)
class Scale:
    weight: float = 0.0


@dataclass(frozen=True)
class Kitchen:
    scale: Scale = Scale()


def tree() -> Tree:
    leaf = Leaf()
    painted = MappingProxyType({Colour.RED: 7})
    return Tree(leaf, (leaf,), MappingProxyType({leaf: leaf}), frozenset({leaf}), painted)


def refusal(text: str) -> str:
    with pytest.raises(RecordError) as caught:
        Codec(Tree).from_json(text)
    return str(caught.value)


@pytest.mark.parametrize("whole", [False, True])
def test_what_a_class_is_made_of_comes_back_wherever_it_stands(whole):
    codec = Codec(Wood, Scale)
    for value in (tree(), Wood((tree(), tree())), Scale(1.5)):
        assert codec.from_json(codec.to_json(value, whole)) == value


def test_a_whole_record_does_not_rest_on_defaults_however_deep():
    leaf = '{"is":"Leaf","number":3}'
    assert Codec(Tree).to_json(tree(), whole=True) == (
        f'{{"is":"Tree","leaf":{leaf},"leaves":[{leaf}],"named":[[{leaf},{leaf}]],'
        f'"picked":[{leaf}],"painted":[[1,7]],"only":[1]}}'
    )
    assert Codec(Tree).to_json(Tree(Leaf())) == '{"is":"Tree","leaf":{"is":"Leaf"}}'


def test_only_the_classes_of_its_own_are_read():
    for stranger in ("Scale", "int", "Colour"):
        assert refusal(f'{{"is":"{stranger}"}}') == (
            f"cannot be read: class {stranger} is not known: written by another version "
            f'in \'{{"is":"{stranger}"}}\''
        )


def test_another_value_where_a_class_belongs_is_said_with_the_beginning_of_the_text():
    text = '{"is":"Tree","leaf":7,"leaves":[' + '{"is":"Leaf"},' * 9 + '{"is":"Leaf"}]}'
    assert refusal(text) == f"cannot be read: 7 is no Leaf in {text[:80]!r}"


@pytest.mark.parametrize("weight", [0, -0.0, False])
def test_what_only_equals_the_default_is_written(weight):
    codec = Codec(Kitchen)
    assert codec.to_json(Kitchen(Scale(0.0))) == '{"is":"Kitchen"}'
    scale = f'{{"is":"Scale","weight":{json.dumps(weight)}}}'
    assert codec.to_json(Scale(weight)) == scale
    assert codec.to_json(Kitchen(Scale(weight))) == f'{{"is":"Kitchen","scale":{scale}}}'


def test_what_is_neither_a_class_nor_a_number_of_one_is_read_as_it_stands():
    assert Codec(Tree).from_json('["a",7]') == ["a", 7]
    assert Codec(Tree).from_json('{"is":"Leaf","number":true}').number is True
