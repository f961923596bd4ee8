"""A scenario as text that a person can read and change, and that stays the same flight when
scenarios are drawn differently one day."""

from __future__ import annotations

import json
import typing
from collections.abc import Collection, Iterator
from dataclasses import asdict
from typing import Any, NoReturn

from chute_ros.campaign.channel import Spell
from chute_ros.campaign.manoeuvre import Manoeuvre
from chute_ros.campaign.scenario import (
    AUTOPILOT_WAYS,
    PROFILES,
    ROS_WAYS,
    SECOND_SENSORS,
    STANDBY_WAYS,
    SUPERVISORS,
    Autopilot,
    Canopy,
    ClockJump,
    Failure,
    Fault,
    Person,
    Scenario,
    Stalls,
    Stop,
    Taped,
    WayFault,
    flown_vehicles,
    sensors_of,
    stopping_of,
    ways_of,
)
from chute_ros.campaign.sensors import SensorFault
from chute_ros.errors import RecordError
from chute_ros.protocol.vehicle_merge import VEHICLE_STATE
from chute_ros.sim.autopilot_kinds import KINDS
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
        whole = json.loads(text, parse_constant=_no_number)
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
                values[name] = _made(kind, values[name])
        scenario: Scenario = _made(Scenario, values)
        for what, name, known in _names(scenario):
            if name not in known:
                raise ValueError(f"{what} {name!r}: need one of {', '.join(known)}")
        if scenario.flights < 1:
            raise ValueError(f"flights is {scenario.flights}: need 1 or more")
        return scenario, str(whole["was"])
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
        fields["spell"] = _made(Spell, fields["spell"])
    made: Fault = _made(kind, fields)
    return made


def _made(kind: type[Any], values: dict[str, Any]) -> Any:
    """TypeError: a number is none."""
    made = kind(**values)
    for name, hint in typing.get_type_hints(kind).items():
        value = getattr(made, name)
        if hint in (int, float) and not isinstance(value, (int, float)):
            raise TypeError(f"{name} is {value!r}: need a number")
    return made


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number")


def _names(one: Scenario) -> Iterator[tuple[str, str, Collection[str]]]:
    """What each name in it is of, the name, and what is known."""
    ways = (*ways_of(one.vehicle), *ROS_WAYS, *STANDBY_WAYS, *SECOND_SENSORS)
    autopilot = () if one.is_rocket else AUTOPILOT_WAYS[:1]
    who = (*SUPERVISORS, *stopping_of(one.vehicle), *autopilot, *SECOND_SENSORS)
    yield "profile", one.profile, PROFILES
    yield "autopilot", one.autopilot.kind, KINDS
    for source in one.vehicle_sources:
        yield "vehicle source", source, (VEHICLE_STATE, *SECOND_SENSORS)
    for fault in one.faults:
        if isinstance(fault, WayFault):
            yield "way", fault.way, ways
        elif isinstance(fault, (Stop, Stalls, ClockJump)):
            yield "who", fault.who, who
        elif isinstance(fault, SensorFault):
            sensors = SECOND_SENSORS[fault.source] if fault.source else sensors_of(one.vehicle)
            yield "sensor", fault.sensor, sensors
            yield "how", fault.how, sensors[fault.sensor]
