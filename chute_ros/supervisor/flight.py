"""Is the vehicle in the air, moving, disarmed? What is known, fused; what contradicts is named.

A landed state or a disarmed one that a falling vehicle reports is not believed: the land detector
of an autopilot takes a steady fall for standing still, and must not veto the parachute.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from statistics import fmean, median
from typing import TYPE_CHECKING

from chute_ros.model import Armed, LandedState
from chute_ros.supervisor.contradictions import FREE_FALL, GRAVITY, NO_DROP, NOT_TOLD, Drop, Rise
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measurements import (
    ACCELERATION,
    CLIMB_RATE,
    FALL_SIGNS,
    HEIGHT,
    PRESSURE_ALTITUDE,
    TILT,
    VERTICAL_ACCELERATION,
    VERTICAL_SPEED,
)

if TYPE_CHECKING:  # both hold rules, whose conditions are found here
    from chute_ros.supervisor.config import SupervisorConfig
    from chute_ros.supervisor.state import State

#: One that is armed and says so higher than a deploy needs, on a roof or a hill, for so long, s:
#: the land detectors of autopilots have erred in a hover.
_LANDED_HOLD_ALOFT = 5.0
#: One that was killed in the air must say for so long that it stands, s: its motors are off by the
#: kill, and a steady fall is taken for standing still where nothing tells its speed for a moment.
_DOWN_AFTER_KILL = 10.0
#: For so long after a landing a vehicle may turn out not to have landed, s.
_FLIGHT_JUST_BEFORE = 60.0
#: A climb rate needs heights this far apart at least, s.
_CLIMB_OVER = 0.4
#: A vehicle whose motors were stopped is seen to fall so long after it, s.
_FALLS_AFTER = 1.0
#: A vehicle was heard until a kill if it was at most so long before it, s.
_HEARD_BEFORE = 1.0
#: Height and speed are of the same time if the speed is at most so much newer, s.
_SAME_TIME = 0.2
#: Measurement -> the part of vehicle/state that tells it, where that has another name.
PARTS = {"tilt_deg": "attitude"}
#: A barometer that stands drifts by less than this, m, and tells less than this, m/s.
_OFF_GROUND, _STANDS_BELOW = 2.5, 1.0
#: What a barometer told longer ago says nothing of a fall, s.
_DROP_WITHIN = 12.0
#: An estimator that says that it is up is believed at first where it is not faster, m/s, and not
#: further from upright, degrees: both are flown.
_CALM_SPEED, _CALM_TILT = 8.0, 60.0
#: What ends a flight, after which a person may reset one that has been still for so long, s.
_ENDED, STILL_FOR = (Stage.KILLING, Stage.DEPLOYED, Stage.FAULT), 10.0
_HEIGHT_LOST = "the autopilot started anew in flight, and its height with it"
#: Where no height is known, a vehicle is taken to be high enough so long after its take-off, s.
HIGH_AFTER = 5.0


def reading(config: SupervisorConfig, state: State, name: str, now: float) -> tuple[float, str]:
    """A measurement and "", or NaN and why it cannot be used."""
    if name == CLIMB_RATE:
        rate = pressure_rate(config, state, now)
        return (rate, "") if not math.isnan(rate) else _estimated_rate(config, state, now)
    if name == HEIGHT and state.rebooted:
        return math.nan, _HEIGHT_LOST
    if name == VERTICAL_ACCELERATION:
        return _vertical_acceleration(config, state, now)
    known = state.measured(name)
    why = state.unfit.get(name) or known.unusable(config.profile.limits[name], now)
    if not why:
        return known.value, ""
    if name == VERTICAL_SPEED:
        rate = climb_rate(config, state, now)
        return rate, why if math.isnan(rate) else ""
    return math.nan, why


def measured(config: SupervisorConfig, state: State, name: str, now: float) -> float:
    """A measurement, or NaN where it cannot be used."""
    return reading(config, state, name, now)[0]


def doubt(state: State, name: str, value: float, now: float) -> str:
    """Why a measurement that can be used is a weaker sign than another; empty: it is not. value:
    what was read of it, which may be what the heights tell in its place."""
    if value != state.measured(name).value:
        return ""
    if PARTS.get(name, name) in state.disputed:
        return "another source told otherwise"
    return state.measured(name).doubt(name, now)


def climb_rate(config: SupervisorConfig, state: State, now: float) -> float:
    """Vertical speed from the estimator's heights of the last second, m/s, for sources that tell
    none (a receiver without a fix, a barometer alone). NaN: not known. What they are
    above is the same for all of them, also where the autopilot has started anew."""
    return _rate_of(config, state, HEIGHT, now)[0]


def pressure_rate(config: SupervisorConfig, state: State, now: float) -> float:
    """Vertical speed from the barometer's heights of the last second, m/s; NaN: it tells none, or
    has jumped within that second."""
    if state.measured(PRESSURE_ALTITUDE).doubt(PRESSURE_ALTITUDE, now):
        return math.nan
    return _rate_of(config, state, PRESSURE_ALTITUDE, now)[0]


def pressure_change(config: SupervisorConfig, state: State, now: float) -> Rise:
    """By how much, and from when to when, the barometer's height changed in the last second."""
    if math.isnan(pressure_rate(config, state, now)):
        return NOT_TOLD
    (since, before), (until, after) = state.pressure_heights[0], state.pressure_heights[-1]
    return Rise((after - before) / (until - since), since, until)


