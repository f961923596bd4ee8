"""What the command lines of all simulators share, and running one until the end."""

from __future__ import annotations

import argparse
import contextlib
import math
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

from chute_ros.errors import ChuteError, ParameterError
from chute_ros.interrupts import at_ctrl_c
from chute_ros.plain_text import plain
from chute_ros.sim.bundle import WireBundle
from chute_ros.sim.can_faults import CanFaultKnobs, CanFaultyLink
from chute_ros.sim.control import Acting, check_action, controlled
from chute_ros.sim.faults import FaultKnobs, FaultyLink
from chute_ros.sim.pty_wire import PtyWire
from chute_ros.sim.switched_wire import SwitchedWire
from chute_ros.transport.address import FORMS, parse_address
from chute_ros.transport.can_address import CAN_FORMS, parse_can_address
from chute_ros.transport.loop import ProtocolLink, WireLoop
from chute_ros.transport.signing_key import signing_from_file
from chute_ros.transport.wire import Wire, make_wire
from chute_ros.transport.wire_events import LoopFault, WireChange

if TYPE_CHECKING:
    from chute_ros.sim.mavlink_device import MavlinkDevice
    from chute_ros.sim.motion import Motion

#: What ends a simulator.
_ENDS = (signal.SIGINT, signal.SIGTERM)
KnobsT = TypeVar("KnobsT", bound=FaultKnobs)
_FAULTS = (
    ("loss", "probability that a packet is lost, 0 to 1, each way"),
    ("duplicate", "probability that a packet is duplicated"),
    ("corrupt", "probability that a byte of a packet (of a CAN frame: of its data) is wrong"),
    ("delay", "longest delay of a packet, s"),
)
_CAN_FAULTS = (
    ("reorder", "probability that a frame is overtaken by the frames of the next 2 ms"),
    ("toggle", "probability that a frame's toggle bit is wrong"),
    ("half", "probability that only the first frame of a transfer arrives"),
)


def parser(
    program: str, text: str, connection: str, actions: str, can: bool = False
) -> argparse.ArgumentParser:
    """Options that every simulator has. can: it is on a CAN bus, not on a MAVLink network."""
    options = argparse.ArgumentParser(program, description=text)
    options.add_argument(
        "--connection",
        action="append",
        metavar="WIRE",
        help=f"{CAN_FORMS if can else FORMS}; may be given more than once (default: {connection})",
    )
    options.set_defaults(default_connection=connection)
    _add_script(options, actions)
    for name, text in (*_FAULTS, *(_CAN_FAULTS if can else ())):
        options.add_argument(f"--{name}", type=float, default=0.0, metavar="X", help=text)
    if can:
        options.add_argument("--bitrate", type=number("bit/s", 0, 8_000_000), default=0)
    else:
        options.add_argument(
            "--signing-key-file",
            metavar="FILE",
            help=(
                "sign with this key (32 bytes or 64 hexadecimal digits), accept only signed frames"
            ),
        )
    _add_seed_and_quiet(options)
    return options


def parser_on_pty(program: str, text: str, actions: str) -> argparse.ArgumentParser:
    """Options of a simulator on a pseudo terminal, in place of those of a network."""
    options = argparse.ArgumentParser(program, description=text)
    options.add_argument(
        "--link",
        default="",
        metavar="PATH",
        help="have this symbolic link point to the pseudo terminal",
    )
    _add_script(options, actions)
    _add_seed_and_quiet(options)
    return options


def _add_script(options: argparse.ArgumentParser, actions: str) -> None:
    options.add_argument(
        "--at",
        action="append",
        default=[],
        metavar="SECONDS:ACTION",
        help=(
            f"do this so long after the start; ACTION is one of {actions}; cut (nothing passes on "
            "the first connection), restore"
        ),
    )
    options.add_argument(
        "--control",
        default="",
        metavar="PATH",
        help=(
            "a Unix datagram socket for this user alone: one datagram is one ACTION, done at once "
            'and answered with "ok" or why it is not done'
        ),
    )


def _add_seed_and_quiet(options: argparse.ArgumentParser) -> None:
    options.add_argument("--seed", type=int, default=1, help="of the random faults (default: 1)")
    options.add_argument("--quiet", action="store_true", help="print nothing")


def script_of(entries: list[str]) -> list[tuple[float, str]]:
    """The entries of --at as (seconds, action)."""
    script = []
    for entry in entries:
        seconds, colon, action = entry.partition(":")
        try:
            when = float(seconds)
        except ValueError:
            when = math.nan
        if not colon or not action or not 0.0 <= when < math.inf:
            raise ParameterError(f"--at {entry!r}: need SECONDS:ACTION, for example 5:reboot")
        script.append((when, action))
    return script


def number(name: str, lowest: int, highest: int) -> Any:
    """A converter for argparse: a whole number in this range, decimal or 0x..."""
    need = f"need {lowest} to {highest}"
    return _converter(name, lambda text: int(text, 0), lowest, highest, need)


def real(name: str, lowest: float, highest: float) -> Any:
    """The same for any number."""
    return _converter(name, float, lowest, highest, f"need {lowest:g} to {highest:g}")


