"""While flight is blocked, arming on the ground is undone: when to disarm, and when not.

Where the height is known, the vehicle is on the ground until it was higher than takeoff_height
above where it was armed: some autopilots say IN_AIR as soon as a take-off is ordered, at height 0.
Else the autopilot's own ON_GROUND is believed while it is fresh. An autopilot refuses a plain
disarm in flight; a forced one, which it does not refuse, follows only where the vehicle was armed
while flight was blocked already, and its height shows that it has not left the ground since. One
that arms in the air (an autopilot that starts anew, the motor of a glider) has left it; one that
was disarmed and did not move has not, whatever it says: what has no motors falls or glides.
"""

from __future__ import annotations

import math

from chute_ros.links.mavlink.protocol.autopilot import AutopilotTracker
from chute_ros.model import Armed, LandedState, Reading

#: Seconds from one disarm to the next, while the autopilot stays armed.
DISARM_INTERVAL = 0.5
#: It was higher once it was so for this long, s; a height older than this is not known, s.
_FOR_A_MOMENT, _FRESH = 0.3, 1.0
#: It says IN_AIR as soon as a take-off is ordered, so long before it is seen to arm at most, s.
_STOOD_WITHIN = 3.0
#: It stood still if it moved no further than this, m, up or down and over ground, for so long, s;
#: but not so far from where it last said that it stands, m.
_STILL, _STILL_OVER_GROUND, _STILL_FOR, _ELSEWHERE = 1.0, 3.0, 2.0, 10.0
#: A degree of latitude, m.
_DEGREE = 111_320.0
#: Home may be set again as it arms, so long after it at most, s.
_HOME_SET_WITHIN = 1.0
#: What a height is taken from: the first that is known as it arms. No home moves the first.
_HEIGHTS = ("altitude", "height")


class FlightBlock:
    """The block, and the disarming under it."""

    def __init__(self, takeoff_height: float) -> None:
        self.reason = ""
        self._rise = _Rise(takeoff_height)
        self._armed_while_blocked = False
        self._disarm_at = -math.inf
        self._told = False

    def set(self, reason: str) -> None:
        """Block for reason, or release (empty)."""
        news = bool(reason) != bool(self.reason)
        self.reason = reason
        if news:
            self._disarm_at, self._told, self._armed_while_blocked = -math.inf, False, False

    def observe(self, autopilot: AutopilotTracker, now: float) -> None:
        """The autopilot may have said something."""
        if self._rise.observe(autopilot, now):
            self._armed_while_blocked = bool(self.reason)

    def stands(self, autopilot: AutopilotTracker, now: float) -> bool:
        """Flight is blocked and the vehicle is, as far as is known, on the ground."""
        if not self.reason:
            return False
        if not self._rise.known(now):
            return autopilot.on_ground(now)
        if not self._rise.is_low:
            return False
        return not self._rise.left_ground or autopilot.on_ground(now)

    def may_force(self, now: float) -> bool:
        """It was armed while flight was blocked, and has not left the ground since."""
        stands = self._rise.known(now) and self._rise.is_low and not self._rise.left_ground
        return bool(self.reason) and self._armed_while_blocked and stands

    def disarm_due(self, autopilot: AutopilotTracker, now: float) -> bool:
        """The autopilot is to be disarmed now; if it stays armed, the next time is set."""
        if autopilot.armed is not Armed.ARMED:
            self._disarm_at, self._told = -math.inf, False
            return False
        if now < self._disarm_at or not self.stands(autopilot, now):
            return False
        self._disarm_at = now + DISARM_INTERVAL
        return True

    def worth_telling(self) -> bool:
        """True the first time since the autopilot was armed."""
        first, self._told = not self._told, True
        return first


