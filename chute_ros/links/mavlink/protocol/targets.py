"""Commands to the vehicle: attitude, vertical speed, height.

Source: MAVLink common.xml: ATTITUDE_TARGET, POSITION_TARGET_LOCAL_NED, POSITION_TARGET_GLOBAL_INT,
NAV_CONTROLLER_OUTPUT; and ArduPilot 4.7.0-dev and PX4 main of 2026-08 for what they fill in:

- PX4 repeats the attitude target with its old time while rates are flown. Its
  POSITION_TARGET_GLOBAL_INT carries a way point that may be of an earlier mission: not read; its
  POSITION_TARGET_LOCAL_NED says the same and more.
- ArduPilot's aeroplanes send the way point in any mode: not read either. Their height error is
  that of the controller in the modes below, and old in others. Their ATTITUDE_TARGET is that of
  the lift motors: none comes on the wing, where NAV_CONTROLLER_OUTPUT tells the attitude.
- ArduCopter's height error is up to 4.6 the target less the height, in 4.7.0-dev the opposite, and
  zero where no height is held: not read. A thrust at its upper end says the most important: it is
  commanded not to sink.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import Any

from chute_ros.links.mavlink.protocol.firmware import Firmware, firmware_of
from chute_ros.links.mavlink.protocol.readings import Readings
from chute_ros.model import Airframe, airframes_of
from chute_ros.protocol.mavlink.dialect import dialect

Vector = tuple[float, float, float]

#: A target that came longer ago is not known: that of the attitude, and the others, s.
ATTITUDE_TARGET_SILENCE, TARGET_SILENCE = 0.5, 1.0
#: What a quaternion's length may differ from 1.
_LENGTH_TOLERANCE = 0.01
#: Height targets of so long, s, of which they must span this, s, tell how fast the target comes
#: down, m/s, from this on: terrain, a glide slope. One step, as to the next way point, does not.
_TARGETS_OVER, _TARGETS_SPAN, _COMES_DOWN = 1.5, 0.8, 1.0
#: The newest attitude target may be so much older than the newest attitude, s: it comes at 10 Hz.
_BEHIND = 0.15
#: A target's own time may be so much behind the autopilot's newest one, ms.
_OLD_MS = 500
#: Thrust (0 to 1) from which on, and tilt (rad) up to which, no motor can be commanded to do more.
_FULL_THRUST, _UPRIGHT = 0.95, math.radians(30.0)

_MULTIROTORS = frozenset(
    {
        dialect.MAV_TYPE_QUADROTOR,
        dialect.MAV_TYPE_COAXIAL,
        dialect.MAV_TYPE_HEXAROTOR,
        dialect.MAV_TYPE_OCTOROTOR,
        dialect.MAV_TYPE_TRICOPTER,
        dialect.MAV_TYPE_DODECAROTOR,
        dialect.MAV_TYPE_DECAROTOR,
        dialect.MAV_TYPE_GENERIC_MULTIROTOR,
    }
)
#: With two motors, with four, of which nobody tells more (today's names of the first two and of
#: VTOL_RESERVED3 are VTOL_TAILSITTER_DUOROTOR, VTOL_TAILSITTER_QUADROTOR, VTOL_TAILSITTER).
_TAIL_SITTERS = frozenset(
    {
        dialect.MAV_TYPE_VTOL_DUOROTOR,
        dialect.MAV_TYPE_VTOL_QUADROTOR,
        dialect.MAV_TYPE_VTOL_RESERVED3,
    }
)
#: ArduPlane's modes in which the attitude of NAV_CONTROLLER_OUTPUT is that of its command: CIRCLE,
#: FBWA, FBWB, CRUISE, AUTOTUNE, AUTO, RTL, LOITER, TAKEOFF, AVOID_ADSB, GUIDED, THERMAL,
#: LOITER_ALT_QLAND. In STABILIZE and TRAINING it is level whatever the sticks do, in ACRO its own.
_ATTITUDE_COMMANDED = frozenset({1, *range(5, 9), *range(10, 16), 24, 25})
#: ArduPlane's modes in which its height error is that of the wing: CIRCLE, FBWB, CRUISE, AUTO,
#: RTL, LOITER, TAKEOFF, AVOID_ADSB, GUIDED; and of the lift motors: QLOITER, QLAND.
_ON_THE_WING = frozenset({1, 6, 7, 10, 11, 12, 13, 14, 15})
_ON_LIFT_MOTORS: float = dialect.MAV_VTOL_STATE_MC
#: The same by MAV_VTOL_STATE; in a transition neither holds the height for certain.
_HEIGHT_HELD: dict[float, frozenset[int]] = {
    dialect.MAV_VTOL_STATE_UNDEFINED: _ON_THE_WING,
    dialect.MAV_VTOL_STATE_FW: _ON_THE_WING,
    _ON_LIFT_MOTORS: frozenset({19, 20}),
}
#: Its lift motors rest, as far as it tells of them.
_WINGBORNE = (dialect.MAV_VTOL_STATE_UNDEFINED, dialect.MAV_VTOL_STATE_FW)
#: EXTENDED_SYS_STATE comes once a second at least, s.
_VTOL_STATE_SILENCE = 2.5

_ATTITUDE_IGNORED = dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
_THRUST_IGNORED = dialect.ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE
_Z_IGNORED = dialect.POSITION_TARGET_TYPEMASK_Z_IGNORE
_VZ_IGNORED = dialect.POSITION_TARGET_TYPEMASK_VZ_IGNORE
_ABOVE_SEA = (dialect.MAV_FRAME_GLOBAL, dialect.MAV_FRAME_GLOBAL_INT)
_ABOVE_HOME = (dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT, dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)

_OF_AN_AEROPLANE = {
    dialect.MAVLINK_MSG_ID_ATTITUDE_TARGET: "ATTITUDE_TARGET",
    dialect.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: "NAV_CONTROLLER_OUTPUT",
}
_OF_PX4 = {
    dialect.MAVLINK_MSG_ID_ATTITUDE_TARGET: "ATTITUDE_TARGET",
    dialect.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: "POSITION_TARGET_LOCAL_NED",
    dialect.MAVLINK_MSG_ID_LOCAL_POSITION_NED: "LOCAL_POSITION_NED",
}
_OF_OTHERS = {
    **_OF_PX4,
    dialect.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT: "POSITION_TARGET_GLOBAL_INT",
}


@dataclass(frozen=True)
class AutopilotVehicle:
    """What an autopilot flies, by its newest HEARTBEAT; kind: AutopilotTracker.vehicle_type."""

    autopilot: int = dialect.MAV_AUTOPILOT_INVALID
    kind: int = dialect.MAV_TYPE_GENERIC
    custom_mode: int = 0

    @property
    def px4(self) -> bool:
        """PX4."""
        return firmware_of(self.autopilot) is Firmware.PX4

    @property
    def arduplane(self) -> bool:
        """ArduPilot on an aeroplane or a VTOL."""
        ardupilot = firmware_of(self.autopilot) is Firmware.ARDUPILOT
        return ardupilot and Airframe.FIXED_WING in airframes_of(self.kind)

    @property
    def target_messages(self) -> dict[int, str]:
        """The messages with targets that are read of it, most useful first."""
        if self.arduplane:
            return _OF_AN_AEROPLANE
        return _OF_PX4 if self.px4 else _OF_OTHERS


class Targets:
    """Follows the targets, and sets the vehicle's attitude against its own."""

    def __init__(self, readings: Readings) -> None:
        self.vehicle = AutopilotVehicle()
        self._readings = readings
        self._axis: Vector | None = None
        self._axis_at = -math.inf
        #: The vehicle's own, lately, with the time, oldest first.
        self._own: deque[tuple[float, Vector]] = deque()
        #: Height target -> what it was lately, m above what it counts from, with the time, oldest
        #: first.
        self._heights: dict[str, deque[tuple[float, float]]] = {}

    def attitude_target(self, message: Any, newest_ms: int | None, now: float) -> None:
        """ATTITUDE_TARGET; newest_ms: the autopilot's newest time_boot_ms, None: not known."""
        old = newest_ms is not None and 0 < message.time_boot_ms < newest_ms - _OLD_MS
        axis = None if old or message.type_mask & _ATTITUDE_IGNORED else _quaternion(message.q)
        if axis is None:
            return
        self._axis, self._axis_at = axis, now
        full = message.thrust >= _FULL_THRUST and not message.type_mask & _THRUST_IGNORED
        upward = self.vehicle.kind in _MULTIROTORS or self._vtol_state(now) == _ON_LIFT_MOTORS
        lifts = full and upward and axis[2] >= math.cos(_UPRIGHT)
        self._take("full_thrust", message.thrust, not lifts, now)

    def lies_on_its_wing(self, now: float) -> bool:
        """A tail-sitter of PX4 does, or is on the way: it goes on to tell the attitude of its
        hover, which is 90 degrees from upright then (its FailureDetector turns it)."""
        tail_sitter = self.vehicle.px4 and self.vehicle.kind in _TAIL_SITTERS
        return tail_sitter and self._vtol_state(now) != _ON_LIFT_MOTORS

    def attitude(self, axis: Vector, now: float) -> None:
        """The vehicle's vertical axis is this one now (see vertical_axis)."""
        while self._own and now - self._own[0][0] > _BEHIND:
            self._own.popleft()
        self._own.append((now, axis))
        if self._axis is not None and now - self._axis_at <= ATTITUDE_TARGET_SILENCE:
            # A flip turns by 60 degrees from one target to the next: the nearest of what it was
            # since then counts.
            cosine = max(
                sum(ours * theirs for ours, theirs in zip(own, self._axis, strict=True))
                for _, own in self._own
            )
            self._readings.set("attitude_error", math.acos(max(-1.0, min(1.0, cosine))), now)

    def position_target_local_ned(self, message: Any, now: float) -> None:
        """POSITION_TARGET_LOCAL_NED: z down from the origin of LOCAL_POSITION_NED."""
        if message.coordinate_frame != dialect.MAV_FRAME_LOCAL_NED:
            return
        mask = message.type_mask
        self._take("target_speed_local", -message.vz, mask & _VZ_IGNORED, now)
        self._take_height("target_above_origin", -message.z, mask & _Z_IGNORED, now)

    def position_target_global_int(self, message: Any, now: float) -> None:
        """POSITION_TARGET_GLOBAL_INT: height by its frame."""
        if self.vehicle.px4 or self.vehicle.arduplane:
            return
        mask, frame = message.type_mask, message.coordinate_frame
        ignored = mask & _Z_IGNORED
        self._take("target_speed_global", -message.vz, mask & _VZ_IGNORED, now)
        self._take_height("target_altitude", message.alt, ignored or frame not in _ABOVE_SEA, now)
        self._take_height("target_height", message.alt, ignored or frame not in _ABOVE_HOME, now)

    def nav_controller_output(self, message: Any, now: float) -> None:
        """NAV_CONTROLLER_OUTPUT: alt_error is the target less the height, m; on the wing nav_roll
        and nav_pitch (degrees) are the commanded attitude, of which ATTITUDE_TARGET tells nothing
        there."""
        if not self.vehicle.arduplane:
            return
        yaw = self._readings.fresh("yaw", ATTITUDE_TARGET_SILENCE, now)
        angles = (math.radians(message.nav_roll), math.radians(message.nav_pitch), yaw)
        state, mode = self._vtol_state(now), self.vehicle.custom_mode
        commanded = state in _WINGBORNE and mode in _ATTITUDE_COMMANDED
        if commanded and all(map(math.isfinite, angles)):
            self._axis, self._axis_at = vertical_axis(*angles), now
        modes = _HEIGHT_HELD.get(state, frozenset())
        climbed = self._readings.value("vertical_speed") * self._readings.age("altitude", now)
        here = self._fresh("altitude", now) + climbed
        self._take_height("height_error", message.alt_error, mode not in modes, now, here)

    def at(self, now: float) -> tuple[float, float, float]:
        """Commanded vertical speed (m/s, up positive), and how far below its target the vehicle is
        (m), NaN: not known; and the age of the newest target (s), NaN: none ever came."""
        speed = self._fresh("target_speed_local", now)
        if math.isnan(speed):
            speed = self._fresh("target_speed_global", now)
        if math.isnan(speed) and not math.isnan(self._fresh("full_thrust", now)):
            speed = 0.0
        target, below = self._below(now)
        if math.isnan(speed) and below > 0.0:
            speed = self._comes_down(target)
        return speed, below, self._readings.age("target", now)

    def _take_height(
        self, part: str, value: float, ignored: object, now: float, here: float = 0.0
    ) -> None:
        """A height target; here: what it counts from, m."""
        self._take(part, value, ignored, now)
        if ignored or not math.isfinite(here + value):
            self._heights.pop(part, None)
            return
        lately = self._heights.setdefault(part, deque())
        lately.append((now, here + value))
        while now - lately[0][0] > _TARGETS_OVER:
            lately.popleft()

    def _comes_down(self, target: str) -> float:
        """The vertical speed of a height target that comes down, m/s; NaN: it does not, as far as
        anybody knows."""
        told = self._heights.get(target)
        if not told or told[-1][0] - told[0][0] < _TARGETS_SPAN:
            return math.nan
        rates = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in pairwise(told) if b[0] > a[0]]
        rate = median(rates)
        return rate if rate <= -_COMES_DOWN else math.nan

    def _take(self, part: str, value: float, ignored: object, now: float) -> None:
        """A target; one that is not commanded any more is not known at once."""
        if ignored or not math.isfinite(value):
            self._readings.forget(part)
            return
        self._readings.set(part, value, now)
        self._readings.set("target", value, now)

    def _vtol_state(self, now: float) -> float:
        """MAV_VTOL_STATE; NaN: not known."""
        return self._readings.fresh("vtol_state", _VTOL_STATE_SILENCE, now)

    def _below(self, now: float) -> tuple[str, float]:
        """The best height target, and how far below it the vehicle is, m."""
        for target, actual in _SET_AGAINST.items():
            below = self._fresh(target, now) - self._fresh(actual, now)
            if not math.isnan(below):
                return target, below
        return "height_error", self._fresh("height_error", now)

    def _fresh(self, part: str, now: float) -> float:
        return self._readings.fresh(part, TARGET_SILENCE, now)


#: Target -> with what it is compared, best first.
_SET_AGAINST = {
    "target_above_origin": "above_origin",
    "target_altitude": "altitude",
    "target_height": "height",
}


def vertical_axis(roll: float, pitch: float, yaw: float) -> Vector:
    """The body's downward axis in north, east, down; angles in rad."""
    down = math.cos(roll) * math.cos(pitch)
    forward, right = math.cos(roll) * math.sin(pitch), math.sin(roll)
    north = forward * math.cos(yaw) + right * math.sin(yaw)
    east = forward * math.sin(yaw) - right * math.cos(yaw)
    return north, east, down


def _quaternion(q: Any) -> Vector | None:
    """The same of a quaternion (w, x, y, z); None: it is not one of an attitude."""
    w, x, y, z = q
    # NaN is not within the tolerance either.
    if not abs(math.hypot(w, x, y, z) - 1.0) <= _LENGTH_TOLERANCE:
        return None
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