def pressure_drop(config: SupervisorConfig, state: State, now: float) -> Drop:
    """By how much the barometer tells less than before it was last silent."""
    known = state.measured(PRESSURE_ALTITUDE)
    passed = known.measured_at - state.pressure_before[0]
    told = known.usable(config.profile.limits[PRESSURE_ALTITUDE], now)
    if known.doubt(PRESSURE_ALTITUDE, now) or not passed <= _DROP_WITHIN:
        return NO_DROP
    return Drop(state.pressure_before[1] - told, passed)


def pressure_height(config: SupervisorConfig, state: State, now: float) -> float:
    """Height above the take-off by the barometer, m; NaN: not known, or in doubt."""
    known = state.measured(PRESSURE_ALTITUDE)
    if known.has_jumped(now):
        return math.nan
    usable = known.usable(config.profile.limits[PRESSURE_ALTITUDE], now)
    return usable - state.ground_pressure_altitude


def rate_count(config: SupervisorConfig, state: State, now: float) -> int:
    """Samples that have come so far of what tells CLIMB_RATE."""
    by_pressure = not math.isnan(pressure_rate(config, state, now))
    return state.measured(PRESSURE_ALTITUDE if by_pressure else HEIGHT).count


def _estimated_rate(config: SupervisorConfig, state: State, now: float) -> tuple[float, str]:
    return (math.nan, _HEIGHT_LOST) if state.rebooted else _rate_of(config, state, HEIGHT, now)


def _vertical_acceleration(
    config: SupervisorConfig, state: State, now: float
) -> tuple[float, str]:
    """Of the last second of vertical speeds, m/s^2, or NaN and why there is none."""
    known = state.measured(VERTICAL_SPEED)
    if why := known.unusable(config.profile.limits[VERTICAL_SPEED], now):
        return math.nan, why
    newest = state.motion[-1][0] if state.motion else math.nan
    told = [(one[0], one[1]) for one in state.motion if newest - one[0] <= 1.0]
    told = [one for one in told if not math.isnan(one[1])]
    if not told or told[-1][0] - told[0][0] < _CLIMB_OVER:
        return math.nan, "too few vertical speeds that can be used"
    return _slope(tuple(told)), ""


def _rate_of(config: SupervisorConfig, state: State, name: str, now: float) -> tuple[float, str]:
    heights = state.heights if name == HEIGHT else state.pressure_heights
    height = state.measured(name)
    if height.unusable(config.profile.limits[name], now) or not _enough(
        heights, height.measured_at
    ):
        return math.nan, "too few heights that can be used"
    return _rate(heights), ""


