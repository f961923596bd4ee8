"""Flights in which nothing may be killed or released: hard manoeuvres, every mode, bad sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

from chute_ros.protocol.mavlink.dialect import dialect
from sitl.autopilots import ARDUCOPTER, ARDUPLANE, PX4
from sitl.flight import Flight
from sitl.judge import Want
from sitl.stories import Story
from sitl.truth import GROUND
from sitl.vehicle import Setup

_ARDUPILOT = (ARDUCOPTER, ARDUPLANE)
_Sticks = tuple[float, float, float, float]


@dataclass(frozen=True)
class Step:
    """A mode with the sticks held so (roll, pitch, throttle, yaw) for some seconds."""

    mode: str
    seconds: float
    sticks: _Sticks = (0.0, 0.0, 0.0, 0.0)


#: As hard as sticks go.
_HARD: dict[str, tuple[Step, ...]] = {
    ARDUCOPTER: (
        Step("LOITER", 4.0, (0.0, 1.0, 0.0, 0.0)),
        Step("LOITER", 3.0, (0.0, -1.0, 0.0, 0.0)),
        Step("ALT_HOLD", 3.0, (1.0, 1.0, 0.0, 1.0)),
        Step("ALT_HOLD", 3.0, (-1.0, -1.0, 0.0, -1.0)),
        Step("LOITER", 4.0, (0.0, 0.0, 1.0, 1.0)),
        Step("LOITER", 6.0, (0.0, 0.0, -1.0, -1.0)),
        Step("FLIP", 3.0),
        Step("LOITER", 4.0),
        Step("SPORT", 2.0, (1.0, 0.0, 0.0, 0.0)),
        Step("BRAKE", 4.0),
    ),
    ARDUPLANE: (
        Step("QLOITER", 5.0, (0.0, 1.0, 0.0, 0.0)),
        Step("QLOITER", 4.0, (0.0, -1.0, 0.0, 0.0)),
        Step("QHOVER", 4.0, (1.0, 0.0, 0.0, 1.0)),
        Step("QHOVER", 4.0, (-1.0, 0.0, 0.0, -1.0)),
        Step("QLOITER", 4.0, (0.0, 0.0, 1.0, 1.0)),
        Step("QLOITER", 6.0, (0.0, 0.0, -1.0, 0.0)),
        Step("QLOITER", 3.0),
    ),
    PX4: (
        Step("POSCTL", 4.0, (0.0, 1.0, 0.0, 0.0)),
        Step("POSCTL", 4.0, (0.0, -1.0, 0.0, 0.0)),
        Step("ALTCTL", 3.0, (1.0, 1.0, 0.0, 1.0)),
        Step("ALTCTL", 3.0, (-1.0, -1.0, 0.0, -1.0)),
        Step("POSCTL", 5.0, (0.0, 0.0, 1.0, 1.0)),
        Step("POSCTL", 6.0, (0.0, 0.0, -1.0, 0.0)),
        Step("POSCTL", 3.0),
    ),
}
#: Each mode that it can fly in, one after the other.
_MODES: dict[str, tuple[Step, ...]] = {
    ARDUCOPTER: tuple(
        Step(mode, 4.0)
        for mode in ("STABILIZE", "ALT_HOLD", "LOITER", "POSHOLD", "BRAKE", "CIRCLE", "DRIFT",
                     "SPORT", "GUIDED", "AUTO", "SMART_RTL", "LOITER", "RTL")
    ),
    ARDUPLANE: tuple(
        Step(mode, 4.0) for mode in ("QHOVER", "QLOITER", "QSTABILIZE", "QHOVER", "GUIDED", "AUTO",
                                     "QLOITER", "QRTL")
    ),
    PX4: tuple(
        Step(mode, 4.0) for mode in ("ALTCTL", "POSCTL", "STABILIZED", "ALTCTL", "HOLD", "MISSION",
                                     "HOLD", "RTL")
    ),
}  # fmt: skip
#: Of an aeroplane, once it flies as one.
_WINGS = (
    Step("FBWA", 14.0, (0.0, 0.0, 0.8, 0.0)),
    Step("FBWA", 6.0, (0.6, 0.0, 0.8, 0.0)),
    Step("FBWB", 6.0, (0.0, 0.0, 0.4, 0.0)),
    Step("CRUISE", 6.0, (0.0, 0.0, 0.4, 0.0)),
    Step("LOITER", 10.0),
    Step("FBWA", 5.0, (1.0, 0.0, 0.8, 0.0)),
    Step("FBWA", 3.0, (0.0, 1.0, 0.8, 0.0)),
    Step("CIRCLE", 6.0),
    Step("RTL", 10.0),
    Step("QRTL", 25.0),
)


def _through(flight: Flight, steps: tuple[Step, ...], height: float) -> None:
    flight.go_up(height)
    flight.pilot.sticks(0.0, 0.0, 0.0, 0.0)
    flight.vehicle.rest(2.0)
    for step in steps:
        if step.mode in ("AUTO", "MISSION"):
            flight.upload_mission(height)
            flight.vehicle.rest(2.0)
        flight.pilot.sticks(*step.sticks)
        flight.pilot.mode(step.mode)
        changed = flight.vehicle.until(2.0, partial(flight.pilot.in_mode, step.mode))
        if not changed and step.mode != "FLIP":  # over before a heartbeat tells of it
            flight.verdict.happened.append(f"{step.mode} was refused")
            continue
        flight.vehicle.rest(step.seconds)
        if flight.vehicle.watch.decisions and flight.released():
            return
    flight.pilot.sticks(0.0, 0.0, 0.0, 0.0)
    flight.come_down()
    flight.pilot.let_go()


def _hard(flight: Flight) -> None:
    _through(flight, _HARD[flight.kind], 40.0)


def _modes(flight: Flight) -> None:
    _through(flight, _MODES[flight.kind], 30.0)


def _wings(flight: Flight) -> None:
    _through(flight, _WINGS, 60.0)


#: Parameters that spoil a sensor (those that this version has), and for how long; each is healed
#: before the next.
_SENSORS: tuple[tuple[str, dict[str, float], float], ...] = (
    ("barometer 20 m off", {"SIM_BARO_GLITCH": 20}, 6.0),
    ("barometer drifts 2 m/s", {"SIM_BARO_DRIFT": 2}, 8.0),
    ("no barometer", {"SIM_BARO_DISABLE": 1}, 6.0),
    ("compass 1 fails", {"SIM_MAG1_FAIL": 1}, 6.0),
    ("accelerometer 1 reads 20 m/s2 less", {"SIM_ACC1_BIAS_Z": 20}, 6.0),
    ("accelerometer 1 stands still", {"SIM_ACC_FAIL_MSK": 1}, 6.0),
    ("gyroscope 1 stands still", {"SIM_GYR_FAIL_MSK": 1}, 6.0),
    ("vibration", {"SIM_VIB_MOT_MAX": 40, "SIM_ACC1_RND": 20, "SIM_ACC2_RND": 20}, 8.0),
    ("wind 12 m/s with turbulence", {"SIM_WIND_SPD": 12, "SIM_WIND_TURB": 4}, 10.0),
    # The last: without a place it lands by itself.
    ("no GPS", {"SIM_GPS1_ENABLE": 0, "SIM_GPS_DISABLE": 1}, 8.0),
    ("GPS 40 m off", {"SIM_GPS1_GLTCH_X": 0.00036, "SIM_GPS_GLITCH_X": 0.00036}, 8.0),
)
#: Its units of MAV_CMD_INJECT_FAILURE.
_PX4_SENSORS = (
    ("no GPS", dialect.FAILURE_UNIT_SENSOR_GPS, 8.0),
    ("no barometer", dialect.FAILURE_UNIT_SENSOR_BARO, 6.0),
    ("no compass", dialect.FAILURE_UNIT_SENSOR_MAG, 6.0),
)


def _sensors(flight: Flight) -> None:
    vehicle = flight.vehicle
    flight.go_up(40.0)
    flight.pilot.sticks(0.0, 0.0, 0.0, 0.0)
    if flight.kind == PX4:
        for what, unit, seconds in _PX4_SENSORS:
            _hold(flight)
            vehicle.bench.command(420, unit, dialect.FAILURE_TYPE_OFF)
            _see(flight, what, seconds)
            vehicle.bench.command(420, unit, dialect.FAILURE_TYPE_OK)
            vehicle.rest(5.0)
    else:
        for what, values, seconds in _SENSORS:
            known = {name: vehicle.get(name) for name in values}
            before = {name: value for name, value in known.items() if not math.isnan(value)}
            if not before:
                flight.verdict.happened.append(f"not to be had: {what}")
            _hold(flight)
            for name in before:
                flight.pilot.set(name, values[name])
            _see(flight, what, seconds)
            for name, value in before.items():
                vehicle.set(name, value)
            vehicle.rest(6.0)
    flight.expect(Want.BY_TRUTH, flight.began)


def _hold(flight: Flight) -> None:
    """Where it is; after a fault it may be on its way down by itself."""
    flight.change_mode({ARDUCOPTER: "LOITER", ARDUPLANE: "QLOITER", PX4: "HOLD"}[flight.kind])


def _see(flight: Flight, what: str, seconds: float) -> None:
    """Fly on with it; a release is named after what led to it. On the ground it shows nothing."""
    before = flight.released()
    if not before and flight.vehicle.height() < GROUND:
        flight.verdict.wrong.append(f"error: on the ground before: {what}")
    flight.vehicle.rest(seconds)
    if flight.released() and not before:
        flight.verdict.happened.append(f"released in: {what}")


STORIES = (
    Story("hard", "hard manoeuvres, sticks to their stops", _hard),
    Story("modes", "every flight mode, one after the other", _modes),
    Story("wings", "flies as an aeroplane, banks to its limit, returns", _wings,
          Setup(supervisor={"profile": "fixed_wing"}), (ARDUPLANE,)),
    Story("sensors", "sensors that fail, drift, stand still, one after the other", _sensors,
          spoils=True),
)  # fmt: skip