class _Rise:
    """How far the vehicle rose since it was seen to arm."""

    def __init__(self, takeoff_height: float) -> None:
        self.left_ground = False
        self.is_low = True
        self._limit = takeoff_height
        self._armings: dict[str, int] = {}
        #: What the height is taken from; empty: it was not known as the vehicle was armed.
        self._source = ""
        self._newest = Reading()
        #: When it was armed, monotonic s; its height then, and the lowest since.
        self._armed_at = -math.inf
        self._first = self._lowest = math.nan
        #: When the autopilot last said that it stands, or stood still, monotonic s.
        self._stood_at = -math.inf
        self._stillness = _Stillness()
        self._higher_since = math.inf

    def observe(self, autopilot: AutopilotTracker, now: float) -> bool:
        """The autopilot may have said something; True: it was just seen to arm."""
        if self._stillness.observe(autopilot, now):
            self._stood_at = now
        before = self._armings.setdefault(autopilot.device, autopilot.arming_count)
        self._armings[autopilot.device] = autopilot.arming_count
        just_armed = autopilot.arming_count > before
        if just_armed:
            self._begin(autopilot, now)
        elif self._source and autopilot.armed is not Armed.ARMED:
            self._source = ""
        elif self._source:
            self._follow(autopilot.reading(self._source), now)
        return just_armed

    def known(self, now: float) -> bool:
        """The height is known, now and as it was armed."""
        return bool(self._source) and self._newest.age(now) <= _FRESH

    def _begin(self, autopilot: AutopilotTracker, now: float) -> None:
        self._source = _source(autopilot, now)
        self._newest = autopilot.reading(self._source)
        self._first = self._lowest = self._newest.value
        self._armed_at = now
        stands = autopilot.landed_state is LandedState.UNKNOWN
        self.left_ground = not stands and now - self._stood_at > _STOOD_WITHIN
        self.is_low, self._higher_since = True, math.inf

    def _follow(self, height: Reading, now: float) -> None:
        self._newest = height
        self._lowest = min(self._lowest, height.value)
        if self._source != _HEIGHTS[0] and now - self._armed_at <= _HOME_SET_WITHIN:
            self._first = min(self._first, height.value)
        # Launched downhill it has left the ground as well.
        moved = max(height.value - self._lowest, self._first - height.value)
        self.is_low = moved <= self._limit
        if self.is_low:
            self._higher_since = math.inf
        else:
            self._higher_since = min(self._higher_since, now)
        self.left_ground = self.left_ground or now - self._higher_since >= _FOR_A_MOMENT


class _Stillness:
    """Whether the vehicle stands: as it says, or as it does not move with its motors off."""

    def __init__(self) -> None:
        #: Its height where it last said so, m, and by which of _HEIGHTS.
        self._stood = ("", math.nan)
        #: Since when it has been here (monotonic s; m, m, m); None: it moves, or is armed.
        self._here: tuple[float, tuple[float, float, float]] | None = None

    def observe(self, autopilot: AutopilotTracker, now: float) -> bool:
        """The autopilot may have said something; True: it stands, as far as is known now."""
        source = _source(autopilot, now)
        height = autopilot.reading(source).value
        if autopilot.on_ground(now):
            self._stood = source, height
            return True
        if autopilot.armed is not Armed.DISARMED or not source:
            self._here = None
            return False
        north, east = (autopilot.reading(one).value for one in ("latitude", "longitude"))
        east *= math.cos(math.radians(north))
        place = (height, north * _DEGREE, east * _DEGREE)
        if self._here is None or _moved(place, self._here[1]):
            self._here = (now, place)
        elsewhere = source == self._stood[0] and abs(height - self._stood[1]) > _ELSEWHERE
        return now - self._here[0] >= _STILL_FOR and not elsewhere


def _source(autopilot: AutopilotTracker, now: float) -> str:
    """The first of _HEIGHTS that is known now; empty: none is."""
    fresh = (name for name in _HEIGHTS if autopilot.reading(name).age(now) <= _FRESH)
    return next(fresh, "")


def _moved(place: tuple[float, float, float], before: tuple[float, float, float]) -> bool:
    """Further than what stands still; what is not known tells nothing."""
    up, north, east = (new - old for new, old in zip(place, before, strict=True))
    return abs(up) > _STILL or math.hypot(north, east) > _STILL_OVER_GROUND
