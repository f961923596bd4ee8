"""Executable demo: one simulated flight with the real nodes, told as it happens.

The nodes and simulators run as processes of their own and speak over real UDP and real ROS. Every
step is awaited with a time limit; one that does not happen ends the demo with code 1.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from chute_ros.errors import ChuteError
from chute_ros.model import Action, Outcome, TriggerFlags, flag_names
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.chart import chart
from chute_ros.tools.demo_director import Director, StepFailedError
from chute_ros.tools.isolation import free_udp_ports, isolated_ros
from chute_ros.tools.pilot import Pilot
from chute_ros.tools.processes import Processes

FAILURE_HEIGHT = 60.0  # m
#: The operator presses the button when it sinks faster than this, m/s.
OPERATOR_SINK = -4.0
#: What counts as carried by the canopy, and as a soft touchdown, m/s.
CANOPY_SINK = -6.5
#: What --fault adds to the command line of the simulated parachute.
FAULTS = {"parachute-silent": ("--at", "0:silent"), "parachute-mute": ("--at", "0:mute")}


def main() -> None:
    """Fly; exit code 0 if every step happened."""
    options = argparse.ArgumentParser("demo", description=__doc__)
    options.add_argument("--logs", type=Path, help="keep the logs of all processes in this folder")
    options.add_argument(
        "--fault", choices=FAULTS, help="spoil a step, to see that the demo then fails"
    )
    chosen = options.parse_args()
    with tempfile.TemporaryDirectory(prefix="chute_ros_demo_") as scratch:
        folder = chosen.logs or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        processes = Processes(folder)
        try:
            with isolated_ros() as namespace:
                _fly(namespace, processes, FAULTS.get(chosen.fault, ()))
        except KeyboardInterrupt:
            sys.exit("demo: interrupted")
        except ChuteError as error:
            sys.exit(f"\nDEMO FAILED: {error}")
        finally:
            processes.end()


def _fly(namespace: str, processes: Processes, fault: tuple[str, ...]) -> None:
    node_port, vehicle_port = free_udp_ports(2)
    network, vehicle = f"udpout:127.0.0.1:{node_port}", f"127.0.0.1:{vehicle_port}"
    ros = ("--ros-args", "-r", f"__ns:={namespace}")
    director = Director(namespace, processes)
    pilot = Pilot(f"udpout:{vehicle}", system_id=1)
    try:
        director.say("demo", f"real nodes over real UDP, in {namespace}, on this host only")
        processes.start("supervisor", "chute_ros.nodes.safety_supervisor", *ros)
        processes.start(
            "mavlink",
            "chute_ros.nodes.mavlink_parachute",
            *ros,
            "-p",
            f"connection:=udpin:127.0.0.1:{node_port}",
        )
        processes.start(
            "autopilot",
            "chute_ros.sim.sim_autopilot",
            *("--connection", network, "--connection", f"udpin:{vehicle}"),
        )
        parachute = ("--connection", network, "--connection", f"udpout:{vehicle}", *fault)
        _preflight(director, pilot, processes, parachute)
        _climb(director, pilot)
        _fail_and_deploy(director, pilot)
        _summary(director)
    finally:
        pilot.close()
        director.close()


def _preflight(
    director: Director, pilot: Pilot, processes: Processes, parachute: tuple[str, ...]
) -> None:
    director.until("the supervisor speaks", 20.0, lambda: bool(director.safety.links))
    director.until("the autopilot is heard", 20.0, lambda: director.vehicle.armed != 0)
    director.say("vehicle", f"autopilot {director.vehicle.source} heard, disarmed, on the ground")
    director.until("flight is blocked", 20.0, lambda: director.safety.flight_blocked)
    director.say("demo", f"no parachute yet: {'; '.join(director.safety.block_reasons)}")

    director.say("pilot", "tries to arm the motors all the same")
    pilot.arm()
    arm = dialect.MAV_CMD_COMPONENT_ARM_DISARM
    director.until("the autopilot arms", 5.0, lambda: pilot.accepted(arm))
    director.until("it is seen armed", 5.0, lambda: director.vehicle.armed == 2)
    director.until("it is disarmed again", 5.0, lambda: director.vehicle.armed == 1)
    director.say("vehicle", "armed, and disarmed at once: flight is blocked")

    director.say("demo", "plugs the parachute in")
    processes.start("parachute", "chute_ros.sim.sim_mavlink_parachute", *parachute)
    director.until("the parachute is heard", 15.0, lambda: director.parachute.link_state == 1)
    director.say("parachute", f"{director.parachute.device} heard")
    director.until("flight is released", 15.0, director.stage(Stage.READY))
    director.say("supervisor", "READY: every required link is healthy")

    director.say("operator", "arms the parachute")
    answer = director.ask_arm()
    director.until("the parachute is armed", 10.0, answer.done)
    if not answer.result().success:
        raise StepFailedError(f"arming: {answer.result().message}")
    names = ", ".join(flag_names(TriggerFlags(director.parachute.armed_triggers)))
    director.say("parachute", f"armed, its own status says: {names}")


def _climb(director: Director, pilot: Pilot) -> None:
    director.say("pilot", f"arms the motors and takes off to {FAILURE_HEIGHT:g} m")
    pilot.arm()
    director.until("the motors are armed", 5.0, lambda: director.vehicle.armed == 2)
    pilot.take_off(FAILURE_HEIGHT)
    director.until("the supervisor sees the take-off", 10.0, director.stage(Stage.IN_FLIGHT))
    director.say("supervisor", "IN_FLIGHT")
    for height in (20.0, 40.0, FAILURE_HEIGHT - 0.5):

        def reached(height: float = height) -> bool:
            return bool(director.vehicle.height >= height)

        director.until(f"{height:g} m", 20.0, reached)
        state = director.vehicle
        director.say("vehicle", f"{state.height:5.1f} m, {state.vertical_speed:+5.1f} m/s")


def _fail_and_deploy(director: Director, pilot: Pilot) -> None:
    director.failure_now()
    director.say("vehicle", f"MOTOR FAILURE at {director.vehicle.height:.1f} m")
    pilot.fail_motor()
    director.until("it falls", 5.0, lambda: director.vehicle.vertical_speed < OPERATOR_SINK)
    director.say("operator", f"sees {director.vehicle.vertical_speed:.1f} m/s and calls deploy")
    answer = director.ask_deploy("it falls")
    director.until("the deploy is answered", 15.0, answer.done)
    result = answer.result()
    director.say(
        "operator", f"success={result.success} accepted={result.accepted}: {result.message}"
    )
    if not result.success:
        raise StepFailedError(f"deploy: {result.message}")
    for step in (Outcome.ACCEPTED, Outcome.CONFIRMED):

        def reported(step: Outcome = step) -> bool:
            return director.outcome(Action.DEPLOY, step) is not None

        director.until(f"the deploy is reported {step.name}", 5.0, reported)
    fastest = {"sink": 0.0}

    def carried() -> bool:
        fastest["sink"] = min(fastest["sink"], director.vehicle.vertical_speed)
        slow = director.vehicle.vertical_speed > CANOPY_SINK
        return slow and fastest["sink"] < CANOPY_SINK

    director.until("the canopy carries", 15.0, carried)
    state = director.vehicle
    director.say(
        "vehicle", f"CANOPY OPEN: {state.vertical_speed:+.1f} m/s at {state.height:.1f} m"
    )
    last = {"speed": 0.0}

    def landed() -> bool:
        if director.vehicle.height > 0.5:
            last["speed"] = director.vehicle.vertical_speed
        return bool(director.vehicle.landed_state == 1)

    director.until("touchdown", 30.0, landed)
    director.say("vehicle", f"TOUCHDOWN at {last['speed']:+.1f} m/s")
    if last["speed"] < CANOPY_SINK:
        raise StepFailedError(f"touchdown at {last['speed']:.1f} m/s (limit {CANOPY_SINK} m/s)")
    director.until("the supervisor says deployed", 5.0, director.stage(Stage.DEPLOYED))


def _summary(director: Director) -> None:
    """Times since the failure, and the flight as a picture."""
    steps = [
        ("kill decided", _decided(director, Action.KILL)),
        ("kill on the wire", director.when(Action.KILL, Outcome.SENT)),
        ("kill confirmed", director.when(Action.KILL, Outcome.CONFIRMED)),
        ("deploy decided", _decided(director, Action.DEPLOY)),
        ("release on the wire", director.when(Action.DEPLOY, Outcome.SENT)),
        ("release acknowledged", director.when(Action.DEPLOY, Outcome.ACCEPTED)),
        ("parachute's own status: deployed", director.when(Action.DEPLOY, Outcome.CONFIRMED)),
    ]
    times = dict(steps)
    if not times["kill on the wire"] <= times["deploy decided"] <= times["release on the wire"]:
        raise StepFailedError(f"the kill did not go before the deploy: {times}")
    print("\n  since the failure")
    for name, when in steps:
        print(f"    {director.since_failure(when):7.3f} s  {name}")
    marks = [(times["kill decided"], "K"), (times["release on the wire"], "D")]
    failure = time.monotonic() - director.since_failure(time.monotonic())
    print("\n  height over time (F failure, K kill, D deploy)")
    for line in chart(director.track, [(failure, "F"), *marks], width=64, rows=11):
        print("  " + line)
    print("\nDEMO PASSED: every step happened, the kill before the deploy")


def _decided(director: Director, action: Action) -> float:
    return next(when for when, decision in director.decisions if decision.action == action)


if __name__ == "__main__":
    main()
