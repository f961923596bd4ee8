"""What a simulated UPF controller does by itself: take off, arm, disarm, land, and deploy (APS).

Source: Flyfire UPF UAVCAN protocol V1.0, "parameters"; heights and times are chosen here. The
automatic deployment is not the vendor's algorithm, which is not public: three plain conditions on
what is felt, each with a time for which it must hold.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from chute_ros.links.upf.protocol import parameters as p
from chute_ros.links.upf.protocol.machine import ControllerEvent
from chute_ros.model import ParachuteState
from chute_ros.sim.motion import Motion

_S = ParachuteState
#: On the ground below it, m.
_GROUND = 0.5
#: When the functions act, m and s.
_TAKEOFF_HEIGHT, _ARM_HEIGHT, _DISARM_HEIGHT, _LAND_TIME = 1.0, 10.0, 8.0, 2.0
#: Whoever sinks faster is not landing: it is not disarmed, m/s.
_CALM_SINK_SPEED = 4.0


class AutomaticFunctions:
    """Fed with motion; says what should happen."""

    def __init__(self) -> None:
        self._rest_since = math.nan
        #: It was off the ground since READY, and above the height to disarm since ARMED: what a
        #: request began on the ground or lower does not end by itself before that.
        self._flown = self._was_high = False

    def entered(self, state: ParachuteState) -> None:
        """The controller has a new state, in which rest counts anew."""
        self._rest_since = math.nan
        if state in (_S.NOT_READY, _S.READY):
            self._flown = False
        if state is not _S.ARMED:
            self._was_high = False

    def feel(self, motion: Motion, now: float) -> None:
        """Take note of how it moves."""
        if not motion.at_rest:
            self._rest_since = math.nan
        elif math.isnan(self._rest_since):
            self._rest_since = now
        self._flown |= motion.height >= _GROUND
        self._was_high |= motion.height >= _DISARM_HEIGHT

    def at_rest_for(self, now: float) -> float:
        """How long nothing has moved, s; NaN: it moves."""
        return now - self._rest_since

    def wish(
        self, state: ParachuteState, motion: Motion, switch: Callable[[str], bool], now: float
    ) -> ControllerEvent | None:
        """What an enabled function wants in this state; None: nothing."""
        height = motion.height
        if state is _S.READY and switch(p.AUTO_TAKEOFF):
            if height >= _TAKEOFF_HEIGHT:
                return ControllerEvent.TAKEOFF
        elif state is _S.TAKEOFF:
            if height >= _ARM_HEIGHT and switch(p.AUTO_ARM):
                return ControllerEvent.ARM
            rests = self._flown and self.at_rest_for(now) >= _LAND_TIME
            if rests and height < _GROUND and switch(p.AUTO_LAND):
                return ControllerEvent.LAND
        elif state is _S.ARMED and switch(p.AUTO_DISARM):
            calm = motion.vertical_speed > -_CALM_SINK_SPEED
            if self._was_high and height < _DISARM_HEIGHT and calm:
                return ControllerEvent.DISARM
        return None


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
    """Does what is felt look like an accident? Fed with motion while it is armed."""

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
