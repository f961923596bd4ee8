"""Executable sim_relay: a serial relay board as a pty, with a parachute on it."""

from __future__ import annotations

from chute_ros.links.relay.simulator.relay_board import RelayBoard
from chute_ros.sim.command_line import (
    main_of,
    number,
    parser_on_pty,
    run_on_pty,
    script_of,
    sensing_for,
)
from chute_ros.transport.address import FORMS


def _run() -> None:
    options = parser_on_pty(
        "sim_relay",
        "A serial relay board of one channel (LCUS-1): it makes a pseudo terminal, prints its "
        "path, and says when its channel closes and opens.",
        "stuck (the channel stays as it is), free, reboot, repack (the canopy is in its pod "
        "again)",
    )
    options.add_argument(
        "--vehicle",
        metavar="WIRE",
        help=f"open the canopy of a simulated autopilot there: {FORMS}",
    )
    options.add_argument("--system-id", type=number("id", 1, 255), default=1, help="of --vehicle")
    chosen = options.parse_args()
    board = RelayBoard(script_of(chosen.at))

    run_on_pty(board, chosen, sensing_for(chosen, lambda motion: None, lambda: board.fired))


def main() -> None:
    """Run the simulator."""
    main_of(_run)


if __name__ == "__main__":
    main()
