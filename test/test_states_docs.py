"""docs/reference/states.* show what the tables say, and the table of stages has no dead end."""

import enum
import xml.etree.ElementTree
from collections.abc import Mapping
from pathlib import Path

from chute_ros.supervisor import lease
from chute_ros.supervisor.machine import TRANSITIONS, Stage, StageEvent
from chute_ros.tools import state_diagram
from chute_ros.tools.state_drawing import drawing

Transition = tuple[tuple[enum.Enum, enum.Enum], enum.Enum]
ROOT = Path(__file__).resolve().parent.parent


def unreached(transitions: Mapping[tuple[Stage, StageEvent], Stage]) -> set[Stage]:
    """The stages to which nothing leads from STARTUP."""
    reached, new = {Stage.STARTUP}, {Stage.STARTUP}
    while new:
        new = {after for (before, _), after in transitions.items() if before in new} - reached
        reached |= new
    return set(Stage) - reached


def never_left(transitions: Mapping[tuple[Stage, StageEvent], Stage]) -> set[Stage]:
    """The stages from which nothing leads to another."""
    return set(Stage) - {before for (before, _), after in transitions.items() if after != before}


def test_the_text_is_up_to_date() -> None:
    text = (ROOT / state_diagram.TEXT).read_text()
    assert text == state_diagram.states_text(), "run: make docs"


def told(text: str, events: type[enum.Enum], states: type[enum.Enum]) -> list[Transition]:
    """The transitions in the text's tables: (before, event), after."""
    found = []
    for line in text.splitlines():
        event, befores, after, *_ = [
            *(one.strip() for one in line.strip("| ").split(" | ")),
            "",
            "",
        ]
        if event in events.__members__:
            pairs = [(states[one], events[event]) for one in befores.split(", ")]
            found += [(pair, states[after]) for pair in pairs]
    return found


def test_the_text_has_every_transition_once() -> None:
    of_vehicle, of_lease = state_diagram.states_text().split("## Which of several")
    vehicle = told(of_vehicle, StageEvent, Stage)
    assert len(vehicle) == len(TRANSITIONS)
    assert dict(vehicle) == TRANSITIONS
    leading = told(of_lease, lease.LeaseEvent, lease.Role)
    assert len(leading) == len(lease.TRANSITIONS)
    assert dict(leading) == lease.TRANSITIONS
    arrows = state_diagram.states_text().count("-->")
    assert arrows == 0, "drawn as well, in a second language"


def test_the_picture_is_up_to_date() -> None:
    assert (ROOT / state_diagram.PICTURE).read_text() == drawing(), "run: make docs"


def test_every_stage_is_reached_and_left() -> None:
    assert unreached(TRANSITIONS) == set()
    assert never_left(TRANSITIONS) == set()


def test_a_dead_end_and_a_lost_stage_are_found() -> None:
    into = {pair: after for pair, after in TRANSITIONS.items() if after is not Stage.LANDED}
    assert unreached(into) == {Stage.LANDED}
    out = {pair: after for pair, after in TRANSITIONS.items() if pair[0] is not Stage.KILLING}
    assert never_left(out) == {Stage.KILLING}
    itself = {**out, (Stage.KILLING, StageEvent.KILL): Stage.KILLING}
    assert never_left(itself) == {Stage.KILLING}


def test_the_picture_has_every_stage_and_every_event() -> None:
    root = xml.etree.ElementTree.fromstring(drawing())
    texts = [element.text or "" for element in root.iter("{http://www.w3.org/2000/svg}text")]
    for stage in Stage:
        assert stage.name in texts
    told = " ".join(texts)
    assert [one.name for one in StageEvent if one.name not in told] == []
