"""A scenario as text that a person can read and change, and that stays the same flight when
scenarios are drawn differently one day."""

from __future__ import annotations

import json
import typing
from dataclasses import asdict
from typing import Any

from chute_ros.campaign.channel import Spell
from chute_ros.campaign.manoeuvre import Manoeuvre
from chute_ros.campaign.scenario import (
    Autopilot,
    Canopy,
    Failure,
    Fault,
    Person,
    Scenario,
    Taped,
    WayFault,
    flown_vehicles,
)
from chute_ros.errors import RecordError
from chute_ros.sim.flight import Descent
from chute_ros.sim.home import Homing

#: Rises when what is written means something else.
FORMAT = 2
_FAULTS: dict[str, type[Any]] = {one.__name__: one for one in typing.get_args(Fault)}
#: Fields that are parts of their own: none of them is told by null, or by being left out.
_PARTS: dict[str, type[Any]] = {
    "person": Person,
    "manoeuvre": Manoeuvre,
    "descent": Descent,
    "unheld": Descent,
    "canopy": Canopy,
    "autopilot": Autopilot,
    "tape": Taped,
}


def text_of(scenario: Scenario, was: str) -> str:
    """As JSON. was: what became of it, in words."""
    values = asdict(scenario)
    values["failure"] = scenario.failure.name
    values["autopilot"]["homing"] = scenario.autopilot.homing.name
    values["faults"] = [{"kind": type(one).__name__, **_short(one)} for one in scenario.faults]
    return json.dumps({"format": FORMAT, "was": was, "scenario": values}, indent=2) + "\n"


def scenario_of(text: str, named: str) -> tuple[Scenario, str]:
    """The scenario, and what became of it. RecordError, with the file's name: it is none."""
    try:
        whole = json.loads(text)
        if whole["format"] != FORMAT:
            raise RecordError(f"{named}: format {whole['format']}: need {FORMAT}")
        values = dict(whole["scenario"])
        if values["vehicle"] not in {one.name for one in flown_vehicles()}:
            raise RecordError(
                f"{named}: no link that is flown has a vehicle {values['vehicle']!r}"
            )
        values["failure"] = Failure[values["failure"]]
        values["faults"] = tuple(map(_fault, values["faults"]))
        if "vehicle_sources" in values:
            values["vehicle_sources"] = tuple(values["vehicle_sources"])
        if "autopilot" in values:
            homing = Homing[values["autopilot"]["homing"]]
            values["autopilot"] = {**values["autopilot"], "homing": homing}
        for name, kind in _PARTS.items():
            if values.get(name) is not None:
                values[name] = kind(**values[name])
        return Scenario(**values), str(whole["was"])
    except (KeyError, TypeError, ValueError) as error:
        what = type(error).__name__
        raise RecordError(f"{named} is no scenario of a campaign: {what}: {error}") from None


def _short(fault: Fault) -> dict[str, Any]:
    """Its fields; of a spell only what it does."""
    values = asdict(fault)
    if isinstance(fault, WayFault):
        spell = values["spell"]
        values["spell"] = {
            name: value for name, value in spell.items() if value or name in ("begin", "end")
        }
    return values


def _fault(values: dict[str, Any]) -> Fault:
    fields = dict(values)
    kind = _FAULTS[fields.pop("kind")]
    if kind is WayFault:
        fields["spell"] = Spell(**fields["spell"])
    made: Fault = kind(**fields)
    return made
