"""What the command lines of all simulators share, and running one until the end."""

from __future__ import annotations

import argparse
import math
import signal
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

from chute_ros.errors import ChuteError, ParameterError
from chute_ros.sim.bundle import WireBundle
from chute_ros.sim.faults import FaultKnobs, FaultyLink
from chute_ros.transport.address import FORMS, parse_address
from chute_ros.transport.loop import LoopFault, WireChange, WireLoop
from chute_ros.transport.signing_key import signing_from_file
from chute_ros.transport.wire import make_wire

if TYPE_CHECKING:
    from chute_ros.sim.mavlink_device import MavlinkDevice


def parser(program: str, text: str, connection: str, actions: str) -> argparse.ArgumentParser:
    """Options that every simulator has."""
    options = argparse.ArgumentParser(program, description=text)
    options.add_argument(
        "--connection",
        action="append",
        metavar="WIRE",
        help=f"{FORMS}; may be given more than once (default: {connection})",
    )
    options.set_defaults(default_connection=connection)
    options.add_argument(
        "--at",
        action="append",
        default=[],
        metavar="SECONDS:ACTION",
        help=f"do this so long after the start; ACTION is one of {actions}",
    )
    for name, text in (
        ("loss", "probability that a packet is lost, 0 to 1, each way"),
        ("duplicate", "probability that a packet comes twice"),
        ("corrupt", "probability that a byte of a packet is wrong"),
        ("delay", "longest delay of a packet, s"),
    ):
        options.add_argument(f"--{name}", type=float, default=0.0, metavar="X", help=text)
    options.add_argument(
        "--signing-key-file",
        metavar="FILE",
        help="sign with this key (32 bytes or 64 hexadecimal digits), hear only what is signed",
    )
    options.add_argument("--seed", type=int, default=1, help="of the random faults (default: 1)")
    options.add_argument("--quiet", action="store_true", help="print nothing")
    return options


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

    def convert(text: str) -> int:
        try:
            value = int(text, 0)
        except ValueError:
            value = lowest - 1
        if not lowest <= value <= highest:
            raise argparse.ArgumentTypeError(f"{name} {text!r}: need {lowest} to {highest}")
        return value

    return convert


def _check_action(device: MavlinkDevice, action: str) -> None:
    name, equals, argument = action.partition("=")
    if name not in device.actions:
        known = ", ".join(sorted(device.actions))
        raise ParameterError(f"--at: action {name!r} is not known: need one of {known}")
    convert = device.arguments.get(name)
    if convert is None:
        if equals:
            raise ParameterError(f"--at: action {action!r}: {name} takes no argument")
        return
    try:
        convert(argument)
    except (KeyError, ValueError):
        text = f"--at: action {action!r}: {argument!r} is nothing that {name} can take"
        raise ParameterError(text) from None


def run(device: MavlinkDevice, options: argparse.Namespace) -> None:
    """Run device on its wires until SIGINT or SIGTERM; ends with 2 on a user's mistake."""
    for _, action in script_of(options.at):
        _check_action(device, action)
    if options.signing_key_file:
        device.sign(*signing_from_file(options.signing_key_file, 0, "--signing-key-file"))
    knobs = FaultKnobs(options.loss, options.duplicate, options.corrupt, options.delay)
    connections = options.connection or [options.default_connection]
    wires = [make_wire(parse_address(text)) for text in connections]
    started = time.monotonic()

    def show(events: list[Any]) -> None:
        for event in events:
            text = event.text if isinstance(event, (WireChange, LoopFault)) else event
            if not options.quiet or isinstance(event, LoopFault):
                print(f"{time.monotonic() - started:8.3f} {text}", flush=True)

    ended = threading.Event()
    for number_ in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number_, lambda *_: ended.set())
    link = FaultyLink(device, knobs, options.seed)
    loop = WireLoop(link, WireBundle(wires), show)
    loop.start()
    ended.wait()
    loop.stop()


def main_of(make: Any) -> None:
    """Run make() and turn a user's mistake into one line and exit code 2."""
    try:
        make()
    except ChuteError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
