"""Explores the supervisor's core: every story of so many steps from each beginning (make explore).

Breadth first, so that the first story in which a property does not hold is a shortest one. That
story is printed, and the exit status is 1. Otherwise docs/evidence/exploration.md is written.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from chute_ros.supervisor import core
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.state import State
from chute_ros.supervisor.wakes import next_deadline
from chute_ros.tools.arguments import positive
from chute_ros.tools.explore_properties import (
    PROPERTIES,
    Properties,
    StoryMemory,
    Update,
    ViolationError,
)
from chute_ros.tools.explore_steps import (
    FIRST,
    HELD,
    LADDER,
    SECOND,
    SILENCE,
    TICK,
    TICK_OF_MANY,
    Step,
    configuration,
    steps,
)

START = 1000.0
_PAGE = Path("docs/evidence/exploration.md")
_FLYING = ("stands disarmed", "stands armed", "flies level")
_KILLING = (*_FLYING, f"tips over, for {HELD:g} s")
_KILL_CONFIRMED = (*_FLYING, "kill asked for", f"kill CONFIRMED by {FIRST}", "deploy asked for")
#: From where every story begins, each by the steps that lead there from the start.
BEGINNINGS: dict[str, tuple[str, ...]] = {
    "the start": (),
    "on the ground": ("stands disarmed",),
    "in flight": _FLYING,
    "a kill was asked for in flight": (*_FLYING, "kill asked for"),
    "a deploy waits for its kill": (*_FLYING, "tips over", "tips over", "deploy asked for"),
    "a rule has deployed": _KILLING,
    "the first step of a deploy": _KILL_CONFIRMED,
    "deployed": (*_KILL_CONFIRMED, "deploy CONFIRMED"),
    "no parachute came out": (*_KILL_CONFIRMED, *["deploy FAILED"] * len(LADDER)),
    "in flight in SHADOW": (*_FLYING, "mode SHADOW"),
    "in flight, INHIBITED": (*_FLYING, "mode INHIBITED"),
}


@dataclass(frozen=True)
class Node:
    """A state that was reached, and how."""

    state: State
    memory: StoryMemory
    now: float
    requests: int
    before: Node | None = None
    step: str = ""

    def story(self) -> list[str]:
        """The steps that lead here."""
        return [*(self.before.story() if self.before else []), *([self.step] if self.step else [])]


@dataclass
class Exploration:
    """What became of an exploration."""

    updates: int = 0
    #: At each depth.
    stories: list[int] = field(default_factory=list)
    story: list[str] = field(default_factory=list)
    violation: ViolationError | None = None


class Explorer:
    """Goes breadth first from every beginning."""

    def __init__(self, root: Path) -> None:
        self.config, self.steps = configuration(root), steps()
        self.properties = Properties(self.config)
        self.found = Exploration()

    def explore(
        self, depth: int, beginnings: dict[str, tuple[str, ...]] = BEGINNINGS
    ) -> Exploration:
        """Every story of up to depth steps from these beginnings."""
        try:
            front = list(map(self._begun, beginnings.values()))
            for level in range(1, depth + 1):
                front = list(self._after(front))
                self.found.stories.append(len(front))
                print(f"depth {level}: {len(front)} stories", file=sys.stderr, flush=True)
        except ViolationError as violation:
            self.found.violation = violation
        return self.found

    def _begun(self, names: tuple[str, ...]) -> Node:
        node = Node(State(epoch=7, started_at=START), StoryMemory(), START, 0)
        by_name = {step.name: step for step in self.steps}
        for name in names:
            after = self._taken(node, by_name[name])
            assert after is not None, f"{name} is not possible after {node.story()}"
            node = after
        return node

    def _after(self, front: list[Node]) -> Iterator[Node]:
        taken = (self._taken(node, step) for node in front for step in self.steps)
        return (after for after in taken if after is not None)

    def _taken(self, node: Node, step: Step) -> Node | None:
        """The node after a step, checked at each of its updates; None: it is not possible."""
        state, memory, now, number = node.state, node.memory, node.now, node.requests + 1
        end = node.now + step.lasts
        while now < end - 1e-9:
            if step.lasts <= TICK:
                now = end
            elif step.silent:
                # The node wakes at every deadline; here it is as late as it may be.
                wake = next_deadline(self.config, state, now)
                now = min(max(wake, now + TICK_OF_MANY), end)
            else:
                now = min(now + TICK_OF_MANY, end)
            inputs = step.make(state, now, number)
            if inputs is None:
                return None
            try:
                after, outputs = self._updated(state, inputs, now)
                memory = self.properties.check(memory, Update(state, after, inputs, outputs, now))
            except ViolationError:
                self.found.story = [*node.story(), step.name]
                raise
            state = after
        return Node(state, memory, now, number, node, step.name)

    def _updated(
        self, state: State, inputs: tuple[i.Input, ...], now: float
    ) -> tuple[State, tuple[i.Output, ...]]:
        self.found.updates += 1
        try:
            return core.update(self.config, state, inputs, now)
        except Exception as error:
            raise ViolationError("raises", repr(error)) from error


def page(found: Exploration, properties: Properties, depth: int, alphabet: int) -> str:
    """The whole of docs/evidence/exploration.md."""
    beginnings = [f"| {name} | {', '.join(path) or 'none'} |" for name, path in BEGINNINGS.items()]
    held = [f"| {text} | {properties.exercised[name]} |" for name, text in PROPERTIES.items()]
    return _PAGE_TEXT.format(
        depth=depth,
        alphabet=alphabet,
        found=found,
        stories=", ".join(map(str, found.stories)),
        ladder=", ".join(LADDER),
        tick=TICK,
        held_for=HELD,
        silence=SILENCE,
        second=SECOND,
        beginnings="\n".join(beginnings),
        properties="\n".join(held),
    )


_PAGE_TEXT = """\
# Exploration of the supervisor's core