@lru_cache(maxsize=16)  # each picture of the vehicle asks for it several times
def _rate(heights: tuple[tuple[float, float], ...]) -> float:
    """What heights (monotonic s, m) tell of a climb, m/s."""
    # The middle one of the single rates: one step of a height, however high, is no climb.
    rates = [
        (after[1] - before[1]) / (after[0] - before[0]) for before, after in pairwise(heights)
    ]
    rate = median(rates)
    # The noise of neighbours has a middle one as well; over the whole second it is small, where a
    # step is large. What both of them tell is flown.
    over = _slope(heights)
    return min(rate, over, key=abs) if rate * over > 0.0 else 0.0


def _enough(heights: tuple[tuple[float, float], ...], newest: float) -> bool:
    return bool(heights) and newest - heights[0][0] >= _CLIMB_OVER


def _slope(heights: tuple[tuple[float, float], ...]) -> float:
    """Of the straight line that is nearest to them by least squares, m/s."""
    middle = fmean([at for at, _ in heights])
    weights = [at - middle for at, _ in heights]
    ways = [weight * height for weight, (_, height) in zip(weights, heights, strict=True)]
    return sum(ways) / sum([weight**2 for weight in weights])


def silent_since_kill(config: SupervisorConfig, state: State, now: float) -> bool:
    """The vehicle was heard until the kill, whoever stops its motors is heard, and nothing that
    can be used tells whether it falls. Where nobody is heard, the vehicle may not be silent."""
    if not state.vehicle_received >= state.killed_at - _HEARD_BEFORE:
        return False
    links = [(state.evidence(link), config.limits(link)) for link in config.kill_links]
    heard = any(not evidence.silent(limits.stale_after, now) for evidence, limits in links)
    return heard and all(unusable(config, state, name, now) for name in FALL_SIGNS)


def height_since_kill(config: SupervisorConfig, state: State, now: float) -> float:
    """What a body without drag has left of the height, m, in which our kill was decided in
    flight; NaN: it was not, or height or speed were not known, or it was seen since not to fall.
    One that said that it stood, or that its motors were off, was not stopped by it."""
    if not state.killed_in_flight or state.killed_standing or _seen_not_to_fall(config, state):
        return math.nan
    passed = now - state.killed_at
    return state.killed_height - state.killed_sinking * passed - GRAVITY / 2.0 * passed**2


def _seen_not_to_fall(config: SupervisorConfig, state: State) -> bool:
    """What was told last, at a time at which it had to fall since the kill, was no fall."""
    known = {name: state.measured(name) for name in FALL_SIGNS}
    told = [n for n, one in known.items() if one.measured_at > state.killed_at + _FALLS_AFTER]
    sinks = known["vertical_speed"].value < -config.profile.moving_speed
    falls = {"vertical_speed": sinks, "acceleration": known["acceleration"].value < FREE_FALL}
    return bool(told) and not any(falls[name] for name in told)


def low_at(config: SupervisorConfig, state: State, falls: bool, now: float) -> float:
    """Since when a vehicle in flight is below the low height of its profile, or from when on it
    may be, monotonic s; infinity: it is not, as far as anybody knows. falls: what was told last is
    where a fall without drag began. Of a height that has just jumped the lower one counts."""
    known, limit = state.measured(HEIGHT), config.profile.low_height
    height = min(known.value, known.before_jump) if known.has_jumped(now) else known.value
    # Far below the take-off it says nothing of the ground beneath.
    tells = not state.rebooted and height >= -limit
    if not state.airborne or not tells or limit <= 0.0:
        return math.inf
    ground = above_its_ground(state, height)
    above = height - limit if math.isnan(ground) else max(height, ground) - limit
    if not falls:
        usable = not math.isnan(measured(config, state, HEIGHT, now))
        return known.measured_at if usable and above < 0.0 else math.inf
    # What claims to come from the future came just now.
    told_at = min(known.measured_at, now)
    if above < 0.0:
        return told_at
    speed = state.measured("vertical_speed")
    # A speed of later has what was fallen since in it.
    sank = speed.value < 0.0 and speed.measured_at <= told_at + _SAME_TIME
    sinking = -speed.value if sank else 0.0
    return told_at + (math.sqrt(sinking**2 + 2.0 * GRAVITY * above) - sinking) / GRAVITY


