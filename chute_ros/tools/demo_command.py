"""Flies one simulated flight with the real nodes, and prints each step as it happens.

The nodes and simulators run as processes of their own over real UDP, CAN frames, a pty
and real ROS. Every step has a time limit; a step that does not happen ends the demo with
code 1.
"""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
import tempfile
from pathlib import Path

from chute_ros.errors import ChuteError
from chute_ros.tools.demo_director import Director
from chute_ros.tools.demo_rig import FAULTS, KINDS, DemoRig
from chute_ros.tools.demo_story import fly
from chute_ros.tools.isolation import isolated_ros
from chute_ros.tools.pilot import Pilot
from chute_ros.tools.processes import Processes
from chute_ros.tools.rocket_rig import DemoRocketRig
from chute_ros.tools.rocket_story import RocketStory


def main() -> None:
    """Fly; exit code 0 if every step happened, 2 if the folder for the logs cannot be used."""
    options = argparse.ArgumentParser("demo", description=__doc__)
    options.add_argument(
        "--vehicle",
        choices=("drone", "rocket"),
        default="drone",
        help="a drone with an autopilot, or a rocket on its umbilical (default: drone)",
    )
    options.add_argument(
        "--parachute",
        choices=KINDS,
        default="mavlink",
        help="parachute of the drone (default: mavlink)",
    )
    options.add_argument("--logs", type=Path, help="keep the logs of all processes in this folder")
    options.add_argument(
        "--fault", choices=FAULTS, help="break a step, to show that the demo then fails"
    )
    chosen = options.parse_args()
    if chosen.logs is not None:
        _make(chosen.logs)
    with tempfile.TemporaryDirectory(prefix="chute_ros_demo_") as scratch:
        processes = Processes(chosen.logs or Path(scratch))
        try:
            with isolated_ros() as namespace:
                fault = chosen.fault or ""
                with contextlib.closing(Director(namespace, processes)) as director:
                    if chosen.vehicle == "rocket":
                        rocket = DemoRocketRig(fault, namespace, processes, Path(scratch))
                        RocketStory(rocket, director).fly()
                    else:
                        drone = DemoRig.on_free_ports(
                            chosen.parachute, fault, namespace, processes
                        )
                        with contextlib.closing(Pilot(drone.pilot, system_id=1)) as pilot:
                            fly(drone, director, pilot)
        except ChuteError as error:
            sys.exit(f"\nDEMO FAILED: {error}")
        finally:
            # A second Ctrl-C must leave none of them behind.
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            processes.end()


def _make(folder: Path) -> None:
    """The folder for the logs, which files can be written in."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        why = error.strerror or error
        print(f"demo: --logs {folder}: {why}: name a folder to write in", file=sys.stderr)
        sys.exit(2)
