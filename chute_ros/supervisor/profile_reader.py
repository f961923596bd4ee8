"""Reads a profile of rules from YAML text, and says for each mistake its line and the fix.

The form of the file is described in docs/reference/rules.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Any

from chute_ros.errors import ParameterError, ProfileError
from chute_ros.model import FIRES, Action, Airframe
from chute_ros.supervisor.conditions import CONDITIONS
from chute_ros.supervisor.conditions.base import Condition
from chute_ros.supervisor.gate import OPERATOR
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measurements import STANDARD_LIMITS, Limits
from chute_ros.supervisor.profile_limits import (
    FASTEST_STANDING,
    HIGHEST_MINIMUM,
    LEAST_LEAK,
    LONGEST_HOLD,
    LONGEST_WARNING,
    MOST_SAMPLES,
    bounds,
    rule_problem,
)
from chute_ros.supervisor.rules import BelowMinimum, Clears, Profile, Rule
from chute_ros.supervisor.yaml_lines import ProfileLines, Where, compose

#: What a rule may want. ALARM: it is only said.
_ACTIONS = {
    "ALARM": Action.NONE,
    "FLIGHT_BLOCK": Action.FLIGHT_BLOCK,
    "KILL": Action.KILL,
    "DEPLOY": Action.DEPLOY,
}
_RULE_KEYS = (
    *("says", "source", "states", "conditions", "needed", "for", "leak", "samples"),
    *("doubted", "action", "clears"),
)
_PROFILE_KEYS = (
    *("profile", "vehicle", "minimum_height", "below_minimum", "low_height", "moving_speed"),
    *("landed_hold", "measurements", "rules"),
)
#: What a profile may set to a number: its least and its most.
_NUMBERS = {
    "minimum_height": (0.0, HIGHEST_MINIMUM),
    "low_height": (0.0, HIGHEST_MINIMUM),
    "landed_hold": (0.0, 60.0),
    "moving_speed": (0.1, FASTEST_STANDING),
}


def read_profile(text: str, name: str, links: Sequence[str]) -> Profile:
    """The profile in text. name: of the file, for the mistakes; links: those that are followed.

    ProfileError lists every mistake with its line and the fix.
    """
    reader = ProfileLines(name, links)
    profile = _profile(reader, compose(text, name))
    if reader.mistakes:
        raise ProfileError("\n".join(reader.mistakes))
    return profile


def _profile(reader: ProfileLines, where: Where) -> Profile:
    entries = reader.mapping(where, _PROFILE_KEYS, "a profile")
    for key in ("profile", "rules"):
        if key not in entries:
            reader.wrong(where.line, f"{key} is missing: a profile needs its name and its rules")
    known: dict[str, Any] = {"name": "", "rules": ()}
    if "profile" in entries:
        known["name"] = reader.text(entries["profile"], "profile")
    if "vehicle" in entries:
        known["vehicle"] = reader.member(entries["vehicle"], "vehicle", Airframe)
    for key, (least, most) in _NUMBERS.items():
        if key in entries:
            known[key] = reader.number(entries[key], key, least, most)
    if "below_minimum" in entries:
        word = reader.member(entries["below_minimum"], "below_minimum", BelowMinimum)
        known["below_minimum"] = word
    if "measurements" in entries:
        known["limits"] = reader.limits = _limits(reader, entries["measurements"])
    if "rules" in entries:
        rules = reader.mapping(entries["rules"], (), "rules")
        known["rules"] = tuple([_rule(reader, name, one) for name, one in rules.items()])
        if entries["rules"].is_mapping and not rules:
            text = "rules is empty: need at least one; the profile by_hand decides nothing itself"
            reader.wrong(entries["rules"].line, text)
    return Profile(**known)


def _limits(reader: ProfileLines, where: Where) -> MappingProxyType[str, Limits]:
    limits = dict(STANDARD_LIMITS)
    names = [field.name for field in fields(Limits)]
    for name, one in reader.mapping(where, STANDARD_LIMITS, "measurements").items():
        for key, value in reader.mapping(one, names, f"measurement {name}").items():
            number = reader.number(value, f"{key} of {name}", *bounds(name, key))
            if math.isnan(number):
                continue
            try:
                limits[name] = replace(limits[name], **{key: number})
            except ParameterError as error:
                reader.wrong(value.line, f"{name}: {error}")
    return MappingProxyType(limits)


def _rule(reader: ProfileLines, name: str, where: Where) -> Rule:
    what, before = f"rule '{name}'", len(reader.mistakes)
    entries = reader.mapping(where, _RULE_KEYS, what)
    if not name.strip():
        reader.wrong(where.line, "a rule has no name, by which its decisions are known: name it")
    if name == OPERATOR:
        reader.wrong(
            where.line, f"{what} has a person's name, whom no height holds back: rename it"
        )
    for key in ("conditions", "action", "states"):
        if key not in entries and where.is_mapping:
            reader.wrong(where.line, f"{what} has no {key}: add it")
    conditions: list[Condition] = []
    if "conditions" in entries:
        for one in reader.many(entries["conditions"], f"conditions of {what}"):
            condition = _condition(reader, what, one)
            if condition is not None:
                conditions.append(condition)
    states: list[Stage] = []
    if "states" in entries:
        for one in reader.many(entries["states"], f"states of {what}"):
            states.append(Stage[reader.choice(one, f"a state of {what}", Stage.__members__)])
    action = Action.NONE
    if "action" in entries:
        action = _ACTIONS[reader.choice(entries["action"], f"action of {what}", _ACTIONS)]
    weights = sum(condition.weight for condition in conditions)
    needed = weights
    if "needed" in entries:
        needed = reader.number(entries["needed"], f"needed of {what}", 1e-6, 1e6)
        if conditions and needed > weights + 1e-9:
            text = f"needed of {what} is {needed:g}: the weights of its conditions add up to only"
            reader.wrong(entries["needed"].line, f"{text} {weights:g}")
    rule = Rule(name, tuple(conditions), action, tuple(states), needed)
    rule = _timing(reader, what, entries, rule)
    if conditions and not any(one.counted for one in conditions):
        text = f"{what} counts nothing: one of its conditions must do without `counted: false`"
        reader.wrong(where.line, text)
    if not all(one.counted for one in conditions) and rule.clears is not Clears.NEVER:
        text = f"{what} would be full at once again: with `counted: false` it clears never"
        reader.wrong(where.line, text)
    if rule.samples > 1 and rule.hold <= 0.0:
        text = f"{what} needs {rule.samples} samples at once: add `for`, in which they may come"
        reader.wrong(entries["samples"].line, text)
    # What was written wrong stands for something else until it is put right.
    if conditions and len(reader.mistakes) == before:
        if problem := rule_problem(rule, reader.limits):
            reader.wrong(where.line, f"{what} {problem}")
        elif action is Action.DEPLOY:
            _check_deploy(reader, what, where.line, rule)
    return rule


def _timing(reader: ProfileLines, what: str, entries: dict[str, Where], rule: Rule) -> Rule:
    ends_flights = rule.action in FIRES
    longest = LONGEST_HOLD if ends_flights else LONGEST_WARNING
    least = LEAST_LEAK if ends_flights else 0.0
    readers: dict[str, Callable[[Where], dict[str, Any]]] = {
        "for": lambda w: {"hold": reader.number(w, f"for of {what}", 0.0, longest)},
        "leak": lambda w: {"leak": reader.number(w, f"leak of {what}", least, 100.0)},
        "samples": lambda w: {"samples": int(_whole(reader, w, f"samples of {what}"))},
        "doubted": lambda w: {"doubted": reader.number(w, f"doubted of {what}", 0.0, 1.0)},
        "clears": lambda w: {"clears": reader.member(w, f"clears of {what}", Clears)},
        "says": lambda w: {"says": reader.text(w, f"says of {what}")},
        "source": lambda w: {"source": reader.text(w, f"source of {what}")},
    }
    for key, read in readers.items():
        if key in entries:
            rule = replace(rule, **read(entries[key]))
    return rule


def _whole(reader: ProfileLines, where: Where, what: str) -> float:
    value = reader.number(where, what, 1, MOST_SAMPLES)
    if not math.isnan(value) and value != int(value):
        reader.wrong(where.line, f"{what} is {value:g}: need a whole number")
    return 1.0 if math.isnan(value) else value


def _condition(reader: ProfileLines, what: str, where: Where) -> Condition | None:
    options = [option for kind in CONDITIONS.values() for option in kind.options]
    entries = reader.mapping(
        where, (*CONDITIONS, *options, "counted", "weight"), f"a condition of {what}"
    )
    keys = [key for key in CONDITIONS if key in entries]
    fitting = [
        one for one in map(CONDITIONS.get, keys) if one and {*keys} <= {one.key, *one.borrowed}
    ]
    kind = fitting[0] if fitting else None
    if "counted" in entries and not (kind and kind.may_go_uncounted):
        reader.wrong(entries["counted"].line, "counted belongs to the autopilot: remove it here")
    weight = 1.0
    if "weight" in entries:
        weight = reader.number(entries["weight"], f"weight in {what}", 1e-6, 1e6)
    if kind is None:
        text = f"a condition of {what} needs one of {', '.join(CONDITIONS)}"
        reader.wrong(where.line, f"{text}; it has {', '.join(keys) or 'none'}")
        return None
    for owner in CONDITIONS.values():
        for option, belongs in owner.options.items():
            if option in entries and owner is not kind and option not in kind.borrowed:
                reader.wrong(entries[option].line, f"{belongs}: remove it here")
    return kind.parse(reader, what, where, entries, weight)


def _check_deploy(reader: ProfileLines, what: str, line: int, rule: Rule) -> None:
    """What the gate would never let through is a mistake of the profile."""
    silence = sum(condition.weight for condition in rule.conditions if condition.is_silence)
    if silence >= rule.needed - 1e-9:
        text = f"{what} would deploy on silence alone, which is never done"
        reader.wrong(line, f"{text}: raise needed above {silence:g}, or add a measurement")
    if not set(rule.states) <= {Stage.IN_FLIGHT, Stage.KILLING, Stage.DEPLOYED, Stage.FAULT}:
        text = f"{what} would deploy out of flight, which is never done"
        reader.wrong(line, f"{text}: its states may be IN_FLIGHT, KILLING, DEPLOYED and FAULT")
