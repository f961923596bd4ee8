"""One update of the core as it goes on: what is known by now, and what is to be done."""

from __future__ import annotations

from operator import attrgetter
from typing import Any, TypeVar, cast

from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.machine import TRANSITIONS, StageEvent
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.state import (
    Alarms,
    DeployUnderWay,
    HeardHere,
    Killing,
    Own,
    State,
    ThisFlight,
)
from chute_ros.transitions import after

T = TypeVar("T")
#: Alarms that are remembered: a device that repeats itself must not grow us.
_MOST_ALARMS = 16


def _group(kind: type[T], name: str) -> T:
    """A group of the turn's state, to be read and replaced under its name."""

    def put(turn: Turn, value: T) -> None:
        changed: dict[str, Any] = {name: value}
        turn.state = replace(turn.state, **changed)

    # attrgetter calls no Python: it is read all the time.
    return cast(T, property(attrgetter(f"state.{name}"), put))


class Turn:
    """Carries state from part to part of an update and collects its outputs."""

    killing = _group(Killing, "killing")
    deploying = _group(DeployUnderWay, "deploying")
    flight = _group(ThisFlight, "flight")
    alarming = _group(Alarms, "alarming")
    heard = _group(HeardHere, "heard")
    own = _group(Own, "own")

    def __init__(self, config: SupervisorConfig, state: State, now: float) -> None:
        self.config, self.state, self.now = config, state, now
        #: As it was at the end of the last update.
        self.before = state
        self.outputs: list[i.Output] = []

    @property
    def ladder(self) -> tuple[Rung, ...]:
        """The steps of the deploy."""
        return self.state.ladder(self.config)

    def move(self, event: StageEvent, why: str = "") -> None:
        """To the stage that the table names."""
        before = self.state.stage
        stage = after(TRANSITIONS, before, event)
        if stage is before:
            return
        self.state = replace(self.state, stage=stage, stage_since=self.now)
        text = f"{before.name} -> {stage.name}: {event.value}"
        self.log(f"{text} ({why})" if why else text)

    def log(self, text: str) -> None:
        """A line for the log."""
        self.outputs.append(i.LogMessage(text))

    def warn(self, text: str) -> None:
        """An alarm of what happens now."""
        self.outputs.append(i.LogMessage(text, alarm=True))

    def alarm(self, text: str) -> None:
        """Something that stays until a reset, or until what it tells is over."""
        if text not in self.alarming.alarms:
            alarms = (*self.alarming.alarms, text)[-_MOST_ALARMS:]
            self.alarming = replace(self.alarming, alarms=alarms)
        self.warn(text)

    def finish(self, token: int, success: bool, accepted: bool, message: str) -> None:
        """Answer a request; token 0: nobody waits."""
        if token:
            self.outputs.append(i.Finish(token, success, accepted, message))
