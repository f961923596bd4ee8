"""The simulated automatic deployment (APS): does what is felt look like an accident?

Not the vendor's algorithm, which is not public: three plain conditions, each with a time for which
it must hold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chute_ros.sim.motion import Motion


@dataclass(frozen=True)
class ApsLimits:
    """When it fires: sinks faster, weighs less while it sinks, or tilts more, for so long."""

    sink_speed: float = 8.0  # m/s
    free_fall: float = 3.0  # m/s^2
    #: Whoever weighs less but still rises has only stopped to climb, m/s.
    free_fall_sink_speed: float = 1.0
    tilt: float = 1.2  # rad
    hold: float = 0.3  # s
    minimum_height: float = 8.0  # m


class AutomaticDeployment:
    """Fed with motion while it is armed."""

    def __init__(self, limits: ApsLimits) -> None:
        self.limits = limits
        self._since: dict[str, float] = {}

    def reset(self) -> None:
        """Forget what was felt."""
        self._since.clear()

    def accident(self, motion: Motion, now: float) -> str:
        """What has held for long enough, in words; empty: nothing."""
        limits = self.limits
        felt = {
            f"sinks faster than {limits.sink_speed:g} m/s": -motion.vertical_speed
            > limits.sink_speed,
            f"free fall, less than {limits.free_fall:g} m/s^2": motion.acceleration
            < limits.free_fall
            and -motion.vertical_speed > limits.free_fall_sink_speed,
            f"tilted more than {math.degrees(limits.tilt):.0f} degrees": motion.tilt > limits.tilt,
        }
        for what, so in felt.items():
            if not so:
                self._since.pop(what, None)
                continue
            held = now - self._since.setdefault(what, now) >= limits.hold
            if held and motion.height >= limits.minimum_height:
                return what
        return ""
