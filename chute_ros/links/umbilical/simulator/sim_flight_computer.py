"""Executable sim_flight_computer: a rocket's flight computer on the serial umbilical, as a pty."""

from __future__ import annotations

import time

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.layout_files import add_layout_options, chosen_layout
from chute_ros.links.umbilical.simulator.broken import BREAKS, simulated_computer
from chute_ros.links.umbilical.simulator.settings import FlightComputerSettings
from chute_ros.sim.command_line import main_of, parser_on_pty, run_on_pty, script_of

#: Options of the settings of these names: with a number, and without.
_NUMBERS = (
    ("rate", "HZ", "lines of telemetry a second"),
    ("speed", "FACTOR", "the flight is this much faster than real time"),
    ("heartbeat-timeout", "S", "s without a heartbeat until it counts as disconnected"),
    ("cut", "X", "probability that a line is cut, 0 to 1"),
    ("garbage", "X", "probability that random bytes follow a line, 0 to 1"),
)
_SWITCHES = (
    ("debug", "log lines on the wire"),
    ("interlock", "arming needs a wiped flash"),
    ("drogue-fails", "at the apogee nothing comes out; the command still works"),
    ("safe-opens-sv", "<V> opens SV, as newer firmware does"),
    ("faults-on-heartbeat", "a <H> in Ascent or Coast is a fault"),
    ("binary-dump", "<G> sends bytes in place of lines"),
)


def _run() -> None:
    start = FlightComputerSettings()
    options = parser_on_pty(
        "sim_flight_computer",
        "A rocket's flight computer on its serial umbilical: it makes a pseudo terminal, prints "
        "its path, sends $TELEM lines there and takes the commands of the Umbilical Reference.",
        "mute, unmute, silent, speak, launch (the key is turned first), stuck (neither drogue nor "
        "main comes out), free, drogue-fails (not by itself), fault, reboot, jump=MODE, land, "
        "mend (on its pad again, canopies packed), wipe-fails, wipe-hangs, lose-dump-end, "
        "dump-stalls (MODE: Startup, Standby, Ascent, Coast, DrogueDeployed, MainDeployed, Fault)",
    )
    add_layout_options(options)
    for name, unit, text in _NUMBERS:
        default = getattr(start, name.replace("-", "_"))
        text = f"{text} (default: {default:g})"
        options.add_argument(f"--{name}", type=float, default=default, metavar=unit, help=text)
    for name, text in _SWITCHES:
        options.add_argument(f"--{name}", action="store_true", help=text)
    options.add_argument(
        "--break",
        dest="breaks",
        default="",
        metavar="CLAUSE",
        help="it is wrong in this clause of `conformance umbilical` (its --list names them)",
    )
    chosen = options.parse_args()
    given = [name.replace("-", "_") for name, *_ in (*_NUMBERS, *_SWITCHES)]
    settings = FlightComputerSettings(
        time_of_day=time.time() % 86_400.0,
        seed=chosen.seed,
        **{name: getattr(chosen, name) for name in given},
    )
    if chosen.breaks and chosen.breaks not in BREAKS:
        raise ParameterError(f"--break {chosen.breaks!r}: need one of {', '.join(BREAKS)}")
    script = script_of(chosen.at)
    device = simulated_computer(settings, chosen_layout(chosen), script, chosen.breaks)
    run_on_pty(device, chosen)


def main() -> None:
    """Run the simulator."""
    main_of(_run)


if __name__ == "__main__":
    main()
