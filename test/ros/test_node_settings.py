"""The settings of every node: each field is checked as ROS is told, wherever it is set."""

import math
from collections.abc import Iterator
from dataclasses import fields, replace

import pytest

from chute_ros.errors import ParameterError
from chute_ros.links.api import load
from chute_ros.links.registered import links
from chute_ros.ros.parameters import descriptor
from chute_ros.ros.supervisor_parameters import SupervisorParameters
from chute_ros.settings import Parameter, Settings, parameters_of, settings_from
from chute_ros.tools.panel.parameters import PanelSettings
from chute_ros.tools.parameter_docs import NODES

ROOTS = (
    *(load(kind.parameters) for kind in links().values()),
    SupervisorParameters,
    PanelSettings,
)


def with_nested(kind: type[Settings]) -> Iterator[type[Settings]]:
    """These settings and all that they hold."""
    yield kind
    for field in fields(kind):  # type: ignore[arg-type]
        if isinstance(field.default, Settings):
            yield from with_nested(type(field.default))


CLASSES = sorted(
    {one for root in ROOTS for one in with_nested(root)}, key=lambda one: one.__name__
)
PLACES = [(kind, one) for kind in CLASSES for one in parameters_of(kind)]
NUMBERS = [(kind, one) for kind, one in PLACES if type(one.default) in (int, float)]
#: In settings that have them under a longer name in each node.
UNPREFIXED = {"stale_after", "lost_after", "regain_after", "timeout", "tries"}
every_number = pytest.mark.parametrize(
    ("kind", "one"), NUMBERS, ids=[f"{kind.__name__}.{one.name}" for kind, one in NUMBERS]
)


def refusal(kind: type[Settings], one: Parameter, value: float) -> str:
    """Why settings with this value are refused; empty: they are not."""
    try:
        settings_from(kind, {one.name: value})
    except ParameterError as error:
        return str(error)
    return ""


def limits(one: Parameter) -> tuple[float, float]:
    """As ROS is told."""
    told = descriptor(one)
    (span,) = [*told.floating_point_range, *told.integer_range]
    return span.from_value, span.to_value


def test_the_settings_of_the_nodes_are_all_looked_at():
    assert (len(CLASSES) >= 20, len(NUMBERS) >= 150) == (True, True)
    known = {one.name for _, one in PLACES}
    assert known == {one.name for all_of_it in NODES.values() for one in all_of_it} | UNPREFIXED


@every_number
def test_a_number_just_outside_its_range_is_refused_by_its_name(kind, one):
    low, high = limits(one)
    wrong: list[float] = [low - 1, high + 1]
    if isinstance(one.default, float):
        down, up = math.nextafter(low, -math.inf), math.nextafter(high, math.inf)
        wrong = [down, up, math.nan, math.inf, -math.inf]
    for value in wrong:
        said = f"parameter {one.name} is {value!r}: need {one.allowed()} ("
        assert refusal(kind, one, value).startswith(said)


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_so_it_is_where_the_field_is_set_in_python(kind):
    for field in fields(kind):  # type: ignore[arg-type]
        one = field.metadata.get(Parameter)
        if one is None or type(one.default) not in (int, float):
            continue
        for value in (one.minimum - 0.001, one.maximum + 1, math.nan):
            with pytest.raises(ParameterError, match=rf"^parameter \w+ is {value!r}: need a "):
                replace(kind(), **{field.name: value})  # type: ignore[type-var]


@every_number
def test_both_ends_of_the_range_that_ros_is_told_are_taken(kind, one):
    for end in limits(one):
        said = refusal(kind, one, end)
        # Another that has its default may contradict it.
        assert not said or f"{one.name} is {end}" in said.partition(": ")[0]
        assert "need a number (" not in said
        assert "need a whole number" not in said


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_a_field_of_another_type_or_choice_is_refused_by_its_name(kind):
    for one in parameters_of(kind):
        if not isinstance(one.default, (int, float)) or isinstance(one.default, bool):
            with pytest.raises(ParameterError, match=f"^parameter {one.name} is 7: need "):
                settings_from(kind, {one.name: 7})
        if one.choices:
            with pytest.raises(ParameterError, match=f"^parameter {one.name} is 'none': need "):
                settings_from(kind, {one.name: "none"})


@pytest.mark.parametrize("node", NODES)
def test_every_parameter_has_a_meaning_and_every_number_a_range(node):
    for one in NODES[node]:
        assert one.meaning, one.name
        assert one.meaning == one.meaning.strip(" .;"), one.name
        assert one.takes(one.default), one.name
        if type(one.default) in (int, float):
            assert None not in (one.minimum, one.maximum), one.name
        if isinstance(one.default, float):
            assert one.unit, one.name
    names = [one.name for one in NODES[node]]
    assert len(names) == len(set(names))