Written by `make explore DEPTH={depth}`. From each of the beginnings below, every story of up to
{depth} further steps was given to the core as it runs in the node, with the profile
`config/profiles/multirotor.yaml`, two links that both kill and deploy, and the ladder {ladder}.
At every update all properties were checked; all held.

| | |
|---|---|
| steps to choose from | {alphabet} |
| depth after each beginning | {depth} |
| stories at each depth | {stories} |
| updates of the core | {found.updates} |

A step is an input of the vehicle, a link, a parachute, a device or a person, for {tick:g} s or for
{held_for:g} s (just over the longest hold of a rule that fires and of a landing), or silence for
{silence:g} s (just over the longest limit). `chute_ros/tools/explore_steps.py` lists them.

| beginning | steps that lead there from the start |
|---|---|
{beginnings}

| property | checks |
|---|---|
{properties}

A check counts if the property applied: a property without any check would be an error.
The core is explored for the stated number of steps and these inputs, in these times; the
property tests in `test/supervisor` go further, at random.
"""


def main() -> None:
    """Explore the repository in the present folder."""
    options = argparse.ArgumentParser("explore", description=__doc__)
    options.add_argument("--depth", type=positive, default=2)
    depth = options.parse_args().depth
    began = time.monotonic()
    explorer = Explorer(Path())
    found = explorer.explore(depth)
    if found.violation is not None:
        print(f"does not hold: {found.violation}\nafter:")
        print("\n".join(f"  {step}" for step in found.story))
        sys.exit(1)
    exercised = explorer.properties.exercised
    for name, text in PROPERTIES.items():
        print(f"{exercised[name]:9} checks: {text}")
    told = f"{sum(found.stories)} stories, depth {depth}"
    print(f"{told}; {time.monotonic() - began:.0f} s")
    if never := [name for name in PROPERTIES if not exercised[name]]:
        sys.exit(f"never exercised: {', '.join(never)}")
    _PAGE.write_text(page(found, explorer.properties, depth, len(explorer.steps)))
