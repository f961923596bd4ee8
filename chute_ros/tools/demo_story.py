"""The story of the simulated flight: block, arm, climb, motor failure, kill, deploy, touchdown."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from chute_ros.model import Action, Outcome, TriggerFlags, flag_names
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.supervisor.machine import Stage
from chute_ros.tools.demo_director import Director, StepFailedError
from chute_ros.tools.demo_rig import DemoRig
from chute_ros.tools.pilot import Pilot

FAILURE_HEIGHT = 60.0  # m
#: What counts as carried by the canopy, and as a soft touchdown, m/s.
CANOPY_SINK = -6.5
#: So often a pilot tries; a take-off is seen after so long, s.
_TAKE_OFFS, _SEEN_WITHIN = 3, 3.0
_ARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM


def fly(rig: DemoRig, director: Director, pilot: Pilot) -> None:
    """All of it; StepFailedError where a step does not happen in its time."""
    director.say("demo", f"real nodes over real wires, in {rig.namespace}, on this host only")
    rig.start_supervisor("supervisor")
    rig.start_vehicle()
    _preflight(director, pilot, rig)
    _climb(director, pilot)
    _fail(director, pilot)
    if rig.automatic:
        _automatic_deployment(director)
    else:
        _supervisor_deploys(director)
    _descend(director)
    _summary(director, rig)


def _preflight(director: Director, pilot: Pilot, rig: DemoRig) -> None:
    director.until("the supervisor speaks", 20.0, lambda: bool(director.safety.links))
    director.until("the autopilot is received", 20.0, lambda: director.vehicle.armed != 0)
    director.say(
        "vehicle", f"autopilot {director.vehicle.source} received, disarmed, on the ground"
    )
    director.until("flight is blocked", 20.0, lambda: director.safety.flight_blocked)
    director.say("demo", f"no parachute yet: {'; '.join(director.safety.block_reasons)}")

    director.say("pilot", "tries to arm the motors")
    pilot.arm()
    director.until("the autopilot arms", 5.0, lambda: pilot.accepted(_ARM))
    director.until("it is seen armed", 5.0, lambda: director.vehicle.armed == 2)
    director.until("it is disarmed again", 5.0, lambda: director.vehicle.armed == 1)
    director.say("vehicle", "armed, and disarmed at once: flight is blocked")

    director.say("demo", "plugs the parachute in")
    rig.start_parachute()

    def all_heard() -> bool:
        heard = director.all_parachutes(lambda one: one.link_state == 1)
        return heard and set(director.parachutes) == set(rig.links)

    director.until("the parachute is received", 15.0, all_heard)
    for link, one in director.parachutes.items():
        director.say("parachute", f"{link} {one.device} received")
    director.until("flight is released", 15.0, director.stage(Stage.READY))
    director.say("supervisor", "READY: every required link is healthy")

    director.say("operator", "arms the parachute")
    # A parachute that has just been plugged in does not know its height at once.
    director.arm(5.0)
    director.until("it is seen armed", 5.0, lambda: director.all_parachutes(lambda p: p.armed))
    for link, one in director.parachutes.items():
        names = ", ".join(flag_names(TriggerFlags(one.armed_triggers)))
        director.say("parachute", f"{link} {one.device} armed, its own status reports: {names}")


def _climb(director: Director, pilot: Pilot) -> None:
    flies = director.stage(Stage.IN_FLIGHT)
    for _ in range(_TAKE_OFFS):
        director.say("pilot", f"arms the motors and takes off to {FAILURE_HEIGHT:g} m")
        pilot.arm()
        director.until("the autopilot arms", 5.0, lambda: pilot.accepted(_ARM))
        pilot.take_off(FAILURE_HEIGHT)
        over = partial(_is_over, director, time.monotonic() + _SEEN_WITHIN)
        director.until("the supervisor sees the take-off", 10.0, over)
        if flies():
            break
        # On a busy machine a word may come late, and flight is blocked for a moment.
        director.say("vehicle", "disarmed again")
    else:
        raise StepFailedError(f"{_TAKE_OFFS} take-offs: none is seen by the supervisor")
    director.say("supervisor", "IN_FLIGHT")
    for height in (20.0, 40.0, FAILURE_HEIGHT - 0.5):
        director.until(f"{height:g} m", 20.0, _reached(director, height))
        state = director.vehicle
        director.say("vehicle", f"{state.height:5.1f} m, {state.vertical_speed:+5.1f} m/s")


def _is_over(director: Director, seen_by: float) -> bool:
    """It flies; or it should by then, monotonic s, and says that it is disarmed."""
    disarmed = bool(director.vehicle.armed == 1)
    return director.stage(Stage.IN_FLIGHT)() or (disarmed and time.monotonic() > seen_by)


def _reached(director: Director, height: float) -> Callable[[], bool]:
    return lambda: bool(director.vehicle.height >= height)


def _fail(director: Director, pilot: Pilot) -> None:
    director.failure_now()
    director.say("vehicle", f"MOTOR FAILURE at {director.vehicle.height:.1f} m")
    pilot.fail_motor()


def _supervisor_deploys(director: Director) -> None:
    """Its rules see the failure; the kill goes before the deploy, each until it is confirmed."""
    for action, steps in (
        (Action.KILL, (Outcome.SENT,)),
        (Action.DEPLOY, (Outcome.ACCEPTED, Outcome.CONFIRMED)),
    ):
        director.until(f"{action.name} is decided", 10.0, director.decided(action))
        _, decision = director.decision(action)
        director.say("supervisor", f"{action.name} by rule '{decision.rule}':")
        for reason in decision.reasons:
            director.say("", f"  {reason}")
        for step in steps:
            what = f"the {action.name} is reported {step.name}"
            director.until(what, 10.0, director.reported(action, step))


def _automatic_deployment(director: Director) -> None:
    """The controller feels the fall, asks for the kill, and launches once it is done."""
    killed = director.reported(Action.KILL, Outcome.CONFIRMED)
    director.until("the parachute requests the kill, and gets it", 5.0, killed)
    director.say("upf_can", "the motors are off: the kill switch is answered with success")
    director.until("the parachute is out", 5.0, lambda: bool(director.deployed_at))
    director.say("parachute", "its own status reports deployed")


def _descend(director: Director) -> None:
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
    director.until("the supervisor reports deployed", 5.0, director.stage(Stage.DEPLOYED))


def _summary(director: Director, rig: DemoRig) -> None:
    """Times since the failure, and the flight as a picture."""
    steps = [
        ("kill decided", director.decision(Action.KILL)[0]),
        ("kill on the wire", director.when(Action.KILL, Outcome.SENT)),
        ("kill confirmed", director.when(Action.KILL, Outcome.CONFIRMED)),
    ]
    release = director.deployed_at
    if not rig.automatic:
        release = director.when(Action.DEPLOY, Outcome.SENT)
        steps += [
            ("deploy decided", director.decision(Action.DEPLOY)[0]),
            ("release on the wire", release),
            ("release acknowledged", director.when(Action.DEPLOY, Outcome.ACCEPTED)),
        ]
    steps.append(("parachute's own status: deployed", director.deployed_at))
    times = dict(steps)
    order = [times["kill on the wire"], times.get("deploy decided", release), release]
    if order != sorted(order):
        raise StepFailedError(f"the kill did not go before the deploy: {times}")
    marks = [(director.failure_at, "F"), (times["kill decided"], "K"), (release, "D")]
    heights = "height over time (F failure, K kill, D deploy)"
    director.summarize(steps, "failure", heights, marks)
