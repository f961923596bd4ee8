"""Executable sim_upf: a simulated Flyfire UPF parachute, controller and trigger, on a CAN bus."""

from __future__ import annotations

from chute_ros.errors import ParameterError
from chute_ros.links.upf.protocol import parameters as p
from chute_ros.sim.command_line import (
    main_of,
    number,
    parser,
    real,
    run_on_can,
    script_of,
    sensing_for,
)
from chute_ros.transport.address import FORMS


def _run() -> None:
    # Here, as all that needs the library of DroneCAN: main_of has a Ctrl-C end these imports.
    from chute_ros.links.upf.protocol.config import CONTROLLER_NODE_ID, TRIGGER_NODE_ID

    options = parser(
        "sim_upf",
        "A UPF parachute: controller and trigger, with all services, parameters and automatic "
        "functions of the document.",
        "mcast:0",
        "mute, unmute, silent, speak, reboot, error=NAME, clear-errors, deploy, trigger-error, "
        "trigger-stuck (it says yes, and nothing comes out), trigger-free, refuse (a release is "
        "answered with FAILED), accept, repack (the canopy is in its pod again) (NAME: of an "
        "ERROR_ constant of ParachuteStatus)",
        can=True,
    )
    for which, default in (("controller", CONTROLLER_NODE_ID), ("trigger", TRIGGER_NODE_ID)):
        options.add_argument(
            f"--{which}-node-id",
            type=number("node id", 0, 125),
            default=default,
            help=f"static node id; 0: requests one (default: {default})",
        )
        options.add_argument(f"--no-{which}", action="store_true", help=f"there is no {which}")
    options.add_argument(
        "--name",
        default="upf",
        help="of its nodes, from which their unique ids are made (default: upf)",
    )
    options.add_argument(
        "--error",
        action="append",
        default=[],
        metavar="NAME",
        help="of the controller at the start; may be given more than once",
    )
    options.add_argument("--dsdl-path", default="", help="folder flyfire with other data types")
    options.add_argument(
        "--parameter",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="of the controller, as delivered, for example 'Enable Auto-Arm=false'",
    )
    options.add_argument(
        "--minimum-height", type=real("m", 0.0, 10_000.0), default=0.0, help="m, for TYPE_DEPLOY"
    )
    options.add_argument(
        "--vehicle",
        metavar="WIRE",
        help=f"follow a simulated autopilot there, and open its canopy: {FORMS}",
    )
    options.add_argument("--system-id", type=number("id", 1, 255), default=1, help="of --vehicle")
    options.add_argument(
        "--break",
        dest="breaks",
        default="",
        metavar="CLAUSE",
        help="the controller, or the trigger in a clause trigger-*, is wrong in this clause of "
        "`conformance upf` (its --list names them)",
    )
    chosen = options.parse_args()

    from chute_ros.links.upf.protocol.definitions import PARACHUTE_STATUS, Definitions
    from chute_ros.links.upf.simulator.broken import (
        BREAKS,
        simulated_controller,
        simulated_trigger,
    )
    from chute_ros.links.upf.simulator.bus import UpfBus
    from chute_ros.links.upf.simulator.controller import ControllerSettings
    from chute_ros.links.upf.simulator.errors import error_places
    from chute_ros.links.upf.simulator.memory import CONTROLLER_PARAMETERS
    from chute_ros.links.upf.simulator.node import NodeSettings, UpfNode
    from chute_ros.transport.data_types import load_data_types

    definitions = Definitions(load_data_types(chosen.dsdl_path, "--dsdl-path"))
    values = {**CONTROLLER_PARAMETERS, p.STATIC_NODE_ID: chosen.controller_node_id}
    values |= _parameters(chosen.parameter)
    places = error_places(definitions, PARACHUTE_STATUS)
    for name in chosen.error:
        if name not in places:
            raise ParameterError(f"--error {name!r}: need one of {', '.join(places)}")
    settings = ControllerSettings(
        NodeSettings(f"{chosen.name}.controller", values),
        minimum_height=chosen.minimum_height,
        errors=frozenset(chosen.error),
    )
    if chosen.breaks and chosen.breaks not in BREAKS:
        raise ParameterError(f"--break {chosen.breaks!r}: need one of {', '.join(BREAKS)}")
    controller = simulated_controller(definitions, settings, chosen.breaks)
    trigger = simulated_trigger(
        definitions, f"{chosen.name}.trigger", chosen.trigger_node_id, chosen.breaks
    )
    nodes: list[UpfNode] = [] if chosen.no_controller else [controller]
    nodes += [] if chosen.no_trigger else [trigger]
    if not nodes:
        raise ParameterError("--no-controller and --no-trigger: nothing to simulate")

    sense = sensing_for(
        chosen, lambda motion: setattr(controller, "motion", motion), lambda: trigger.fired
    )
    run_on_can(UpfBus(nodes, script_of(chosen.at)), chosen, sense)


def _parameters(entries: list[str]) -> dict[str, p.Value]:
    """The entries of --parameter, taken as the device itself takes them."""
    from chute_ros.links.upf.simulator.memory import fitting

    values: dict[str, p.Value] = {}
    for entry in entries:
        name, equals, text = entry.partition("=")
        if not equals or name not in p.BY_NAME:
            known = ", ".join(p.BY_NAME)
            raise ParameterError(f"--parameter {entry!r}: need NAME=VALUE with one of {known}")
        documented = p.BY_NAME[name]
        kind = "boolean" if documented.kind is bool else "integer"
        wanted = p.parse(text, kind, f"--parameter {entry!r}: {name}")
        value = fitting(documented, wanted)
        if value is None:
            need = f"need {documented.minimum} to {documented.maximum}"
            raise ParameterError(f"--parameter {entry!r}: {name} cannot be {wanted}: {need}")
        values[name] = value
    return values


def main() -> None:
    """Run the simulator."""
    main_of(_run)


if __name__ == "__main__":
    main()
