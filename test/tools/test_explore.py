"""The exploration of the core finds what is broken."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from chute_ros.model import Action
from chute_ros.supervisor import core, deploying, policy, requests
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.state import State
from chute_ros.supervisor.turn import Turn
from chute_ros.tools.explore_properties import PROPERTIES
from chute_ros.tools.explorer import BEGINNINGS, Exploration, Explorer, main, page

ROOT = Path(__file__).parents[2]


def found_from(*beginnings: str) -> Exploration:
    explorer = Explorer(ROOT)
    return explorer.explore(1, {name: BEGINNINGS[name] for name in beginnings})


def test_one_step_from_every_beginning_holds() -> None:
    found = found_from(*BEGINNINGS)
    assert found.violation is None, found.story


@pytest.mark.long
def test_two_steps_from_every_beginning_hold_and_exercise_every_property() -> None:
    explorer = Explorer(ROOT)
    found = explorer.explore(2)
    assert found.violation is None, found.story
    assert [name for name in PROPERTIES if not explorer.properties.exercised[name]] == []
    text = page(found, explorer.properties, 2, len(explorer.steps))
    assert f"| stories at each depth | {found.stories[0]}, {found.stories[1]} |" in text


def test_a_gate_that_lets_everything_through_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(policy, "against_rule", lambda *_: "")
    found = found_from("in flight")
    assert found.violation is not None
    assert found.violation.name == "ground"
    assert found.story[:-1] == list(BEGINNINGS["in flight"]), "a shortest story"


def test_a_gate_that_lets_nothing_through_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(policy, "against_rule", lambda *_: "no")
    found = found_from("in flight")
    assert found.violation is not None
    assert found.violation.name == "at once"


def test_a_deploy_that_does_not_wait_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    ordered = policy.order_deploy

    def at_once(turn: Turn, rule: str, reasons: tuple[str, ...]) -> None:
        ordered(turn, rule, reasons)
        turn.deploying = replace(turn.deploying, deploy_due=turn.now)

    for module in (deploying, policy, requests):
        monkeypatch.setattr(module, "order_deploy", at_once)
    found = found_from("in flight")
    assert found.violation is not None
    assert found.violation.name == "delay"


def test_what_raises_and_what_leaves_in_shadow_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    update = core.update

    def shown(*given: object) -> tuple[State, tuple[i.Output, ...]]:
        state, outputs = update(*given)
        told = [
            replace(one, decision=replace(one.decision, shadow=False))
            if isinstance(one, i.Decide) and one.decision.action is Action.KILL
            else one
            for one in outputs
        ]
        return state, tuple(told)

    monkeypatch.setattr(core, "update", shown)
    found = found_from("in flight in SHADOW")
    assert found.violation is not None
    assert found.violation.name == "shadow"
    monkeypatch.setattr(core, "update", lambda *_: 1 / 0)
    found = found_from("the start")
    assert found.violation is not None
    assert found.violation.name == "raises"
    assert len(found.story) == 1


@pytest.mark.parametrize("depth", ["0", "-1", "deep"])
def test_without_a_step_nothing_would_be_explored(depth, monkeypatch, capsys) -> None:
    monkeypatch.setattr(sys, "argv", ["explore", "--depth", depth])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert f"--depth: {depth}: need a whole number, 1 or more" in capsys.readouterr().err
