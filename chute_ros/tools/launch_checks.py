"""What a launch file looks at before it starts anything.

ROS passes over a file that is missing and an argument that is misspelt, and a vehicle would start
on settings that nobody gave.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from chute_ros.errors import ChuteError, ParameterError, ProfileError
from chute_ros.links.api import SUPERVISOR, VehicleKind, load
from chute_ros.links.registered import links, package_of, vehicles
from chute_ros.ros.parameter_file import given_in, named_in
from chute_ros.ros.parameters import MISSPELT, check_names, nearest
from chute_ros.ros.supervisor_parameters import SupervisorParameters, config_from
from chute_ros.settings import Settings, parameters_of, settings_from
from chute_ros.sim.bench_actions import (
    AUTOPILOT,
    FLIGHT_COMPUTER,
    LIGHT_AIR,
    SimulatorOrder,
    actions_of,
)

T = TypeVar("T")
#: When a simulated vehicle arms and takes off, s after its start: the supervisor is READY by then.
_ARMS_AT, _TAKES_OFF_AT = 10.0, 11.0
#: What can fail in a simulated flight, as fail:= names it -> its action in the table of actions.
FAILURES = {
    "motor": "fail_motor",
    "autopilot": "restart_autopilot",
    "telemetry": "silence_autopilot",
    "link": "cut_vehicle_link",
    "lie": "make_height_lie",
    "stuck": "freeze_estimator",
    "battery": "low_battery",
    "parachute": "restart_parachute",
    "parachute_link": "cut_parachute_link",
    "drogue": "fail_drogue",
    "computer": "restart_flight_computer",
    "umbilical": "cut_umbilical",
    "refuse": "refuse_to_open",
}
#: Arguments that `ros2 launch` itself adds to those of a launch file, for its options.
_OF_LAUNCH = ("launch-prefix", "launch-prefix-filter")
#: Where launch_ros keeps the namespace that a launch file has pushed.
_PUSHED = "ros_namespace"
#: Exit code of a node that refuses its settings (chute_ros/ros/entry.py), and how long after the
#: launch that still ends the launch, s: later the other nodes may be in the air.
_REFUSED, _STARTS_WITHIN = 2, 60.0
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


def refused_at_start(node: str) -> Callable[[Any, Any], None]:
    """For on_exit of a node that is started again whenever it dies: a node that refuses to start
    ends the whole launch, which would otherwise start it for ever. What `ros2 launch` catches from
    an event is told in one line, and becomes its exit code 1."""
    made = time.monotonic()
    exits = 0

    def on_exit(event: Any, context: Any) -> None:
        nonlocal exits
        exits += 1
        if (
            exits == 1
            and event.returncode == _REFUSED
            and time.monotonic() - made < _STARTS_WITHIN
        ):
            raise RuntimeError(
                f"{node} refuses to start, for the reason that it has printed above"
            )

    return on_exit


def given_to(context: Any) -> list[str]:
    """The arguments that a user gave the launch file that now begins (a LaunchContext), by name;
    none where another launch file includes it: what is in the context then is that one's too."""
    inside, began = context.get_locals_as_dict(), _began_with(context)
    for entity in began.describe_sub_entities() if began else ():
        source = getattr(entity, "launch_description_source", None)
        place = os.path.abspath(source.location) if source else ""
        if source and place == inside.get("current_launch_file_path"):
            return [name for name, _ in entity.launch_arguments if isinstance(name, str)]
    return []


def _began_with(context: Any) -> Any:
    """The description that the launch began with, in which what is launched is itself included;
    None: a later event includes the launch file."""
    return getattr(context.get_locals_as_dict().get("event"), "launch_description", None)


