"""What a peer is: the decision to kill and deploy that runs in the autopilot itself.

Pure: time is a field of what it is given.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from chute_ros.model import Action

#: A condition that is true, as the rules of this product tell theirs: measurement, value, limit.
Reasons = tuple[str, ...]


@dataclass(frozen=True)
class Belief:
    """What an autopilot takes for true at one of its steps, by its own sensors and its own
    estimator. NaN: unknown. SI units; angles in degrees."""

    #: Monotonic, s.
    now: float
    armed: bool
    #: Since its arming, s.
    armed_for: float
    #: By its land detector.
    landed: bool
    #: Its pilot flies by rates (flips, dives): it holds no attitude and no height.
    acro: bool
    #: Above home, m.
    height: float
    #: Upwards, m/s.
    vertical_speed: float
    tilt: float
    commanded_tilt: float
    #: Above its take-off, m: where it should be, and where its estimator says that it is.
    commanded_altitude: float
    altitude: float
    #: By its barometer alone, m.
    pressure_height: float
    #: Specific force (what an accelerometer measures), m/s^2.
    force: float


@dataclass(frozen=True)
class PeerDecision:
    """A decision. action: KILL (motors off), or DEPLOY (motors off, and a release after it)."""

    action: Action
    rule: str
    reasons: Reasons


class Peer(Protocol):
    """A decision in an autopilot. It starts anew with each start of its autopilot."""

    #: From motors off to the release, s.
    release_delay: float

    def step(self, belief: Belief) -> PeerDecision | None:
        """Look at what the autopilot believes now; called once at each of its steps."""


class Held:
    """How long something has been so without a break."""

    def __init__(self) -> None:
        self._since: float | None = None

    def lasts(self, holds: bool, now: float) -> float:
        """Return for how long it has held, s, to the microsecond; below 0: it does not hold."""
        if not holds:
            self._since = None
            return -1.0
        if self._since is None:
            self._since = now
        return round(now - self._since, 6)


def above(name: str, value: float, limit: float) -> str:
    """Return a reason in words."""
    return f"{name} {value:.2f} (above {limit:g})"


def below(name: str, value: float, limit: float) -> str:
    """Return a reason in words."""
    return f"{name} {value:.2f} (below {limit:g})"
