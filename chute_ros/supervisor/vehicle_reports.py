"""What is told of the vehicle: each measurement as evidence, and what they say together."""

from __future__ import annotations

import math
from types import MappingProxyType

from chute_ros.model import Armed, VehicleState, pressure_altitude
from chute_ros.supervisor import flight, readings
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.contradictions import (
    commanded,
    commanded_last,
    denials,
    height_denied,
    noted,
)
from chute_ros.supervisor.kinds import kind
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import NO_SAMPLE, Sample
from chute_ros.supervisor.measurements import (
    ACCELERATION,
    CLIMB_RATE,
    DEGREES,
    HEIGHT,
    PRESSURE_ALTITUDE,
    SINK_BEYOND_TARGET,
    TILT,
    VERTICAL_SPEED,
)
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.samples import samples_of
from chute_ros.supervisor.state import CONTRADICTED_FOR
from chute_ros.supervisor.turn import Turn

#: Accelerometers differ by more than motors that shake make them, m/s^2.
_FORCES_DIFFER = 6.0
#: What the newest pressure counts in that of the ground.
_OF_NEWEST = 0.1
#: A barometer that was not heard for longer was silent, s.
_SILENCE = 0.5
#: No force without any speed is that of a fall for so long, s.
_NEVER_FALLS_FOR = 3.0
#: One that flies steadily leans by no more, degrees.
_LEVEL = 45.0
#: An accelerometer at rest feels gravity, m/s^2 (with its bias, and motors that idle); a sensor is
#: found fit or unfit by the samples of so long, s.
_AT_REST, _FITNESS_TAKES = (7.8, 11.8), 1.0
#: An autopilot that has reported anything so much later than its last command commands none, s.
_COMMANDS_ON = 0.5
#: A vehicle that was not heard as it was killed may be so much later, s.
_HEARD_AFTER_KILL = 1.0


def take_vehicle(turn: Turn, one: i.VehicleReport) -> None:
    """What the vehicle is told to be, and each measurement in it as evidence."""
    new = one.state
    _note_home(turn, new)
    state, limits = turn.state, turn.config.profile.limits
    samples = samples_of(new, turn.now, state.flight.home, state.flight.home_altitude)
    before = {
        # What nobody tells just now has not changed its source.
        name: state.measured(name).told_by(one.told_by.get(readings.PARTS.get(name, name), ""))
        if math.isfinite(sample.measured_at)
        else state.measured(name)
        for name, sample in samples.items()
    }
    measurements = {
        name: before[name].with_sample(sample, limits[name]) for name, sample in samples.items()
    }
    was_disarmed = state.heard.vehicle.armed is Armed.DISARMED
    differ = new.acceleration_spread > _FORCES_DIFFER
    turn.heard = replace(
        turn.heard,
        vehicle=new,
        vehicle_received=turn.now,
        disputed=one.disputed | {ACCELERATION} if differ else one.disputed,
        measurements=MappingProxyType({**state.heard.measurements, **measurements}),
    )
    _note_heights_told(turn)
    _note_contradictions(turn)
    _note_height_of_kill(turn)
    _note_reboots(turn, new, new.reboot_count > state.heard.vehicle.reboot_count)
    _note_faults(turn, new.faults)
    # A heartbeat that is wrong in the air moves no ground.
    if was_disarmed and new.armed is Armed.ARMED and not turn.flight.airborne:
        height = readings.measured(turn.config, turn.state, "height", turn.now)
        turn.flight = replace(turn.flight, armed_height=0.0 if math.isnan(height) else height)


def _note_height_of_kill(turn: Turn) -> None:
    """Height and speed, where they were not known as it was killed: it has fallen since, so
    that no more is counted on than is left."""
    state = turn.state
    known = not math.isnan(state.killing.killed_height + state.killing.killed_sinking)
    if known or state.stage is not Stage.KILLING or not state.killing.killed_in_flight:
        return
    height = readings.measured(turn.config, state, HEIGHT, turn.now)
    sinking = -readings.measured(turn.config, state, VERTICAL_SPEED, turn.now)
    heard = not math.isnan(height + sinking)
    if heard and turn.now <= state.killing.killed_at + _HEARD_AFTER_KILL:
        sinking = max(sinking, 0.0)
        turn.killing = replace(turn.killing, killed_height=height, killed_sinking=sinking)


