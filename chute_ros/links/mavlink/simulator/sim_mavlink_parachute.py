"""Executable sim_mavlink_parachute: a simulated MAVLink parachute module."""

from __future__ import annotations

import argparse

from chute_ros.model import DeploymentTrigger, ErrorFlags
from chute_ros.sim.command_line import main_of, number, parser, real, run, script_of


def _run() -> None:
    # Here, so that a dialect that is not built ends in one line and not in a traceback.
    from chute_ros.links.mavlink.simulator.broken import BREAKS, simulated_parachute
    from chute_ros.links.mavlink.simulator.parachute_device import ParachuteSettings

    start = ParachuteSettings()
    options = parser(
        "sim_mavlink_parachute",
        "A MAVLink parachute module on the public protocol's ports: it listens on 14540 and "
        "sends to 14541.",
        "udppair:127.0.0.1:14540:127.0.0.1:14541",
        "mute, unmute, silent, speak, reboot, error=NAME, clear-errors, deploy=TRIGGER "
        "(names of PARACHUTE_ERROR_FLAGS and PARACHUTE_DEPLOYMENT_TRIGGER without their prefix), "
        "refuse (a release is answered with FAILED), accept, repack (the canopy is in its pod "
        "again)",
    )
    options.add_argument("--system-id", type=number("id", 1, 255), default=start.system_id)
    options.add_argument("--component-id", type=number("id", 1, 255), default=start.component_id)
    options.add_argument(
        "--armed",
        type=number("mask", 0, 255),
        default=0,
        help="PARACHUTE_TRIGGER_FLAGS at the start",
    )
    options.add_argument(
        "--deployed",
        choices=[t.name for t in DeploymentTrigger],
        default="NONE",
        help="released at the start, by this trigger",
    )
    options.add_argument(
        "--error",
        action="append",
        choices=[e.name for e in ErrorFlags],
        default=[],
        help="error at the start; may be given more than once",
    )
    options.add_argument(
        "--ground-cleared",
        choices=("auto", "yes", "no"),
        default=start.ground_cleared,
        help="auto: by the height of an autopilot on the network, yes without one",
    )
    options.add_argument(
        "--clear-height", type=real("m", 0.0, 10_000.0), default=start.clear_height, help="m"
    )
    options.add_argument(
        "--ats-arm-altitude", type=number("m", 0, 255), default=start.ats_arm_altitude
    )
    options.add_argument(
        "--packed-date", type=_date, default=start.packed_date, help="YYYY-MM-DD; empty: not sent"
    )
    options.add_argument(
        "--system-status",
        type=number("MAV_STATE", 0, 8),
        default=start.system_status,
        help="MAV_STATE in the heartbeat (3 standby, 5 critical)",
    )
    options.add_argument(
        "--break",
        dest="breaks",
        choices=[*BREAKS],
        default="",
        metavar="CLAUSE",
        help="be wrong in this clause of `conformance mavlink` (its --list names them)",
    )
    chosen = options.parse_args()
    settings = ParachuteSettings(
        system_id=chosen.system_id,
        component_id=chosen.component_id,
        armed_triggers=chosen.armed,
        deployment=DeploymentTrigger[chosen.deployed],
        errors=sum(ErrorFlags[name] for name in set(chosen.error)),
        ground_cleared=chosen.ground_cleared,
        ats_arm_altitude=chosen.ats_arm_altitude,
        clear_height=chosen.clear_height,
        packed_date=chosen.packed_date,
        system_status=chosen.system_status,
    )
    run(simulated_parachute(settings, script_of(chosen.at), chosen.breaks), chosen)


def _date(text: str) -> str:
    from chute_ros.links.mavlink.protocol.parachute import packed_date

    date, wrong = packed_date(text)
    if wrong:
        raise argparse.ArgumentTypeError(f"{wrong}: need a day of the calendar")
    return date


def main() -> None:
    """Run the simulator."""
    main_of(_run)


if __name__ == "__main__":
    main()
