"""Classes of every shape through a codec of their own."""

import enum
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import pytest

from chute_ros.errors import RecordError
from chute_ros.supervisor.codec import Codec


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
def test_what_a_class_is_made_of_comes_back_wherever_it_stands(whole: bool) -> None:
    codec = Codec(Wood, Scale)
    for value in (tree(), Wood((tree(), tree())), Scale(1.5)):
        assert codec.from_json(codec.to_json(value, whole)) == value


def test_a_whole_record_does_not_rest_on_defaults_however_deep() -> None:
    leaf = '{"is":"Leaf","number":3}'
    assert Codec(Tree).to_json(tree(), whole=True) == (
        f'{{"is":"Tree","leaf":{leaf},"leaves":[{leaf}],"named":[[{leaf},{leaf}]],'
        f'"picked":[{leaf}],"painted":[[1,7]],"only":[1]}}'
    )
    assert Codec(Tree).to_json(Tree(Leaf())) == '{"is":"Tree","leaf":{"is":"Leaf"}}'


def test_only_the_classes_of_its_own_are_read() -> None:
    for stranger in ("Scale", "int", "Colour"):
        assert refusal(f'{{"is":"{stranger}"}}') == (
            f"cannot be read: class {stranger} is not known: written by another version "
            f'in \'{{"is":"{stranger}"}}\''
        )


def test_another_value_where_a_class_belongs_is_said_with_the_beginning_of_the_text() -> None:
    text = '{"is":"Tree","leaf":7,"leaves":[' + '{"is":"Leaf"},' * 9 + '{"is":"Leaf"}]}'
    assert refusal(text) == f"cannot be read: 7 is no Leaf in {text[:80]!r}"


@pytest.mark.parametrize("weight", [0, -0.0, False])
def test_what_only_equals_the_default_is_written(weight: float) -> None:
    codec = Codec(Kitchen)
    assert codec.to_json(Kitchen(Scale(0.0))) == '{"is":"Kitchen"}'
    scale = f'{{"is":"Scale","weight":{json.dumps(weight)}}}'
    assert codec.to_json(Scale(weight)) == scale
    assert codec.to_json(Kitchen(Scale(weight))) == f'{{"is":"Kitchen","scale":{scale}}}'


def test_what_is_neither_a_class_nor_a_number_of_one_is_read_as_it_stands() -> None:
    assert Codec(Tree).from_json('["a",7]') == ["a", 7]
    assert Codec(Tree).from_json('{"is":"Leaf","number":true}').number is True
