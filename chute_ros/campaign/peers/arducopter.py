"""ArduCopter's parachute check and crash check, with CHUTE_ENABLED 1.

Source: ArduPilot ArduCopter/crash_check.cpp, parachute_check() and crash_check(), and
land_detector.cpp for the filtered acceleration. Each of its times is a number of loops there.
"""

from __future__ import annotations

import math

from chute_ros.campaign.peers.ap_parachute import LOWEST, RELEASE_DELAY, SinkCheck
from chute_ros.campaign.peers.api import Belief, Held, PeerDecision, Reasons, above, below
from chute_ros.model import Action

_GRAVITY = 9.80665  # m/s^2
#: PARACHUTE_CHECK_ANGLE_DEVIATION_DEG and PARACHUTE_CHECK_TRIGGER_SEC.
_LOST_ANGLE, _LOST_TIME = 30.0, 1.0
#: CRASH_CHECK_ANGLE_DEVIATION_DEG, CRASH_CHECK_ANGLE_MIN_DEG, CRASH_CHECK_TRIGGER_SEC.
_CRASH_ANGLE, _CRASH_LEAN, _CRASH_TIME = 30.0, 15.0, 2.0
#: CRASH_CHECK_SPEED_MAX, m/s, and CRASH_CHECK_ACCEL_MAX, m/s^2.
_CRASH_SPEED, _CRASH_ACCELERATION = 10.0, 3.0
#: LAND_DETECTOR_ACCEL_LPF_CUTOFF (config.h), Hz.
_CUTOFF = 1.0
#: read_barometer() is called by update_altitude(), at 10 Hz (Copter.cpp); as a loop comes, s.
_BAROMETER_EVERY = 0.1 - 1e-6
#: A loop that comes late is still one loop, s.
_LONGEST_LOOP = 0.05


class ArduCopter:
    """critical_sink: CHUTE_CRT_SINK, m/s; scale: of the angle error and its time, and of the
    critical sink and its time."""

    release_delay = RELEASE_DELAY

    def __init__(self, critical_sink: float = 0.0, scale: float = 1.0) -> None:
        self._sink = SinkCheck(critical_sink, scale)
        self._angle, self._time = _LOST_ANGLE * scale, _LOST_TIME * scale
        #: How long it has been out of control, s; while it is not, that runs back.
        self._lost = 0.0
        #: Its barometer's height as it lost control, and the last one that it read, m.
        self._lost_at = self._pressure_height = 0.0
        self._crashed = Held()
        #: Its acceleration without gravity, filtered, m/s^2.
        self._acceleration = 0.0
        self._before = self._read_at = -math.inf

    def step(self, belief: Belief) -> PeerDecision | None:
        """Look at what the autopilot believes now."""
        passed = min(belief.now - self._before, _LONGEST_LOOP)
        self._before = belief.now
        share = passed / (passed + 1.0 / (2.0 * math.pi * _CUTOFF))
        self._acceleration += share * (belief.force - _GRAVITY - self._acceleration)
        self._read_barometer(belief)
        sinks = self._sink.reasons(belief)
        error = abs(belief.tilt - belief.commanded_tilt)
        if not belief.armed or belief.landed or belief.acro:
            self._lost = 0.0
            self._crashed.lasts(False, belief.now)
            return None
        if self._lost > 0.0 or belief.height >= LOWEST:
            if sinks:
                return PeerDecision(Action.DEPLOY, "critical sink", sinks)
            if lost := self._loses_control(error, passed):
                return PeerDecision(Action.DEPLOY, "loss of control", lost)
        return self._crash(belief, error)

    def _read_barometer(self, belief: Belief) -> None:
        due = belief.now - self._read_at >= _BAROMETER_EVERY
        if due and not math.isnan(belief.pressure_height):
            self._read_at, self._pressure_height = belief.now, belief.pressure_height

    def _loses_control(self, error: float, passed: float) -> Reasons:
        """Why a release is due; empty: it is not."""
        if not error > self._angle:
            self._lost = max(0.0, self._lost - passed)
            return ()
        if self._lost == 0.0:
            self._lost_at = self._pressure_height
            self._lost = passed
            return ()
        self._lost = round(self._lost + passed, 6)
        if self._pressure_height >= self._lost_at:
            self._lost = 0.0  # it does not fall
            return ()
        if self._lost < self._time:
            return ()
        return (
            above("attitude_error", error, self._angle),
            below("pressure", self._pressure_height, self._lost_at),
        )

    def _crash(self, belief: Belief, error: float) -> PeerDecision | None:
        crashed = (
            abs(self._acceleration) < _CRASH_ACCELERATION
            and abs(belief.tilt) > _CRASH_LEAN
            and error > _CRASH_ANGLE
            and abs(belief.vertical_speed) < _CRASH_SPEED
        )
        if self._crashed.lasts(crashed, belief.now) < _CRASH_TIME:
            return None
        reasons = (
            above("attitude_error", error, _CRASH_ANGLE),
            above("tilt_deg", abs(belief.tilt), _CRASH_LEAN),
        )
        return PeerDecision(Action.KILL, "crash", reasons)
