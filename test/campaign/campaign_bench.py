"""What the tests of the campaign share: short flights, told in one line each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from chute_ros.campaign.flight import Flown, fly
from chute_ros.campaign.judge import Count, judge
from chute_ros.campaign.scenario import Failure, Fault, Scenario
from chute_ros.campaign.shipped import Shipped
from chute_ros.campaign.virtual_node import Acted
from chute_ros.model import Action

FOLDER = Path(__file__).parents[2] / "config" / "profiles"
SHIPPED = Shipped(FOLDER)


def scenario(failure: Failure, *faults: Fault, **more: Any) -> Scenario:
    """A multirotor with a MAVLink parachute; from 60 m, in still air, it fails 1 s after it is up.
    more: what is otherwise."""
    drawn: dict[str, Any] = {
        "vehicle": "mavlink",
        "profile": "multirotor",
        "height": 60.0,
        "gusts": 0.0,
        "fall_speed": 25.0,
        "burn": 0.0,
        "failure_at": 1.0,
    }
    return Scenario(1, failure=failure, faults=faults, **{**drawn, **more})


def rocket(failure: Failure, *faults: Fault, **more: Any) -> Scenario:
    """A rocket that turns over about 7 s after its launch."""
    drawn = {"vehicle": "umbilical", "profile": "rocket", "burn": 1.5, "arms": True}
    return scenario(failure, *faults, **{**drawn, **more})


def flown(failure: Failure, *faults: Fault, **more: Any) -> Flown:
    """The same, flown."""
    return fly(scenario(failure, *faults, **more), SHIPPED)


def correct(one: Flown) -> Flown:
    """One that is counted as correct."""
    judged = judge(one)
    assert judged.count is Count.CORRECT, judged.why
    return one


def left_alone(one: Flown) -> Flown:
    """The same, in which nothing was killed or released."""
    assert not fired(correct(one))
    return one


def fired(one: Flown) -> list[Acted]:
    """The kills and deploys that the device nodes acted on."""
    return [act for act in one.acted if act.decision.action in (Action.KILL, Action.DEPLOY)]
