"""What a launch file looks at before it starts anything.

ROS passes over a file that is missing and an argument that is misspelt, and a vehicle would start
on settings that nobody gave.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NoReturn, TypeVar

from chute_ros.errors import ChuteError, ParameterError
from chute_ros.links.api import SUPERVISOR, load
from chute_ros.links.registered import links
from chute_ros.ros.parameter_file import given_in
from chute_ros.ros.parameters import MISSPELT, nearest
from chute_ros.ros.supervisor_parameters import SupervisorParameters
from chute_ros.settings import Settings, parameters_of, settings_from

T = TypeVar("T")
#: When a simulated vehicle arms and takes off, s after its start: the supervisor is READY by then.
_ARMS_AT, _TAKES_OFF_AT = 10.0, 11.0
#: What can fail in a simulated flight -> the action of sim_autopilot.
_FAILURES = {"motor": "fail-motor", "autopilot": "reboot", "telemetry": "silent"}
#: Two more follow it, and there is none above 65535.
_LAST_PORT = 65533


def checked(launch_file: str, make: Callable[[], T]) -> T:
    """What make gives; where the user has made a mistake, one line and the exit code 2."""
    try:
        return make()
    except ChuteError as error:
        _refuse(f"{launch_file}: {error}")


def _refuse(text: str) -> NoReturn:
    print(text, file=sys.stderr)
    sys.exit(2)


def check_arguments(given: Iterable[str], known: Iterable[str]) -> None:
    """given: all launch arguments, others' as well. ParameterError: one of ours is misspelt."""
    known = list(known)
    for name in given:
        if name not in known and (near := nearest(name, known, MISSPELT)):
            raise ParameterError(f"there is no launch argument {name}: did you mean {near}?")


def check_port(text: str) -> int:
    """A UDP port with two more above it. ParameterError: it is none."""
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= _LAST_PORT):
        raise ParameterError(f"port is {text!r}: need a whole number from 1 to {_LAST_PORT}")
    return int(text)


def flight_script(fly: str, fail: str) -> list[str]:
    """Options of sim_autopilot for a flight. fly: its height, m; empty: it stands. fail: what
    fails and, after @, how long after the take-off, s; empty: nothing. ParameterError: they are
    none."""
    if not fly and not fail:
        return []
    height, (what, _, after) = _number(fly), fail.partition("@")
    if not 1.0 <= height <= 500.0:
        raise ParameterError(f"fly is {fly!r}: need a height from 1 to 500 (m), for example 60")
    script = {_ARMS_AT: "arm", _TAKES_OFF_AT: f"takeoff={height:g}"}
    if fail:
        seconds = _number(after)
        if what not in _FAILURES or not 0.0 <= seconds <= 3600.0:
            known = ", ".join(_FAILURES)
            raise ParameterError(
                f"fail is {fail!r}: need one of {known}, @ and seconds after the take-off from 0 "
                "to 3600, for example motor@15"
            )
        script[_TAKES_OFF_AT + seconds] = _FAILURES[what]
    return [word for at, action in script.items() for word in ("--at", f"{at:g}:{action}")]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def check_connections(given: Mapping[str, str]) -> None:
    """Launch arguments: device node -> its connection. ParameterError: the node refuses it."""
    for node, text in given.items():
        try:
            settings_from(_settings_of(node), {"connection": text})
        except ParameterError as error:
            argument = links()[node].argument.name
            raise ParameterError(f"launch argument {argument}: {error}") from None


def check_file(
    path: Path, namespace: str, nodes: Iterable[str], connections: Mapping[str, str]
) -> None:
    """The parameter file of these nodes. connections: node -> what overrides the file's.
    ParameterError: it cannot be read, or has nothing for one of them, or what it has cannot be."""
    for name in nodes:
        kind = _settings_of(name)
        given = given_in(path, f"{namespace}/{name}")
        if name in connections:
            given = {**given, "connection": connections[name]}
        known = [one.name for one in parameters_of(kind)]
        for other in given.keys() - set(known):
            if near := nearest(other, known, MISSPELT):
                raise ParameterError(
                    f"{path}: {name} has no parameter {other}: did you mean {near}?"
                )
        try:
            settings_from(kind, {one: given[one] for one in known if one in given})
        except ParameterError as error:
            raise ParameterError(f"{path}: {name}: {error}") from None


def _settings_of(name: str) -> type[Settings]:
    if name == SUPERVISOR:
        return SupervisorParameters
    kind: type[Settings] = load(links()[name].parameters)
    return kind