def _note_home(turn: Turn, new: VehicleState) -> None:
    """What heights are above, as long as it has not taken off: an autopilot that moves its
    home in flight, or sets its height to zero, moves nothing here."""
    if turn.flight.airborne and not math.isnan(turn.flight.home_altitude):
        return
    home_altitude = new.altitude - new.height
    if not math.isnan(home_altitude):
        turn.flight = replace(turn.flight, home_altitude=home_altitude)
    if turn.flight.airborne:
        return
    state = replace(turn.state, heard=replace(turn.heard, vehicle=new, vehicle_received=turn.now))
    if flight.says_down(turn.config, state, turn.now) is not True:
        return
    here, before = pressure_altitude(new.pressure), turn.flight.ground_pressure_altitude
    still = flight.armed(turn.config, state, turn.now) is not Armed.ARMED
    if not math.isnan(here) and (still or math.isnan(before)):
        ground = here if math.isnan(before) else before + _OF_NEWEST * (here - before)
        turn.flight = replace(turn.flight, ground_pressure_altitude=ground)


def _note_heights_told(turn: Turn) -> None:
    """Keep the heights of the last second, at most ten of them, all since one was doubted:
    what is left of noise without its jumps may look like a fall."""
    heights = _kept(turn, HEIGHT, turn.heard.heights)
    pressure_heights = _kept(turn, PRESSURE_ALTITUDE, turn.heard.pressure_heights)
    if heights is turn.heard.heights and pressure_heights is turn.heard.pressure_heights:
        return
    before, known = turn.heard.pressure_before, turn.heard.pressure_heights
    if known and pressure_heights[-1][0] - known[-1][0] > _SILENCE:
        before = known[-1]
    turn.heard = replace(
        turn.heard, heights=heights, pressure_heights=pressure_heights, pressure_before=before
    )


def _kept(
    turn: Turn, name: str, before: tuple[tuple[float, float], ...]
) -> tuple[tuple[float, float], ...]:
    height = turn.state.measured(name)
    if math.isnan(height.measured_at):
        return before
    kept = tuple(
        one
        for one in before
        if 0.0 <= height.measured_at - one[0] <= 1.0 and not one[0] < height.doubted_at
    )
    if not kept or height.measured_at - kept[-1][0] >= 0.1:
        kept = (*kept, (height.measured_at, height.value))
    return before if kept == before else kept


def _note_contradictions(turn: Turn) -> None:
    """What is claimed of a fall and is not so; in flight an alarm once it has lasted."""
    state, now = turn.state, turn.now

    def certain(name: str) -> float:
        doubted = name in state.heard.disputed or state.measured(name).doubt(name, now)
        return math.nan if doubted else readings.measured(turn.config, state, name, now)

    cosine = math.cos(certain(TILT) / DEGREES)
    moment = (now, certain(VERTICAL_SPEED), certain(ACCELERATION), cosine)
    known = state.heard.motion
    if state.measured(VERTICAL_SPEED).source != turn.before.measured(VERTICAL_SPEED).source:
        # From one that had fallen silent to another is no change that anybody could have felt.
        known = tuple((at, math.nan, force, leans) for at, _, force, leans in known)
    motion = noted(known, moment)
    if motion is state.heard.motion:
        return
    denied = denials(
        motion,
        readings.pressure_change(turn.config, state, now),
        readings.pressure_drop(turn.config, state, now),
        state.heard.denied,
        state.measured(TILT).has_jumped(now),
    )
    if why := _height_denied(turn):
        denied = {**denied, HEIGHT: why}
    tilt, error, beyond, rate = (
        readings.measured(turn.config, state, name, now)
        for name in (TILT, "attitude_error", SINK_BEYOND_TARGET, CLIMB_RATE)
    )
    # An estimator that is wrong follows its command where the vehicle does not.
    target = state.heard.vehicle.target_vertical_speed
    target = 0.0 if math.isnan(target) else target  # it is lower than it was commanded
    climb_beyond = math.nan if math.isnan(beyond) else target - rate
    since = {name: state.heard.denied_since.get(name, now) for name in denied}
    # Of motors that are off nothing is commanded, whatever an autopilot goes on to tell.
    off = flight.says_off(state, now)
    told = {} if off else commanded(tilt, error, target, beyond, climb_beyond)
    last_command = NO_SAMPLE if off else _last_command(turn)
    if math.isnan(beyond):
        speed = readings.measured(turn.config, state, VERTICAL_SPEED, now)
        told = {**told, **commanded_last(last_command.value, speed, rate)}
    turn.heard = replace(
        turn.heard,
        motion=motion,
        denied=MappingProxyType(dict(denied)),
        denied_since=MappingProxyType(since),
        commanded=MappingProxyType(dict(told)),
        commanded_speed=last_command,
    )
    last = state.heard.motion[-1][0] if state.heard.motion else now
    for name, begun in since.items():
        if state.flight.airborne and last < begun + CONTRADICTED_FOR <= now:
            turn.warn(f"{name} is contradicted: {denied[name]}")
    _note_fitness(turn)


