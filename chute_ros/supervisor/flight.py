"""Is the vehicle in the air, moving, disarmed? What is known, fused; what contradicts is named.

A landed state or a disarmed one that a falling vehicle reports is not believed: the land detector
of an autopilot takes a steady fall for standing still, and must not veto the parachute.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from chute_ros.model import Airframe, Armed, LandedState, airframes_of
from chute_ros.supervisor.contradictions import FREE_FALL, GRAVITY
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measurements import (
    ACCELERATION,
    CLIMB_RATE,
    FALL_SIGNS,
    FORCE_ERROR,
    HEIGHT,
    TILT,
    VERTICAL_SPEED,
)
from chute_ros.supervisor.readings import (
    height_lost,
    measured,
    pressure_height,
    pressure_rate,
    unusable,
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
FLIGHT_JUST_BEFORE = 60.0
#: A vehicle whose motors were stopped is seen to fall so long after it, s.
_FALLS_AFTER = 1.0
#: A vehicle was heard until a kill if it was at most so long before it, s.
_HEARD_BEFORE = 1.0
#: Height and speed are of the same time if the speed is at most so much newer, s.
_SAME_TIME = 0.2
#: A barometer that stands drifts by less than this, m, and tells less than this, m/s.
_OFF_GROUND, _STANDS_BELOW = 2.5, 1.0
#: An estimator that says that it is up is believed at first where it is not faster, m/s, and not
#: further from upright, degrees: both are flown.
_CALM_SPEED, _CALM_TILT = 8.0, 60.0
#: What stands sinks no faster by two origins, m/s: lifts and slopes do not.
_SINKS_FOR_SURE = 4.0
#: Gusts, doors and motors move the barometer of what stands by no more, m/s; and what stands feels
#: its weight, but for less than this, m/s^2, on the average of a second.
_FALLS_BY_PRESSURE, _UNREST = 5.0, 2.0
#: What ends a flight, after which a person may reset one that has been still for so long, s.
_ENDED, STILL_FOR = (Stage.KILLING, Stage.DEPLOYED, Stage.FAULT), 10.0
#: Nothing that is not held flies steadily for so long, s.
STEADY_FOR = 10.0
#: No vehicle falls for so long at a steady speed, s.
RESTS_FOR = 60.0
#: Where no height is known, a vehicle is taken to be high enough so long after its take-off, s.
HIGH_AFTER = 5.0
#: What was said of the landed state longer ago is no word against a newer one, s: at 5 Hz another
#: has come.
_SAID_NOW = 0.5


def silent_since_kill(config: SupervisorConfig, state: State, now: float) -> bool:
    """The vehicle was heard until the kill, whoever stops its motors is heard, and nothing that
    can be used tells whether it falls. Where nobody is heard, the vehicle may not be silent."""
    if not state.heard.vehicle_received >= state.killing.killed_at - _HEARD_BEFORE:
        return False
    links = [(state.evidence(link), config.limits(link)) for link in config.kill_links]
    heard = any(not evidence.silent(limits.stale_after, now) for evidence, limits in links)
    return heard and all(unusable(config, state, name, now) for name in FALL_SIGNS)


def height_since_kill(config: SupervisorConfig, state: State, now: float) -> float:
    """What a body without drag has left of the height, m, in which our kill was decided in
    flight; NaN: it was not, or height or speed were not known, or it was seen since not to fall.
    One that said that it stood, or that its motors were off, was not stopped by it."""
    kill = state.killing
    if not kill.killed_in_flight or kill.killed_standing or _seen_not_to_fall(config, state):
        return math.nan
    passed = now - kill.killed_at
    return kill.killed_height - kill.killed_sinking * passed - GRAVITY / 2.0 * passed**2


def _seen_not_to_fall(config: SupervisorConfig, state: State) -> bool:
    """What was told last, at a time at which it had to fall since the kill, was no fall."""
    known = {name: state.measured(name) for name in FALL_SIGNS}
    falls_from = state.killing.killed_at + _FALLS_AFTER
    told = [name for name, one in known.items() if one.measured_at > falls_from]
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
    tells = not height_lost(state) and height >= -limit
    if not state.flight.airborne or not tells or limit <= 0.0:
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
    if math.isnan(state.flight.took_off_height):
        return math.nan
    # One that sets its home anew on arming tells another height once it takes off.
    return height - max(state.flight.armed_height, state.flight.took_off_height)


def moving(config: SupervisorConfig, state: State, now: float) -> str:
    """How the vehicle moves as nothing on the ground does, in words; empty: it does not."""
    speed, rate = measured(config, state, VERTICAL_SPEED, now), pressure_rate(config, state, now)
    limit = config.profile.moving_speed
    # A climb decides nothing but this, and the barometer alone is asked.
    denied = VERTICAL_SPEED in state.heard.denied if speed < 0.0 else abs(rate) <= _STANDS_BELOW
    if abs(speed) > limit and not denied:
        return f"vertical_speed {speed:.1f} m/s (nothing on the ground beyond {limit:g})"
    if VERTICAL_SPEED in state.heard.denied and abs(rate) > limit:
        return f"climb_rate {rate:.1f} m/s (nothing on the ground beyond {limit:g})"
    force = measured(config, state, ACCELERATION, now)
    if force < FREE_FALL and ACCELERATION not in state.heard.denied:
        return f"acceleration {force:.1f} m/s^2 (nothing on the ground below {FREE_FALL:g})"
    # Of an estimator that hovers on nothing is denied: barometer and accelerometer are two more.
    falls = rate < -_FALLS_BY_PRESSURE
    if falls and (unrest := measured(config, state, FORCE_ERROR, now)) > _UNREST:
        beside = f"force_error {unrest:.1f} m/s^2 (nothing that stands above {_UNREST:g})"
        return f"climb_rate {rate:.1f} m/s (nothing below -{_FALLS_BY_PRESSURE:g}) and {beside}"
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
    above = height - state.flight.armed_height
    if not math.isnan(state.flight.landed_at):
        # It has flown since it was armed, and took off again from where it landed.
        above = max(above, height - state.flight.took_off_height)
    return above > config.takeoff_height and calm and upright


def at_ground(config: SupervisorConfig, state: State, by_pressure: float, now: float) -> bool:
    """The barometer shows that it stands on the height of its take-off. by_pressure: m."""
    rate = pressure_rate(config, state, now)
    return abs(by_pressure) <= _OFF_GROUND and abs(rate) <= _STANDS_BELOW


def says_air_in_vain(config: SupervisorConfig, state: State, now: float) -> bool:
    """After a kill or a deploy, or with its motors off, it has not moved for a while: the
    autopilot of a vehicle that has crashed may say for ever that it is in the air. Or it says for
    longer than a fall lasts that it stands with its motors off: its estimator may drift for ever.
    """
    off = armed(config, state, now) is Armed.DISARMED
    still = (off or state.stage in _ENDED) and now >= state.heard.still_since + STILL_FOR
    return still or now >= state.heard.rests_since + RESTS_FOR


def rested_at(config: SupervisorConfig, state: State) -> float:
    """When a multirotor that says so for longer than a fall lasts is down without a person's word,
    monotonic s; NaN: it does not say so. A wing may glide, and what is ended hang on a canopy."""
    kinds = airframes_of(state.heard.vehicle.vehicle_type) or (config.profile.vehicle,)
    if kinds != (Airframe.MULTIROTOR,) or state.stage is not Stage.IN_FLIGHT:
        return math.nan
    return state.heard.rests_since + RESTS_FOR


def flies_again(state: State, now: float) -> bool:
    """It has flown steadily for so long after its autopilot started anew that it does not fall by
    that any more."""
    return now >= state.flight.steady_since + STEADY_FOR


def says_rests(config: SupervisorConfig, state: State, now: float) -> bool:
    """It says that it stands, with its motors off, and feels its weight."""
    off = armed(config, state, now) is Armed.DISARMED
    feels = measured(config, state, ACCELERATION, now) >= FREE_FALL
    return off and feels and says_down(config, state, now) is True


def is_still(config: SupervisorConfig, state: State, now: float) -> bool:
    """Its vertical speed is known and is none, by whatever tells one."""
    speeds = [measured(config, state, name, now) for name in (VERTICAL_SPEED, CLIMB_RATE)]
    known = [abs(speed) for speed in speeds if not math.isnan(speed)]
    return bool(known) and max(known) <= _STANDS_BELOW and not moving(config, state, now)


def low_as_at_take_off(config: SupervisorConfig, state: State, now: float) -> bool:
    """Its height is known, and is that of where it was armed."""
    height = _above_start(config, state, now)
    by_pressure = pressure_height(config, state, now)
    limit = config.takeoff_height
    low = height <= limit or (math.isnan(height) and by_pressure <= limit)
    return low and not by_pressure > limit and not moving(config, state, now)


def fresh(config: SupervisorConfig, state: State, age: float, now: float) -> bool:
    """Is a part of vehicle/state that had this age when it came still young enough? One that
    claims to come from the future came just now."""
    return max(age, 0.0) + (now - state.heard.vehicle_received) <= config.vehicle_state_age


def armed(config: SupervisorConfig, state: State, now: float) -> Armed:
    """What the autopilot says freshly of its motors."""
    if fresh(config, state, state.heard.vehicle.armed_age, now):
        return state.heard.vehicle.armed
    return Armed.UNKNOWN


def says_off(state: State, now: float) -> bool:
    """The autopilot says that its motors are off, and not that it flies. Of a multirotor PX4 and
    ArduCopter say that it stands as soon as they are disarmed in the air (after 0.35 s at most, in
    their own simulators): beside IN_AIR one of their two words is wrong. Those of a wing go on to
    say IN_AIR for a while (ArduPlane)."""
    return state.heard.vehicle.armed is Armed.DISARMED and not now <= flies_until(state)


def flies_until(state: State) -> float:
    """Until when a word of IN_AIR of a multirotor stands against one of DISARMED, monotonic s;
    NaN: none does."""
    vehicle = state.heard.vehicle
    hovers = airframes_of(vehicle.vehicle_type) == (Airframe.MULTIROTOR,)
    if not hovers or vehicle.landed_state is not LandedState.IN_AIR:
        return math.nan
    return state.heard.vehicle_received - vehicle.landed_state_age + _SAID_NOW


def says_down(config: SupervisorConfig, state: State, now: float) -> bool | None:
    """Does the autopilot say freshly that the vehicle stands? None: it says nothing of it."""
    landed = state.heard.vehicle.landed_state
    known = fresh(config, state, state.heard.vehicle.landed_state_age, now)
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
    if state.flight.airborne:
        if down is None:
            return True if armed(config, state, now) is Armed.ARMED else None
        if now >= rested_at(config, state):
            return False
        if not down or moving(config, state, now):
            return True
        return None if now < landed_at(config, state) else False
    if down is not None:
        off = armed(config, state, now) is Armed.DISARMED
        # One that has not flown and whose motors are off does not fly, whatever drifts.
        flies = not down and (not off or _rises_on_what_is_off(config, state, now))
        return flies or _falls_against_its_word(config, state, down and off, now)
    height = _above_start(config, state, now)
    if armed(config, state, now) is Armed.ARMED and not math.isnan(height):
        return height > config.takeoff_height
    return None


def _above_start(config: SupervisorConfig, state: State, now: float) -> float:
    """Its height above where it was armed, m; NaN: not known."""
    return measured(config, state, HEIGHT, now) - state.flight.armed_height


def _rises_on_what_is_off(config: SupervisorConfig, state: State, now: float) -> bool:
    """A rocket whose motor has no valve, or has burnt out, as it was first heard."""
    if config.profile.vehicle is not Airframe.ROCKET:
        return False
    high = _above_start(config, state, now) > config.takeoff_height
    return high and bool(moving(config, state, now))


def _falls_against_its_word(
    config: SupervisorConfig, state: State, stands_off: bool, now: float
) -> bool:
    """A vehicle that says that it stands, or that is disarmed, falls all the same: a land detector
    was wrong before the fall, or the supervisor came in the middle of it. stands_off: it says
    both. A barometer that drifts, or a handful of wrong samples, must not look like it: it needs
    the accelerometer and another sign, where it says both all of them, and a flight just before.
    Or, after a flight just before, an estimator and a barometer that tell the same: what tumbles
    under some thrust is carried.
    """
    falls = measured(config, state, "acceleration", now) < FREE_FALL
    speed = measured(config, state, VERTICAL_SPEED, now)
    sinks = speed < -config.profile.moving_speed
    worth_it = max(config.takeoff_height, config.profile.minimum_height)
    high = _above_start(config, state, now) > worth_it
    # One that is not known is no second sign.
    both = speed, pressure_rate(config, state, now)
    agree = all(one < -_SINKS_FOR_SURE for one in both)
    flew = now < state.flight.landed_at + FLIGHT_JUST_BEFORE
    if flew and agree and VERTICAL_SPEED not in state.heard.denied:
        return True
    return falls and sinks and high and flew if stands_off else falls and (sinks or high)


def _told_high(config: SupervisorConfig, state: State) -> bool:
    """By the last height that was told, it is high enough for a deploy."""
    height = state.measured("height").value - state.flight.armed_height
    return height > config.profile.minimum_height


def landed_at(config: SupervisorConfig, state: State) -> float:
    """When one that says that it stands is believed, monotonic s; NaN: it does not say so."""
    return state.flight.down_since + landed_hold(config, state)


def down_after_kill_at(config: SupervisorConfig, state: State) -> float:
    """When one that was killed in the air and says that it stands has come down for good,
    monotonic s; NaN: it does not say so."""
    return state.flight.down_since + max(landed_hold(config, state), _DOWN_AFTER_KILL)


def landed_hold(config: SupervisorConfig, state: State) -> float:
    """For how long one must say that it stands, s."""
    hold = config.profile.landed_hold
    if hold > 0.0 and state.heard.vehicle.armed is Armed.ARMED and _told_high(config, state):
        return max(hold, _LANDED_HOLD_ALOFT)
    return hold


def disarmed(config: SupervisorConfig, state: State, now: float) -> bool:
    """Are the motors off, as far as that is believed? In the air it is not, from an autopilot
    that started anew there or of a vehicle that falls."""
    if armed(config, state, now) is not Armed.DISARMED:
        return False
    return not (state.flight.airborne and (state.flight.rebooted or moving(config, state, now)))
