"""ArduPilot's parachute library, as far as ArduCopter and ArduPlane share it.

Source: ArduPilot libraries/AP_Parachute/AP_Parachute.cpp and .h.
"""

from __future__ import annotations

from chute_ros.campaign.peers.api import Belief, Held, Reasons, below

#: CHUTE_DELAY_MS, default (AP_PARACHUTE_RELEASE_DELAY_MS), s.
RELEASE_DELAY = 0.5
#: CHUTE_ALT_MIN, default (AP_PARACHUTE_ALT_MIN_DEFAULT), m above home.
LOWEST = 10.0
#: check_sink_rate(): longer than this, s.
_SINK_TIME = 1.0


class SinkCheck:
    """critical: CHUTE_CRT_SINK, m/s; 0, the default (AP_PARACHUTE_CRITICAL_SINK_DEFAULT): off.
    scale: of this limit and of its time."""

    def __init__(self, critical: float, scale: float) -> None:
        self._critical, self._time = critical * scale, _SINK_TIME * scale
        self._held = Held()

    def reasons(self, belief: Belief) -> Reasons:
        """Return why a release is due; empty: it is not."""
        sinks = self._critical > 0.0 and -belief.vertical_speed > self._critical
        lasts = self._held.lasts(sinks and not belief.landed, belief.now)
        if lasts <= self._time:
            return ()
        return (below("vertical_speed", belief.vertical_speed, -self._critical),)