def _last_command(turn: Turn) -> Sample:
    """The vertical speed that was commanded last, by an autopilot that is silent or goes on."""
    vehicle, received = turn.heard.vehicle, turn.heard.vehicle_received
    last = turn.heard.commanded_speed
    if not math.isnan(vehicle.target_vertical_speed):
        last = Sample(vehicle.target_vertical_speed, received - vehicle.target_age)
    reported = received - min(vehicle.armed_age, vehicle.landed_state_age)
    return last if reported <= last.measured_at + _COMMANDS_ON else NO_SAMPLE


def _height_denied(turn: Turn) -> str:
    """In flight, where a barometer that is clogged withholds a deploy as much as an estimator that
    is wrong would release one: a person is told of both."""
    if not turn.flight.airborne:
        return ""
    height = readings.measured(turn.config, turn.state, HEIGHT, turn.now)
    by_pressure = readings.pressure_height(turn.config, turn.state, turn.now)
    return height_denied(flight.above_its_ground(turn.state, height), by_pressure)


def _note_fitness(turn: Turn) -> None:
    """What tells on the ground what cannot be there, or a fall of which no speed follows, is not
    used until it tells on the ground what it must."""
    state, now = turn.state, turn.now
    unfit, since = dict(state.heard.unfit), {}
    begun = state.heard.denied_since.get(ACCELERATION, math.nan)
    if now >= begun + _NEVER_FALLS_FOR:
        unfit.setdefault(ACCELERATION, f"it reports a fall, but {turn.heard.denied[ACCELERATION]}")
    for name, wrong in _judged_at_rest(turn).items():
        if bool(wrong) != (name in unfit):
            since[name] = begun = state.heard.fitness_since.get(name, now)
            if now >= begun + _FITNESS_TAKES:
                unfit.pop(name, None)
                if wrong:
                    unfit[name] = f"it reports {wrong}"
    if unfit != state.heard.unfit or since != state.heard.fitness_since:
        turn.heard = replace(
            turn.heard, unfit=MappingProxyType(unfit), fitness_since=MappingProxyType(since)
        )


def _judged_at_rest(turn: Turn) -> dict[str, str]:
    """Measurement of a vehicle that stands -> what it tells that cannot be, in words; empty:
    nothing."""
    state, config, now = turn.state, turn.config, turn.now
    if state.flight.airborne:
        return _judged_aloft(turn)
    if flight.says_down(config, state, now) is not True:
        return {}
    limit, judged = config.profile.moving_speed, {}
    known = state.measured(ACCELERATION)
    force = known.usable(config.profile.limits[ACCELERATION], now)
    speed, rate = _vertical(turn)
    # A receiver may tell no speed, or one of before, where the heights climb.
    climb = readings.told_rate(config, state, HEIGHT, now)
    moves = any(abs(one) > limit for one in (speed, rate, climb))
    least, most = _AT_REST
    # One that is armed may be pushed before it says that it flies.
    pushed = force > most and flight.armed(config, state, now) is Armed.ARMED
    if not (moves or pushed or math.isnan(force)):
        judged[ACCELERATION] = "" if least <= force <= most else _no_gravity(force)
    for value, names in ((speed, (VERTICAL_SPEED, HEIGHT)), (rate, (PRESSURE_ALTITUDE,))):
        if _cannot_move(turn, force, value):
            wrong = _moves(value, limit) if abs(value) > limit else ""
            judged |= dict.fromkeys(names, wrong)
    return judged


