"""A vehicle that must not take off: every way to arm it, and whether it gets away."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import partial

from chute_ros.supervisor.machine import Stage
from sitl.autopilots import ARDUCOPTER, ARDUPLANE, PX4
from sitl.flight import Flight
from sitl.judge import Want
from sitl.record import Seen
from sitl.stories import Story
from sitl.vehicle import Setup

#: Of a blocked vehicle: so high it may hop before it is disarmed, m.
HOP = 1.0
_WATCHED = 6.0  # s, each way
_LOST_AFTER = 3.0  # s, as delivered, and a little more
_BLOCKED = Setup(parachute=("--error", "LOW_POWER"))
#: Ways that motors come to turn, by autopilot.
_WAYS: dict[str, tuple[str, ...]] = {
    ARDUCOPTER: ("command", "force", "command and take-off", "force and take-off", "mission",
                 "sticks"),
    ARDUPLANE: ("command", "force", "command and take-off", "force and take-off", "mission",
                "QLOITER and sticks"),
    PX4: ("command", "force", "take-off mode", "take-off command", "mission", "sticks"),
}  # fmt: skip


def _block(flight: Flight) -> None:
    vehicle = flight.vehicle
    flight.expect(Want.NO_RELEASE)
    vehicle.must("BLOCKED", 60.0, lambda: vehicle.stage(Stage.BLOCKED))
    flight.wait_for_position()
    for way in _WAYS[flight.kind]:
        began = time.monotonic()
        _TRY[way](flight)
        vehicle.until(_WATCHED, lambda: vehicle.height() > 3.0)
        _stand_still(flight)
        highest = vehicle.truth.highest(began)
        flight.afterwards.append(partial(_judge, flight, way, began, time.monotonic(), highest))
        if highest > HOP:
            return
        vehicle.rest(1.0)


def _judge(flight: Flight, way: str, began: float, ended: float, highest: float,
           record: Sequence[Seen]) -> None:  # fmt: skip
    ports = flight.vehicle.truth_ports()
    while_tried = [one for one in record if began <= one.at <= ended]
    some = [one for one in while_tried if one.port not in ports and one.component == 1]
    took, armed = _undone(some)
    verdict = flight.verdict
    told = f"up to {highest:.1f} m" if armed else "refused by the autopilot"
    verdict.happened.append(f"{way}: {told}")
    if highest > HOP:
        verdict.wrong.append(f"missed: {way}: blocked, and {highest:.1f} m up")
    elif armed and math.isnan(took):
        verdict.wrong.append(f"missed: {way}: blocked, and stayed armed")
    elif armed:
        verdict.times[f"{way}: armed to disarmed"] = took


def _undone(record: Sequence[Seen]) -> tuple[float, bool]:
    """From the first sign of armed motors to the last of disarmed ones, s; whether any came."""
    first = last = math.nan
    for seen in record:
        armed = seen.name == "HEARTBEAT" and seen.message.base_mode & 128
        ack = (
            seen.name == "COMMAND_ACK" and seen.message.command == 400 and not seen.message.result
        )
        if armed or (ack and math.isnan(first)):
            first = seen.at if math.isnan(first) else first
            last = math.nan if armed else last
        elif ack or (seen.name == "HEARTBEAT" and not armed and math.isnan(last)):
            last = seen.at if not math.isnan(first) else math.nan
    return last - first, not math.isnan(first)


def _stand_still(flight: Flight) -> None:
    flight.pilot.let_go()
    flight.vehicle.until(3.0, lambda: not flight.station.armed())


def _command(force: bool, take_off: bool) -> Callable[[Flight], None]:
    def do(flight: Flight) -> None:
        if flight.kind != PX4:
            flight.change_mode("GUIDED")
        flight.pilot.arm(force)
        if take_off:
            for _ in range(10):
                flight.vehicle.rest(0.1)
                flight.pilot.take_off(15.0)

    return do


def _mission(flight: Flight) -> None:
    flight.upload_mission(15.0)
    flight.pilot.mode("MISSION" if flight.kind == PX4 else "AUTO")
    flight.vehicle.rest(0.5)
    flight.pilot.arm()
    flight.vehicle.rest(0.1)
    flight.pilot.start_mission()


def _sticks(flight: Flight) -> None:
    mode = {ARDUPLANE: "QLOITER", ARDUCOPTER: "LOITER", PX4: "POSCTL"}[flight.kind]
    flight.pilot.sticks(0.0, 0.0, -1.0, 0.0)
    flight.change_mode(mode)
    flight.pilot.arm()
    flight.vehicle.rest(0.1)
    flight.pilot.sticks(0.0, 0.0, 1.0, 0.0)


def _take_off_mode(flight: Flight) -> None:
    flight.pilot.mode("TAKEOFF")
    flight.vehicle.rest(0.3)
    flight.pilot.arm()


def _take_off_command(flight: Flight) -> None:
    flight.pilot.take_off(15.0)
    flight.vehicle.rest(0.1)
    flight.pilot.arm()


_TRY: dict[str, Callable[[Flight], None]] = {
    "command": _command(False, False),
    "force": _command(True, False),
    "command and take-off": _command(False, True),
    "force and take-off": _command(True, True),
    "mission": _mission,
    "sticks": _sticks,
    "QLOITER and sticks": _sticks,
    "take-off mode": _take_off_mode,
    "take-off command": _take_off_command,
}


def _restarts_on_the_ground(flight: Flight) -> None:
    vehicle = flight.vehicle
    flight.get_ready()
    vehicle.rest(2.0)
    began = time.monotonic()
    vehicle.simulator.restart()
    heard = flight.station.heard_at["HEARTBEAT"]
    vehicle.must("the autopilot is heard again", 30.0,
                 lambda: flight.station.heard_at["HEARTBEAT"] > heard)  # fmt: skip
    back = time.monotonic() - began
    flight.verdict.times["restart to its heartbeat"] = back
    # One that is back before it counts as lost was never gone.
    if vehicle.until(8.0, lambda: vehicle.stage(Stage.BLOCKED, Stage.STARTUP)):
        flight.verdict.happened.append("BLOCKED meanwhile")
    elif back > _LOST_AFTER:
        flight.verdict.wrong.append(f"missed: READY while it was silent for {back:.1f} s")
    vehicle.must("READY again", 60.0, lambda: vehicle.stage(Stage.READY, Stage.ARMED))
    flight.verdict.times["restart to READY"] = time.monotonic() - began


STORIES = (
    Story("block", "a blocked vehicle: every way of arming", _block, _BLOCKED, spoils=True),
    Story(
        "block-no-spool-up",
        "the same, with COM_SPOOLUP_TIME 0 and MPC_TKO_RAMP_T 0",
        _block,
        Setup(parachute=("--error", "LOW_POWER"),
              settings={"COM_SPOOLUP_TIME": 0, "MPC_TKO_RAMP_T": 0}),
        (PX4,),
        spoils=True,
    ),
    Story("restart-ground", "the autopilot restarts on the ground", _restarts_on_the_ground,
          spoils=True, restarts=True),
)  # fmt: skip
