"""What a careful team writes in an afternoon: tilt or sink beyond a limit for a while.

Its limits are ours. Tilt: 60 degrees as PX4's FD_FAIL_R, and 80 for an aeroplane, which banks.
Sink: 10 m/s; autopilots descend with at most 1.5 m/s by themselves (ArduCopter WPNAV_SPEED_DN, PX4
MPC_Z_V_AUTO_DN), pilots faster. Half a second, so that a gust or one wrong sample does nothing.
Height and delay as ArduPilot (CHUTE_ALT_MIN, CHUTE_DELAY_MS).
"""

from __future__ import annotations

from chute_ros.campaign.peers.ap_parachute import LOWEST, RELEASE_DELAY
from chute_ros.campaign.peers.api import Belief, Held, PeerDecision, Reasons, above, below
from chute_ros.model import Action

_TILT, _TILT_OF_A_WING, _SINK, _TIME = 60.0, 80.0, 10.0, 0.5


class Threshold:
    """wing: an aeroplane; scale: of the tilt, of the sink, and of their time."""

    release_delay = RELEASE_DELAY

    def __init__(self, wing: bool = False, scale: float = 1.0) -> None:
        self._tilt = (_TILT_OF_A_WING if wing else _TILT) * scale
        self._sink, self._time = _SINK * scale, _TIME * scale
        self._tilts, self._sinks = Held(), Held()

    def step(self, belief: Belief) -> PeerDecision | None:
        """Look at what the autopilot believes now."""
        tilt, speed, now = abs(belief.tilt), belief.vertical_speed, belief.now
        flies = belief.armed and not belief.landed and belief.height >= LOWEST
        tilts = self._tilts.lasts(flies and tilt > self._tilt, now) >= self._time
        sinks = self._sinks.lasts(flies and speed < -self._sink, now) >= self._time
        if not tilts and not sinks:
            return None
        reasons: Reasons = ()
        if tilts:
            reasons = (above("tilt_deg", tilt, self._tilt),)
        if sinks:
            reasons = (*reasons, below("vertical_speed", speed, -self._sink))
        return PeerDecision(Action.DEPLOY, "threshold", reasons)
