"""PX4's failure detector with flight termination (CBRK_FLIGHTTERM 0), a parachute on an output.

Source: PX4 src/modules/commander, failure_detector/FailureDetector.cpp and its parameters,
failsafe/failsafe.cpp (checkStateAndMode) and framework.cpp (getSelectedAction). An armed vehicle
is terminated; the land detector is not asked.
"""

from __future__ import annotations

import math

from chute_ros.campaign.peers.api import Belief, Held, PeerDecision, Reasons, above
from chute_ros.model import Action

#: FD_FAIL_R and FD_FAIL_P, degrees, and FD_FAIL_R_TTRI and FD_FAIL_P_TTRI, s: defaults.
_ANGLE, _ANGLE_TIME = 60.0, 0.3
#: FD_ALT_LOSS_T, default, s.
_LOSS_TIME = 1.0
#: COM_LKDOWN_TKO and COM_SPOOLUP_TIME, defaults, s: so early after the arming it only disarms.
_EARLY = 3.0 + 1.0


class Px4:
    """altitude_loss: FD_ALT_LOSS, m; 0, the default: off. It is for rotary wings alone. scale: of
    the angle, of the loss, and of their times."""

    #: With the motors; the next step, so that it is seen which came first.
    release_delay = 0.02

    def __init__(self, altitude_loss: float = 0.0, scale: float = 1.0) -> None:
        self._angle, self._angle_time = _ANGLE * scale, _ANGLE_TIME * scale
        self._loss, self._loss_time = altitude_loss * scale, _LOSS_TIME * scale
        self._tilts, self._sinks = Held(), Held()
        #: The most that it has had since it came below what is commanded, m; NaN: it is not below.
        self._best = math.nan

    def step(self, belief: Belief) -> PeerDecision | None:
        """Look at what the autopilot believes now."""
        reasons = (*self._tilted(belief), *self._lost_altitude(belief))
        if not reasons or not belief.armed:
            return None
        early = belief.armed_for < _EARLY
        return PeerDecision(Action.KILL if early else Action.DEPLOY, "failure detector", reasons)

    def _tilted(self, belief: Belief) -> Reasons:
        tilts = not belief.acro and abs(belief.tilt) > self._angle
        if self._tilts.lasts(tilts, belief.now) < self._angle_time:
            return ()
        return (above("tilt_deg", abs(belief.tilt), self._angle),)

    def _lost_altitude(self, belief: Belief) -> Reasons:
        target, altitude = belief.commanded_altitude, belief.altitude
        if self._loss <= 0.0 or belief.acro or not altitude < target:
            self._best = math.nan
            self._sinks.lasts(False, belief.now)
            return ()
        best = altitude if math.isnan(self._best) else self._best
        self._best = max(altitude, min(best, target))
        lost = self._best - altitude
        if self._sinks.lasts(lost > self._loss, belief.now) < self._loss_time:
            return ()
        return (above("sink_beyond_target: altitude lost", lost, self._loss),)
