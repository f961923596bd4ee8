"""Has it taken off, landed, come down after a kill, been high? Which stage follows from that."""

from __future__ import annotations

import math
from types import MappingProxyType

from chute_ros.supervisor import flight, readings
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import ON_GROUND, Stage, StageEvent, listed
from chute_ros.supervisor.orders import armed_since, note_released
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.samples import on_earth
from chute_ros.supervisor.turn import Turn

#: Off the ground for so long it was seen to be up, on it to be down, s; no look counts for more.
_UP_TAKES, _DOWN_TAKES, _LONGEST_LOOK = 0.5, 1.0, 0.2
_EARLY = "took off before this supervisor was ready, or this supervisor started in flight"


def check_vehicle(turn: Turn) -> None:
    note_down(turn)
    in_air = flight.in_air(turn.config, turn.state, turn.now)
    stage = turn.state.stage
    blocked = stage in (Stage.STARTUP, Stage.BLOCKED)
    if in_air and blocked and flight.low_as_at_take_off(turn.config, turn.state, turn.now):
        return  # it says so because it was ordered to take off, and is kept down
    if in_air and listed(stage, StageEvent.TAKEN_OFF) and _may_take_off(turn):
        if stage is Stage.STARTUP:
            turn.alarm(_EARLY)
        elif stage in (Stage.BLOCKED, Stage.KILLING):
            turn.alarm(f"took off although {stage.name}")
        turn.move(StageEvent.TAKEN_OFF)
        _took_off(turn, anew=stage is not Stage.LANDED, armed=stage is Stage.ARMED)
    elif in_air and _falls_since_kill(turn):
        turn.alarm("it falls since the kill, although it was reported to stand")
        turn.flight = replace(turn.flight, airborne=True, airborne_since=turn.now)
        turn.killing = replace(turn.killing, killed_in_flight=True)
    elif in_air is False and listed(stage, StageEvent.LANDED):
        turn.move(StageEvent.LANDED)
        turn.flight = replace(turn.flight, airborne=False, rebooted=False, landed_at=turn.now)
    if in_air is False and not math.isnan(turn.killing.killed_height):
        # It has come down, whatever is told, or not told any more, from now on.
        turn.killing = replace(turn.killing, killed_height=math.nan)
    if _down_since_kill(turn):
        # As one that was killed on the ground: who lifts it is not to be met by its canopy.
        turn.flight = replace(turn.flight, airborne=False, rebooted=False, landed_at=turn.now)
        turn.killing = replace(turn.killing, killed_in_flight=False)
    if turn.state.stage is Stage.LANDED and flight.disarmed(turn.config, turn.state, turn.now):
        turn.move(StageEvent.SECURED)
        _disarm_parachutes(turn)
    if in_air is False and not turn.flight.flown and turn.state.stage in ON_GROUND:
        note_released(turn)


def _may_take_off(turn: Turn) -> bool:
    """From KILLING only one that was killed on the ground and has armed again."""
    state = turn.state
    if state.stage is not Stage.KILLING:
        return True
    again = state.killing.kill is not None and armed_since(turn, state.killing.kill)
    return not state.killing.killed_in_flight and not state.deploying.deploy_rule and again


def _down_since_kill(turn: Turn) -> bool:
    """It was killed in the air, nothing is to follow, and it has come down for good."""
    killed = turn.state.stage is Stage.KILLING and turn.killing.killed_in_flight
    over = turn.now >= flight.down_after_kill_at(turn.config, turn.state)
    return killed and not turn.deploying.deploy_rule and over


def _falls_since_kill(turn: Turn) -> bool:
    """It was killed as one on the ground, and was in the air all the same."""
    state = turn.state
    on_ground = state.stage is Stage.KILLING and not state.killing.killed_in_flight
    return on_ground and bool(flight.moving(turn.config, state, turn.now))