def above_its_ground(state: State, height: float) -> float:
    """A height above the ground of this flight, m, where that lies below home: an autopilot may
    count from a home that is not where it was armed. NaN: that ground is not known."""
    if math.isnan(state.took_off_height):
        return math.nan
    # One that sets its home anew on arming tells another height once it takes off.
    return height - max(state.armed_height, state.took_off_height)


def unusable(config: SupervisorConfig, state: State, name: str, now: float) -> str:
    """Why a measurement cannot be used; empty: it can."""
    return reading(config, state, name, now)[1]


def moving(config: SupervisorConfig, state: State, now: float) -> str:
    """How the vehicle moves as nothing on the ground does, in words; empty: it does not."""
    speed = measured(config, state, VERTICAL_SPEED, now)
    limit = config.profile.moving_speed
    if abs(speed) > limit and not (speed < 0.0 and VERTICAL_SPEED in state.denied):
        return f"vertical_speed {speed:.1f} m/s (nothing on the ground beyond {limit:g})"
    rate = pressure_rate(config, state, now)
    if VERTICAL_SPEED in state.denied and abs(rate) > limit:
        return f"climb_rate {rate:.1f} m/s (nothing on the ground beyond {limit:g})"
    force = measured(config, state, ACCELERATION, now)
    if force < FREE_FALL and ACCELERATION not in state.denied:
        return f"acceleration {force:.1f} m/s^2 (nothing on the ground below {FREE_FALL:g})"
    return ""


def seen_up(
    config: SupervisorConfig, state: State, height: float, by_pressure: float, now: float
) -> bool:
    """Off the ground, as the barometer shows it; without one, as an estimator says that is upright
    and not in a rush: one that runs away on the ground is neither. Heights in m."""
    if not math.isnan(by_pressure):
        return abs(by_pressure) > _OFF_GROUND
    calm = not abs(measured(config, state, VERTICAL_SPEED, now)) > _CALM_SPEED
    upright = not measured(config, state, TILT, now) > _CALM_TILT
    return height - state.armed_height > config.takeoff_height and calm and upright


def at_ground(config: SupervisorConfig, state: State, by_pressure: float, now: float) -> bool:
    """The barometer shows that it stands on the height of its take-off. by_pressure: m."""
    rate = pressure_rate(config, state, now)
    return abs(by_pressure) <= _OFF_GROUND and abs(rate) <= _STANDS_BELOW


def says_air_in_vain(config: SupervisorConfig, state: State, now: float) -> bool:
    """After a kill or a deploy it has not moved for a while: the autopilot of a vehicle that has
    crashed may say for ever that it is in the air."""
    return state.stage in _ENDED and now >= state.still_since + STILL_FOR


def is_still(config: SupervisorConfig, state: State, now: float) -> bool:
    """Its vertical speed is known and is none, by whatever tells one."""
    speeds = [measured(config, state, name, now) for name in (VERTICAL_SPEED, CLIMB_RATE)]
    known = [abs(speed) for speed in speeds if not math.isnan(speed)]
    return bool(known) and max(known) <= _STANDS_BELOW and not moving(config, state, now)


def low_as_at_take_off(config: SupervisorConfig, state: State, now: float) -> bool:
    """Its height is known, and is that of where it was armed."""
    height = measured(config, state, HEIGHT, now) - state.armed_height
    by_pressure = pressure_height(config, state, now)
    limit = config.takeoff_height
    return height <= limit and not by_pressure > limit and not moving(config, state, now)


def fresh(config: SupervisorConfig, state: State, age: float, now: float) -> bool:
    """Is a part of vehicle/state that had this age when it came still young enough? One that
    claims to come from the future came just now."""
    return max(age, 0.0) + (now - state.vehicle_received) <= config.vehicle_state_age


