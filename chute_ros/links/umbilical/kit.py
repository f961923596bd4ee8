"""The conformance kit of a flight computer on an umbilical: what the command takes."""

from __future__ import annotations

import functools
from argparse import ArgumentParser, Namespace

from chute_ros.conformance.clause import Risk
from chute_ros.conformance.kit import Kit
from chute_ros.links.umbilical.conformance import CLAUSES
from chute_ros.links.umbilical.conformance.bench import UmbilicalBench
from chute_ros.links.umbilical.conformance.document import DOCUMENT
from chute_ros.links.umbilical.conformance.permits import REBOOT, WIPE
from chute_ros.links.umbilical.layout_files import add_layout_options, chosen_layout, load_layouts
from chute_ros.links.umbilical.protocol.layouts import Layout
from chute_ros.links.umbilical.simulator.broken import simulated_computer
from chute_ros.links.umbilical.simulator.flight_computer import FlightComputer
from chute_ros.links.umbilical.simulator.settings import FlightComputerSettings
from chute_ros.transport.address import SERIAL_FORMS, parse_serial_address
from chute_ros.transport.wire import Wire, make_wire

#: Of what is simulated, s.
_SOAK = 20.0


def _add_options(options: ArgumentParser) -> None:
    add_layout_options(options)
    options.add_argument(REBOOT, action="store_true", help="try what restarts the device")
    options.add_argument(
        WIPE, action="store_true", help="try what wipes its flash and FRAM: all that it stores"
    )


def _bench(chosen: Namespace, risk: Risk) -> UmbilicalBench:
    options = [name for name, given in ((REBOOT, chosen.reboot), (WIPE, chosen.wipe)) if given]
    return UmbilicalBench(chosen_layout(chosen), risk, options, chosen.soak or 0.0)


def _wire(chosen: Namespace) -> Wire:
    return make_wire(parse_serial_address(chosen.connection))


@functools.cache
def _reference() -> Layout:
    return load_layouts("", "the layouts")[0]


def _simulated(broken: str, needs: str) -> tuple[FlightComputer, UmbilicalBench]:
    """With the layout of the reference."""
    layout = _reference()
    device = simulated_computer(FlightComputerSettings(), layout, [], broken)
    return device, UmbilicalBench(layout, Risk.FIRES, (needs,), _SOAK)


KIT = Kit(
    document=DOCUMENT,
    clauses=CLAUSES,
    forms=SERIAL_FORMS,
    default_connection="usb:c0de:cafe",
    add_options=_add_options,
    bench=_bench,
    wire=_wire,
    fires="take charges, igniters and pressure off, and keep clear of valves and payload",
    simulated=_simulated,
)