def _judged_aloft(turn: Turn) -> dict[str, str]:
    """What told on the ground what cannot be there, as of one that a balloon or a ship carries, is
    well again once it and another origin tell of a level flight."""
    limit = turn.config.profile.moving_speed
    level = all(abs(one) <= limit for one in _vertical(turn))
    return dict.fromkeys((VERTICAL_SPEED, HEIGHT, PRESSURE_ALTITUDE), "") if level else {}


def _vertical(turn: Turn) -> tuple[float, float]:
    """The vertical speed as it is told and as the barometer tells it, fit or not, m/s; NaN: not
    known."""
    known = turn.state.measured(VERTICAL_SPEED)
    speed = known.usable(turn.config.profile.limits[VERTICAL_SPEED], turn.now)
    return speed, readings.told_rate(turn.config, turn.state, PRESSURE_ALTITUDE, turn.now)


def _cannot_move(turn: Turn, force: float, speed: float) -> bool:
    """One that says that it stands cannot be so fast, m/s, as it stands on the ground by its
    force, m/s^2, or with its motors off. One that is armed may have left the ground."""
    (least, most), now = _AT_REST, turn.now
    if math.isnan(speed) or force < least:
        return False
    off = flight.armed(turn.config, turn.state, now) is Armed.DISARMED
    # One that has just flown may fall, and say that it stands.
    if off and not now < turn.state.flight.landed_at + flight.FLIGHT_JUST_BEFORE:
        return True
    return least <= force <= most and speed <= turn.config.profile.moving_speed


def _no_gravity(force: float) -> str:
    least, most = _AT_REST
    return (
        f"{force:.1f} m/s^2 while the vehicle stands (need {least:g} to {most:g}; a driver that "
        "removes gravity reports 0)"
    )


def _moves(speed: float, limit: float) -> str:
    return f"{speed:+.1f} m/s while the vehicle stands (need at most {limit:g})"


def _note_faults(turn: Turn, faults: tuple[str, ...]) -> None:
    """In flight what forbids a take-off is an alarm, each once as long as it lasts."""
    told = set(map(kind, turn.heard.faults_told))
    new = [one for one in faults if kind(one) not in told]
    if turn.flight.airborne:
        turn.outputs += [i.LogMessage(f"vehicle: {one}", alarm=True) for one in new]
    if faults != turn.heard.faults_told:
        turn.heard = replace(turn.heard, faults_told=faults if turn.flight.airborne else ())


def _note_reboots(turn: Turn, new: VehicleState, just_now: bool) -> None:
    """Restarts on the ground do not count; a node that counts from 0 again has restarted."""
    state = turn.state
    before = min(state.flight.reboots_before, new.reboot_count)
    if not state.flight.airborne and not flight.in_air(turn.config, state, turn.now):
        before = new.reboot_count
    again = new.rebooted_in_flight and new.reboot_count > before
    if again and state.flight.airborne and not state.flight.rebooted:
        turn.warn("the autopilot restarted in flight")
    rebooted = state.flight.rebooted or (again and state.flight.airborne)
    _note_steady(turn, new, rebooted and not just_now)
    if (before, rebooted) != (state.flight.reboots_before, state.flight.rebooted):
        # Heights from before it may be above another ground.
        heights = state.heard.heights if rebooted == state.flight.rebooted else ()
        turn.flight = replace(turn.flight, reboots_before=before, rebooted=rebooted)
        turn.heard = replace(turn.heard, heights=heights)


def _note_steady(turn: Turn, new: VehicleState, rebooted: bool) -> None:
    """After a restart in flight: armed again, neither sinking nor leaning as what falls does."""
    speed = readings.measured(turn.config, turn.state, VERTICAL_SPEED, turn.now)
    tilt = readings.measured(turn.config, turn.state, TILT, turn.now)
    if rebooted and flight.flies_again(turn.state, turn.now):
        return
    level = abs(speed) <= turn.config.profile.moving_speed and tilt <= _LEVEL
    steady = rebooted and level and new.armed is Armed.ARMED
    since = min(turn.flight.steady_since, turn.now) if steady else math.inf
    if since != turn.flight.steady_since:
        turn.flight = replace(turn.flight, steady_since=since)
