"""The conformance kit of a MAVLink parachute: what the command takes."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from chute_ros.conformance.clause import Risk
from chute_ros.conformance.kit import Kit
from chute_ros.links.mavlink.conformance import CLAUSES
from chute_ros.links.mavlink.conformance.bench import MavlinkBench
from chute_ros.links.mavlink.conformance.commands import KEY
from chute_ros.links.mavlink.simulator.broken import simulated_parachute
from chute_ros.links.mavlink.simulator.parachute_device import ParachuteDevice, ParachuteSettings
from chute_ros.protocol.mavlink.signing import Signer, SigningClock, Verifier
from chute_ros.sim.command_line import number
from chute_ros.transport.address import FORMS, parse_address
from chute_ros.transport.signing_key import signing_from_file
from chute_ros.transport.wire import Wire, make_wire


def _add_options(options: ArgumentParser) -> None:
    options.add_argument(
        "--component",
        type=number("component id", 1, 255),
        metavar="ID",
        help="component id of the device (default: the first that is a parachute)",
    )
    options.add_argument(
        "--signing-key-file", metavar="FILE", help="the device's key; signing is tried as well"
    )


def _bench(chosen: Namespace, risk: Risk) -> MavlinkBench:
    file = chosen.signing_key_file
    key = None if file is None else signing_from_file(file, 0, "--signing-key-file")
    return MavlinkBench(risk, chosen.component, key, chosen.soak or 0.0)


def _wire(chosen: Namespace) -> Wire:
    return make_wire(parse_address(chosen.connection))


#: Of what is simulated, s; both sides have this key, and know the same time.
_SOAK, _SIMULATED_KEY, _UNIX_MINUS_MONOTONIC = 20.0, bytes(range(32)), 1_790_000_000.0


def _signing() -> tuple[Signer, Verifier]:
    clock = SigningClock(_UNIX_MINUS_MONOTONIC)
    return Signer(_SIMULATED_KEY, clock), Verifier(_SIMULATED_KEY, clock)


def _simulated(broken: str, needs: str) -> tuple[ParachuteDevice, MavlinkBench]:
    """Near the ground, or with a key, where the clause needs that."""
    cleared = "no" if broken == "release-near-ground" else "auto"
    device = simulated_parachute(ParachuteSettings(ground_cleared=cleared), [], broken)
    key = None
    if needs == KEY:
        device.sign(*_signing())
        key = _signing()
    return device, MavlinkBench(Risk.FIRES, None, key, _SOAK)


KIT = Kit(
    document="Parachute Protocol of MAVLink",
    clauses=CLAUSES,
    forms=FORMS,
    default_connection="udppair:127.0.0.1:14541:127.0.0.1:14540",
    add_options=_add_options,
    bench=_bench,
    wire=_wire,
    fires="take the canopy and the charge out, and keep clear of the pod",
    simulated=_simulated,
)