def armed(config: SupervisorConfig, state: State, now: float) -> Armed:
    """What the autopilot says freshly of its motors."""
    if fresh(config, state, state.vehicle.armed_age, now):
        return state.vehicle.armed
    return Armed.UNKNOWN


def says_down(config: SupervisorConfig, state: State, now: float) -> bool | None:
    """Does the autopilot say freshly that the vehicle stands? None: it says nothing of it."""
    landed = state.vehicle.landed_state
    known = fresh(config, state, state.vehicle.landed_state_age, now)
    if known and landed is not LandedState.UNKNOWN:
        return landed is LandedState.ON_GROUND
    if armed(config, state, now) is Armed.DISARMED:
        return True
    return None


def down_undisputed(config: SupervisorConfig, state: State, now: float) -> bool:
    """The autopilot says that the vehicle stands, and nothing contradicts it."""
    return says_down(config, state, now) is True and not moving(config, state, now)


def in_air(config: SupervisorConfig, state: State, now: float) -> bool | None:
    """Is the vehicle in the air? None: nothing that is fresh says so or otherwise."""
    down = says_down(config, state, now)
    if state.airborne:
        if down is None:
            return True if armed(config, state, now) is Armed.ARMED else None
        if not down or moving(config, state, now):
            return True
        return None if now < landed_at(config, state) else False
    if down is not None:
        off = armed(config, state, now) is Armed.DISARMED
        # One that has not flown and whose motors are off does not fly, whatever drifts.
        return (not down and not off) or _falls_against_its_word(config, state, down and off, now)
    height = measured(config, state, "height", now)
    if armed(config, state, now) is Armed.ARMED and not math.isnan(height):
        return height - state.armed_height > config.takeoff_height
    return None


def _falls_against_its_word(
    config: SupervisorConfig, state: State, stands_off: bool, now: float
) -> bool:
    """A vehicle that says that it stands, or that is disarmed, falls all the same: a land detector
    was wrong before the fall, or the supervisor came in the middle of it. stands_off: it says
    both. A barometer that drifts, or a handful of wrong samples, must not look like it: it needs
    the accelerometer and another sign, where it says both all of them, and a flight just before.
    """
    falls = measured(config, state, "acceleration", now) < FREE_FALL
    sinks = measured(config, state, "vertical_speed", now) < -config.profile.moving_speed
    height = measured(config, state, "height", now) - state.armed_height
    high = height > max(config.takeoff_height, config.profile.minimum_height)
    if stands_off:
        return falls and sinks and high and now < state.landed_at + _FLIGHT_JUST_BEFORE
    return falls and (sinks or high)


def _told_high(config: SupervisorConfig, state: State) -> bool:
    """By the last height that was told, it is high enough for a deploy."""
    height = state.measured("height").value - state.armed_height
    return height > config.profile.minimum_height


def landed_at(config: SupervisorConfig, state: State) -> float:
    """When one that says that it stands is believed, monotonic s; NaN: it does not say so."""
    return state.down_since + landed_hold(config, state)


def down_after_kill_at(config: SupervisorConfig, state: State) -> float:
    """When one that was killed in the air and says that it stands has come down for good,
    monotonic s; NaN: it does not say so."""
    return state.down_since + max(landed_hold(config, state), _DOWN_AFTER_KILL)


def landed_hold(config: SupervisorConfig, state: State) -> float:
    """For how long one must say that it stands, s."""
    hold = config.profile.landed_hold
    if hold > 0.0 and state.vehicle.armed is Armed.ARMED and _told_high(config, state):
        return max(hold, _LANDED_HOLD_ALOFT)
    return hold


def disarmed(config: SupervisorConfig, state: State, now: float) -> bool:
    """Are the motors off, as far as that is believed? In the air it is not, from an autopilot
    that started anew there or of a vehicle that falls."""
    if armed(config, state, now) is not Armed.DISARMED:
        return False
    return not (state.airborne and (state.rebooted or moving(config, state, now)))