def check_arguments(context: Any, known: Iterable[str]) -> None:
    """context: a LaunchContext before the defaults are set. ParameterError: an argument is given
    that the launch file does not have; of an including file's only one that is ours misspelt and
    that no launch file declares."""
    known = list(known)
    for name in given_to(context):
        if name not in (*known, *_OF_LAUNCH):
            near = nearest(name.lower(), known, MISSPELT)
            hint = f"did you mean {near}?" if near else f"need one of {', '.join(known)}"
            raise ParameterError(f"there is no launch argument {name}: {hint}")
    began = _began_with(context)
    declared = {one.name for one in began.get_launch_arguments()} if began else set()
    for name in context.launch_configurations:
        if name not in (*known, *declared) and (near := nearest(name, known, MISSPELT)):
            raise ParameterError(f"there is no launch argument {name}: did you mean {near}?")


def place_of(context: Any, namespace: str) -> str:
    """The whole namespace of the nodes that get this one, as launch_ros makes it: under what an
    including file has pushed (PushRosNamespace). Empty: the root."""
    pushed = "" if namespace.startswith("/") else context.launch_configurations.get(_PUSHED, "")
    return "/".join(["", *filter(None, f"{pushed}/{namespace}".split("/"))])


def check_links(context: Any, parachute: str, connections: Mapping[str, str]) -> None:
    """connections: device node -> what the argument of its link is given, empty: nothing.
    ParameterError: it is given for a link that this parachute does not start, which would be
    passed over. Of an including file, whose own argument it may be, that is only told."""
    for node, text in connections.items():
        if not text or node in vehicles()[parachute].links:
            continue
        name = links()[node].argument.name
        fits = " or ".join(
            f"parachute:={one}" for one in vehicles() if node in vehicles()[one].links
        )
        told = f"launch argument {name} is {text!r}, and parachute:={parachute} starts no {node}"
        if name in given_to(context):
            raise ParameterError(f"{told}: need {fits}, or leave {name} out")
        print(f"{told}: it is not used", file=sys.stderr)


def check_port(text: str) -> int:
    """A UDP port with two more above it. ParameterError: it is none."""
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= _LAST_PORT):
        raise ParameterError(f"port is {text!r}: need a whole number from 1 to {_LAST_PORT}")
    return int(text)


@dataclass(frozen=True)
class FlightArguments:
    """What a simulated vehicle is to do by itself, as given; empty: nothing of the kind.

    fly: height to which it takes off, m; launch: how long after the start a rocket launches, s;
    fail: what fails, each with @ and how long after the take-off or the launch, s, with commas
    between them; wind: m/s; empty: light air.
    """

    fly: str = ""
    launch: str = ""
    fail: str = ""
    wind: str = ""

    def options(self, simulators: Sequence[str]) -> dict[str, list[str]]:
        """Simulator -> what its command line has besides. ParameterError: this cannot be, or not
        of a vehicle with these simulators."""
        begins, script = self._begin(simulators)
        if self.wind:
            _needs("wind", self.wind, AUTOPILOT, simulators)
        if AUTOPILOT in simulators:
            wind = self.wind or f"{LIGHT_AIR:g}"
            speed = _within("wind", wind, 30.0, "a speed", "m/s", "5")
            script.append((0.0, (AUTOPILOT, f"wind={speed:g}")))
        for one in filter(None, self.fail.split(",")):
            after, orders = _failure(one, simulators)
            script += [(begins + after, order) for order in orders]
        if self.fail and math.isnan(begins):
            need = "launch" if FLIGHT_COMPUTER in simulators else "fly"
            raise ParameterError(f"fail is {self.fail!r}: need {need} too, which it counts from")
        options: dict[str, list[str]] = {}
        for at, (simulator, action) in script:
            options.setdefault(simulator, []).extend(("--at", f"{at:g}:{action}"))
        return options

    def _begin(
        self, simulators: Sequence[str]
    ) -> tuple[float, list[tuple[float, SimulatorOrder]]]:
        """When the vehicle leaves the ground, s after its start, NaN: never; and its orders."""
        if self.launch:
            _needs("launch", self.launch, FLIGHT_COMPUTER, simulators)
            begins = _within("launch", self.launch, 3600.0, "a time after the start", "s", "12")
            return begins, [(begins, (FLIGHT_COMPUTER, "launch"))]
        if self.fly:
            _needs("fly", self.fly, AUTOPILOT, simulators)
            height = _within("fly", self.fly, 500.0, "a height", "m", "60", lowest=1.0)
            takes_off = (AUTOPILOT, f"takeoff={height:g}")
            return _TAKES_OFF_AT, [(_ARMS_AT, (AUTOPILOT, "arm")), (_TAKES_OFF_AT, takes_off)]
        return math.nan, []


