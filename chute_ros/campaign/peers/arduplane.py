"""ArduPlane's parachute check, with CHUTE_ENABLED 1: a critical sink alone, at any height.

Source: ArduPilot ArduPlane/parachute.cpp, parachute_check(); CHUTE_ALT_MIN holds there only for a
release that a person orders.
"""

from __future__ import annotations

from chute_ros.campaign.peers.ap_parachute import RELEASE_DELAY, SinkCheck
from chute_ros.campaign.peers.api import Belief, PeerDecision
from chute_ros.model import Action


class ArduPlane:
    """critical_sink: CHUTE_CRT_SINK, m/s; scale: of it and of its time."""

    release_delay = RELEASE_DELAY

    def __init__(self, critical_sink: float = 0.0, scale: float = 1.0) -> None:
        self._sink = SinkCheck(critical_sink, scale)

    def step(self, belief: Belief) -> PeerDecision | None:
        """Look at what the autopilot believes now."""
        # Its is_flying() asks for an armed vehicle as well.
        reasons = self._sink.reasons(belief)
        if not reasons or not belief.armed:
            return None
        return PeerDecision(Action.DEPLOY, "critical sink", reasons)
