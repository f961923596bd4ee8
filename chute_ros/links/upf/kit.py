"""The conformance kit of a UPF controller and of a trigger: what the command takes."""

from __future__ import annotations

import functools
from argparse import ArgumentParser, Namespace

from chute_ros.conformance.clause import Risk
from chute_ros.conformance.kit import Kit
from chute_ros.links.upf.conformance import CLAUSES
from chute_ros.links.upf.conformance.bench import (
    A_CONTROLLER,
    A_TRIGGER,
    DEPLOY_FORCE,
    DNA,
    TRIGGER,
    VEHICLE,
    UpfBench,
)
from chute_ros.links.upf.conformance.standard import DOCUMENT
from chute_ros.links.upf.conformance.trigger import BROADCAST
from chute_ros.links.upf.protocol.config import TRIGGER_NODE_ID
from chute_ros.links.upf.protocol.definitions import Definitions
from chute_ros.links.upf.simulator.broken import simulated_controller, simulated_trigger
from chute_ros.links.upf.simulator.bus import UpfBus
from chute_ros.links.upf.simulator.controller import ControllerSettings
from chute_ros.sim.command_line import number
from chute_ros.transport.can_address import CAN_FORMS, parse_can_address
from chute_ros.transport.can_wire import make_can_wire
from chute_ros.transport.data_types import load_data_types
from chute_ros.transport.wire import Wire

_NODE_ID = number("node id", 1, 125)
#: Of what is simulated, s.
_SOAK = 20.0
#: A fault for a while as it is only listened to, for the clause that needs one.
_FAULT = {"block-when-abnormal": [(2.0, "error=IMU"), (3.0, "clear-errors")]}


def _add_options(options: ArgumentParser) -> None:
    options.add_argument(
        "--node",
        type=_NODE_ID,
        default=0,
        metavar="ID",
        help="node id of what is tried (default: whoever tells the state of such a device)",
    )
    options.add_argument(
        TRIGGER, action="store_true", help="try a trigger, in place of a controller"
    )
    options.add_argument(
        BROADCAST,
        action="store_true",
        help="fire the trigger by the broadcast TriggerLaunch, in place of TriggerService",
    )
    options.add_argument(
        DEPLOY_FORCE,
        action="store_true",
        help="fire the controller by TYPE_DEPLOY_FORCE, in place of TYPE_DEPLOY",
    )
    options.add_argument(
        "--vehicle-node",
        type=_NODE_ID,
        default=VEHICLE,
        metavar="ID",
        help=f"node id of the vehicle that is simulated here (default: {VEHICLE})",
    )
    options.add_argument(
        "--bitrate",
        type=number("bit/s", 0, 8_000_000),
        default=0,
        metavar="BIT/S",
        help="of the bus",
    )
    options.add_argument(
        DNA, action="store_true", help="try a node id that is given out, in place of its own"
    )
    options.add_argument(
        "--dsdl-path", default="", metavar="FOLDER", help="the vendor's data types (flyfire)"
    )


def _bench(chosen: Namespace, risk: Risk) -> UpfBench:
    definitions = Definitions(load_data_types(chosen.dsdl_path, "--dsdl-path"))
    soak = chosen.soak or 0.0
    device = A_TRIGGER if chosen.trigger else A_CONTROLLER
    return UpfBench(definitions, risk, chosen.node, chosen.vehicle_node, soak, chosen.dna, device)


def _wire(chosen: Namespace) -> Wire:
    return make_can_wire(parse_can_address(chosen.connection, chosen.bitrate))


@functools.cache
def _ours() -> Definitions:
    return Definitions(load_data_types("", ""))


def _simulated(broken: str, needs: str) -> tuple[UpfBus, UpfBench]:
    """A trigger alone, or with a controller that is tried, at rest on a bench."""
    definitions = _ours()
    controller = simulated_controller(definitions, ControllerSettings(), broken)
    trigger = simulated_trigger(definitions, "upf.trigger", TRIGGER_NODE_ID, broken)
    alone = TRIGGER in needs
    bus = UpfBus([trigger] if alone else [controller, trigger], _FAULT.get(broken))
    device = A_TRIGGER if alone else A_CONTROLLER
    return bus, UpfBench(definitions, Risk.FIRES, soak=_SOAK, dna=DNA in needs, device=device)


KIT = Kit(
    document=DOCUMENT,
    clauses=CLAUSES,
    forms=CAN_FORMS,
    default_connection="mcast:0",
    add_options=_add_options,
    bench=_bench,
    wire=_wire,
    fires="take the canopy out and the charge or spring out of every trigger on the bus, and keep "
    "clear of them",
    simulated=_simulated,
)