def note_down(turn: Turn) -> None:
    """Since when it says that it stands, and nothing contradicts it."""
    down = flight.down_undisputed(turn.config, turn.state, turn.now)
    known = not math.isnan(turn.flight.down_since)
    if down != known:
        turn.flight = replace(turn.flight, down_since=turn.now if down else math.nan)
    still = flight.is_still(turn.config, turn.state, turn.now)
    if still == math.isnan(turn.heard.still_since):
        turn.heard = replace(turn.heard, still_since=turn.now if still else math.nan)
    rests = flight.says_rests(turn.config, turn.state, turn.now)
    if rests == math.isnan(turn.heard.rests_since):
        turn.heard = replace(turn.heard, rests_since=turn.now if rests else math.nan)


def _disarm_parachutes(turn: Turn) -> None:
    """After a flight nobody is to carry an armed one; those that arm themselves disarm
    themselves."""
    wanted = turn.config.disarm_after_landing and turn.flight.armed_on_ground
    if wanted and turn.state.mode is i.Mode.ACTIVE:
        turn.outputs.append(i.ArmDevices(0, False, 0, turn.config.deploy_links))
        turn.flight = replace(turn.flight, armed_on_ground=False)


def note_height(turn: Turn) -> None:
    """Since when a deploy is worth it; without any height, some time after the take-off."""
    state, now, minimum = turn.state, turn.now, turn.config.profile.minimum_height
    if not state.flight.airborne:
        return
    height = readings.measured(turn.config, state, "height", now)
    # Which no estimator moves; it says where the ground was, and so that it is there again.
    by_pressure = readings.pressure_height(turn.config, state, now)
    passed = min(max(now - turn.before.own.updated_at, 0.0), _LONGEST_LOOK)
    up = flight.seen_up(turn.config, state, height, by_pressure, now)
    up_for = state.flight.up_for + (passed if up else 0.0)
    told = height if math.isnan(by_pressure) else by_pressure
    # Far below the take-off nobody knows the height above the ground.
    high = told >= minimum or (told <= -minimum and up_for >= _UP_TAKES)
    if math.isnan(told):
        # One that tells what cannot be is no silence: it may run away on the ground.
        wrong = now < state.measured("height").doubted_at + flight.HIGH_AFTER
        high = not wrong and now >= state.flight.airborne_since + flight.HIGH_AFTER
    since = state.heard.at_ground_since
    if not flight.at_ground(turn.config, state, by_pressure, now):
        since = math.nan
    elif math.isnan(since):
        since = now
    down = now >= since + _DOWN_TAKES
    was_high, up_for = (state.flight.was_high or high) and not down, 0.0 if down else up_for
    if (was_high, up_for) != (state.flight.was_high, state.flight.up_for):
        turn.flight = replace(turn.flight, was_high=was_high, up_for=min(up_for, _UP_TAKES))
    if since is not state.heard.at_ground_since:  # not equal: NaN never is
        turn.heard = replace(turn.heard, at_ground_since=since)


def _took_off(turn: Turn, anew: bool, armed: bool) -> None:
    """anew: it stood disarmed before; otherwise it bounced, or was not down at all. armed: its
    parachutes were."""
    vehicle, home = turn.heard.vehicle, None if anew else turn.flight.home
    here = (vehicle.latitude, vehicle.longitude)
    if home is None and on_earth(*here):
        home = here
    measurements = dict(turn.heard.measurements)
    if home != turn.flight.home:
        measurements.pop("distance_from_home", None)  # it was that from another place
    turn.flight = replace(
        turn.flight,
        flown=True,
        airborne=True,
        armed_on_ground=turn.flight.armed_on_ground or armed,
        airborne_since=turn.now,
        was_high=False,
        up_for=0.0,
        took_off_height=readings.measured(turn.config, turn.state, "height", turn.now),
        home=home,
    )
    turn.heard = replace(
        turn.heard, at_ground_since=math.nan, measurements=MappingProxyType(measurements)
    )
    if anew:
        # What was acted on in an earlier flight says nothing about this one.
        turn.state = replace(turn.state, rules=MappingProxyType({}), asks=MappingProxyType({}))