def _failure(text: str, simulators: Sequence[str]) -> tuple[float, tuple[SimulatorOrder, ...]]:
    """How long after the take-off, s, which orders."""
    what, _, after = text.strip().partition("@")
    orders = {one.name: one.orders for one in actions_of(simulators)}
    known = [word for word, name in FAILURES.items() if name in orders]
    seconds = _number(after)
    if not known:
        raise ParameterError(
            f"fail is {text!r}: nothing can fail in a vehicle with {', '.join(simulators)}: leave "
            "fail out"
        )
    if what not in known or not 0.0 <= seconds <= 3600.0:
        raise ParameterError(
            f"fail is {text!r}: need one of {', '.join(known)}, @ and seconds after the take-off "
            f"or launch from 0 to 3600, for example {known[0]}@15"
        )
    return seconds, orders[FAILURES[what]]


def _within(
    name: str, text: str, highest: float, what: str, unit: str, example: str, lowest: float = 0.0
) -> float:
    if not lowest <= (value := _number(text)) <= highest:
        raise ParameterError(
            f"{name} is {text!r}: need {what} from {lowest:g} to {highest:g} ({unit}), "
            f"for example {example}"
        )
    return value


def _needs(name: str, text: str, simulator: str, simulators: Sequence[str]) -> None:
    if simulator not in simulators:
        raise ParameterError(
            f"{name} is {text!r}: need a vehicle with {simulator}; "
            f"this one has {', '.join(simulators)}"
        )


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
        known = [one.name for one in parameters_of(_settings_of(name))]
        given = given_in(path, f"{namespace}/{name}")
        for other in given.keys() - set(known):
            if near := nearest(other, known, MISSPELT):
                raise ParameterError(
                    f"{path}: {name} has no parameter {other}: did you mean {near}?"
                )
        check_names(named_in(path, f"{namespace}/{name}"), known, f"{path}: {name}")
        own = {one: given[one] for one in known if one in given}
        _check_values(name, _with_connection(own, connections.get(name)), str(path))


def check_vehicle(vehicle: VehicleKind, connections: Mapping[str, str]) -> dict[str, Any]:
    """Node -> what a vehicle without a parameter file gives it. connections: node -> its own.
    ParameterError: a link's entry has given a parameter that is none, or cannot be so."""
    given = {}
    for name in (*vehicle.links, SUPERVISOR):
        known = [one.name for one in parameters_of(_settings_of(name))]
        own = vehicle.parameters.get(name, {})
        whose = f"vehicle {vehicle.name} of {package_of(vehicle.name)}"
        check_names(own, known, f"{whose}: {name}")
        given[name] = _with_connection(own, connections.get(name))
        _check_values(name, given[name], whose)
    return given


def _with_connection(given: Mapping[str, Any], connection: str | None) -> dict[str, Any]:
    return {**given, "connection": connection} if connection else {**given}


def _check_values(node: str, given: Mapping[str, Any], whose: str) -> None:
    try:
        if node == SUPERVISOR:
            config_from(given)  # with its profile
        else:
            settings_from(_settings_of(node), given)
    except (ParameterError, ProfileError) as error:
        raise type(error)(f"{whose}: {node}: {error}") from None


def _settings_of(name: str) -> type[Settings]:
    if name == SUPERVISOR:
        return SupervisorParameters
    kind: type[Settings] = load(links()[name].parameters)
    return kind