def _converter(
    name: str, kind: Callable[[str], float], lowest: float, highest: float, need: str
) -> Any:
    def convert(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not lowest <= value <= highest:
            raise argparse.ArgumentTypeError(f"{name} {text!r}: {need}")
        return value

    return convert


def _check_script(device: Acting, options: argparse.Namespace) -> None:
    for _, action in script_of(options.at):
        try:
            check_action(device, action)
        except ParameterError as error:
            raise ParameterError(f"--at: {error}") from None


def run(device: MavlinkDevice, options: argparse.Namespace) -> None:
    """Run device on its wires until SIGINT or SIGTERM; ends with 2 on a user's mistake."""
    if options.signing_key_file:
        device.sign(*signing_from_file(options.signing_key_file, 0, "--signing-key-file"))
    link = FaultyLink(device, _knobs(FaultKnobs, options), options.seed)
    wires = _made(device, [make_wire(parse_address(text)) for text in _connections(options)])
    _check_script(device, options)
    _hold_signals()
    _run_link(device, link, wires, options)


def run_on_can(
    device: Acting,
    options: argparse.Namespace,
    beside: contextlib.AbstractContextManager[None],
) -> None:
    """The same on CAN buses. beside: what else runs meanwhile."""
    # Here: the simulators on MAVLink do without the library of DroneCAN.
    from chute_ros.transport.can_wire import make_can_wire

    link = CanFaultyLink(device, _knobs(CanFaultKnobs, options), options.seed)
    addresses = [parse_can_address(text, options.bitrate) for text in _connections(options)]
    wires = _made(device, [make_can_wire(address) for address in addresses])
    _check_script(device, options)
    _hold_signals()
    with beside:
        _run_link(device, link, wires, options)


def sensing_for(
    options: argparse.Namespace,
    felt: Callable[[Motion], None],
    released: Callable[[], bool],
) -> contextlib.AbstractContextManager[None]:
    """What runs beside a device that --vehicle lets feel a vehicle, and open its canopy."""
    if not options.vehicle:
        return contextlib.nullcontext()
    # Here: without a vehicle neither pymavlink nor the dialect is needed.
    from chute_ros.sim.vehicle_sense import sensing

    return sensing(options.vehicle, options.system_id, felt, released)


def run_on_pty(
    device: Acting,
    options: argparse.Namespace,
    beside: contextlib.AbstractContextManager[None] | None = None,
) -> None:
    """The same on a pseudo terminal, whose path is the first line that is printed."""
    # First, so that a mistake in it leaves no link behind.
    wire = PtyWire(options.link)
    first = _first_wire(device, wire, pulled=True)
    _check_script(device, options)
    # Whoever sees the link may end it at once.
    _hold_signals()
    try:
        wire.open()
    except OSError as error:
        raise ParameterError(f"--link {options.link!r}: {error}") from None
    if not options.quiet:
        print(wire.path + (f" linked from {options.link}" if options.link else ""), flush=True)
    with beside or contextlib.nullcontext():
        _run_link(device, device, [first], options)


def _knobs(kind: type[KnobsT], options: argparse.Namespace) -> KnobsT:
    return kind(**{one.name: getattr(options, one.name) for one in fields(kind)})


def _connections(options: argparse.Namespace) -> list[str]:
    return options.connection or [options.default_connection]


def _first_wire(device: Acting, wire: Wire, pulled: bool = False) -> Wire:
    """The wire to the nodes, which the device's actions cut and restore."""
    first = SwitchedWire(wire, pulled)
    device.add_action("cut", lambda _: first.cut())
    device.add_action("restore", lambda _: first.restore())
    return first


def _made(device: Acting, wires: Sequence[Wire]) -> list[Wire]:
    """Only the first can be cut: on others the simulators of one vehicle feel its motion."""
    return [_first_wire(device, wires[0]), *wires[1:]]


def _hold_signals() -> None:
    """From now on a signal that ends it waits until _run_link takes it. A handler would run in the
    middle of whatever the main thread does, and wait for a lock that this holds."""
    signal.pthread_sigmask(signal.SIG_BLOCK, _ENDS)


def _run_link(
    device: Acting,
    link: ProtocolLink,
    wires: list[Wire],
    options: argparse.Namespace,
) -> None:
    started = time.monotonic()

    def show(events: list[Any]) -> None:
        for event in events:
            text = event.text if isinstance(event, (WireChange, LoopFault)) else event
            if not options.quiet or isinstance(event, LoopFault):
                print(f"{time.monotonic() - started:8.3f} {plain(text)}", flush=True)

    loop = WireLoop(link, WireBundle(wires), show)
    with controlled(options.control, device, loop):
        loop.start()
        signal.sigwait(_ENDS)
    loop.stop()


def main_of(make: Any) -> None:
    """Run make() and turn a user's mistake into one line and exit code 2. Until its wires are
    taken a Ctrl-C ends it at once: as an exception it is lost in a library that passes over it,
    and the simulator would go on."""
    try:
        with at_ctrl_c(signal.SIG_DFL):
            make()
    except ChuteError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
