"""Executable sim_autopilot: a simulated MAVLink autopilot that flies a small vertical model."""

from __future__ import annotations

from chute_ros.sim.command_line import main_of, number, parser, run, script_of


def _run() -> None:
    # Here, so that a dialect that is not built ends in one line and not in a traceback.
    from chute_ros.sim.autopilot_device import AutopilotDevice
    from chute_ros.sim.autopilot_kinds import KINDS

    options = parser(
        "sim_autopilot",
        "A MAVLink autopilot: arms, takes off, fails and falls; a PARACHUTE_STATUS with "
        "deployed opens its canopy.",
        "udpout:127.0.0.1:14550",
        "mute, unmute, silent, speak, reboot, arm, takeoff=HEIGHT, fly=HEIGHT (it arms, and takes "
        "off after 1 s), land, fail-motor, battery=VOLTS (it drains to them), wind=SPEED (m/s; "
        "its gusts move the vehicle), lie=KIND (of its estimator: climb and fall, which do not "
        "happen, stuck, or truth), mend (whole on the ground again, parachute packed)",
    )
    options.add_argument("--system-id", type=number("id", 1, 255), default=1)
    options.add_argument(
        "--autopilot",
        choices=tuple(KINDS),
        default="generic",
        help=(
            "autopilot to imitate, in heartbeat, parameters, arming and termination (px4 then "
            "orders the parachute's release itself)"
        ),
    )
    chosen = options.parse_args()
    kind = KINDS[chosen.autopilot]
    run(AutopilotDevice(chosen.system_id, script_of(chosen.at), kind=kind), chosen)


def main() -> None:
    """Run the simulator."""
    main_of(_run)


if __name__ == "__main__":
    main()
