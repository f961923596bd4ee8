"""Why flight is blocked or arming refused: every reason with its value and its limit, in words."""

from __future__ import annotations

import datetime
import math

from chute_ros.model import (
    Action,
    Airframe,
    LinkState,
    ParachuteState,
    ParachuteStatus,
    SafetyFlags,
    TriggerFlags,
    airframes_of,
    flag_names,
)
from chute_ros.supervisor import flight, readings
from chute_ros.supervisor.config import TRIGGER, PreflightLimits, Rung, SupervisorConfig
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.kinds import kind
from chute_ros.supervisor.link_evidence import LinkEvidence, LinkJudgement
from chute_ros.supervisor.machine import ON_GROUND, Stage
from chute_ros.supervisor.measurements import (
    ACCELERATION,
    PRESSURE_ALTITUDE,
    TILT,
    VERTICAL_SPEED,
)
from chute_ros.supervisor.state import CONTRADICTED_FOR, State

#: MAV_STATE of an autopilot that cannot fly, or only ends a flight (MAVLink common.xml).
_UNABLE = {
    5: "the autopilot reports MAV_STATE_CRITICAL (need STANDBY or ACTIVE): read its own messages",
    6: "the autopilot reports MAV_STATE_EMERGENCY (need STANDBY or ACTIVE): read its own messages",
    8: "the autopilot reports MAV_STATE_FLIGHT_TERMINATION (need STANDBY or ACTIVE): reboot it",
}
TWO_NODES = "two nodes of this name are received: end one, or give it another (-r __node:=NAME)"
RELEASED = "was released: repack or replace it, then call safety/reset"
_EPOCH = datetime.date(1970, 1, 1).toordinal()
#: A wall clock that says less was never set.
_FIRST_DAY = datetime.date(2024, 1, 1).toordinal() - _EPOCH


def link_problem(config: SupervisorConfig, link: str, evidence: LinkEvidence, now: float) -> str:
    """What is wrong with one link; empty: nothing. Missing, stale, lost, regained and unhealthy
    differ."""
    limits = config.limits(link)
    judged = evidence.judged(limits, now)
    if evidence.is_two(now):
        # Whatever the two say of their devices.
        return f"{link}: {TWO_NODES}"
    if judged is LinkJudgement.NEVER_SEEN:
        who = "node" if math.isnan(evidence.heard) else "device"
        return f"{link}: nothing received from its {who}"
    if judged is LinkJudgement.REGAINED:
        heard = now - evidence.regained_at
        return (
            f"{link}: REGAINED, received again for {heard:.2f} s (need {limits.regain_after:g} s)"
        )
    if judged is LinkJudgement.UNMONITORED:
        allowed = link in config.unmonitored_links
        text = "UNMONITORED, its device never reports anything (to fly with it: unmonitored_links)"
        return "" if allowed else f"{link}: {text}"
    if judged is not LinkJudgement.OK:
        silence = now - evidence.heard
        if evidence.silent(limits.stale_after, now):
            text = f"heartbeat of its node {silence:.2f} s old (limit {limits.stale_after:g} s)"
            return f"{link}: {judged.name}, {text}"
        return f"{link}: its device is {judged.name}" + _faults(evidence)
    if not evidence.device_healthy:
        return f"{link}: its device is not healthy" + _faults(evidence)
    return ""


def _faults(evidence: LinkEvidence) -> str:
    # The node repeats a fault with its age of now, and may not name the device; of a device that
    # is silent the status is old.
    told = {kind(reason): reason for reason in evidence.reasons}
    devices = sorted(evidence.devices.items())
    said = [(name, fault) for name, status in devices for fault in status.faults]
    faults = [
        told.get(kind(f"{name} {fault}"), f"{name} {told.get(kind(fault), fault)}")
        for name, fault in said
    ]
    faults += [f"{device} is released" for device in sorted(evidence.deployed)]
    known = {kind(fault) for fault in (*faults, *(fault for _, fault in said))}
    faults += [reason for reason in evidence.reasons if kind(reason) not in known]
    return f" ({'; '.join(faults)})" if faults else ""


def block_reasons(config: SupervisorConfig, state: State, now: float) -> tuple[str, ...]:
    """Every reason against taking off now; empty: none."""
    problem = {
        link: link_problem(config, link, state.evidence(link), now) for link in config.links
    }
    # Whoever flies with a device that nobody monitors has said so, also where others are there.
    against = [
        link
        for link in config.links
        if problem[link] and (link in config.required_links or state.unmonitored(link))
    ]
    for links in (config.kill_links, config.deploy_links):
        # One that can do it is enough; none at all means that nobody would.
        if all(problem[link] for link in links):
            against += links
    reasons = [problem[link] for link in dict.fromkeys(against)]
    reasons += [
        f"{link}: {text}"
        for link in config.links
        if not problem[link] and (text := state.evidence(link).looks_late)
    ]
    reasons += [
        text
        for rung in config.deploy_ladder
        if not problem[rung.link] and (text := _rung_problem(rung, state.evidence(rung.link)))
    ]
    reasons += [
        f"{device} asks to block flight: {why}" for device, why in state.device_blocks.items()
    ]
    reasons += [
        f"rule '{rule.name}': {rule.says or 'fulfilled'}"
        for rule in config.profile.rules
        if rule.action is Action.FLIGHT_BLOCK and state.rule(rule.name).latched
    ]
    if state.stage is not Stage.LANDED:  # with motors armed it may have bounced, and fall on
        reasons += [f"{' '.join(one)} {RELEASED}" for one in sorted(state.released_since_reset)]
    if config.require_vehicle_state and (text := _vehicle_problem(config, state, now)):
        reasons.append(text)
    if state.stage in (Stage.KILLING, Stage.DEPLOYED, Stage.FAULT):
        reasons.append(f"the vehicle is {state.stage.name}: needs a reset on the ground")
    reasons += _measured_problems(config, state, now)
    if now - state.heard.vehicle_received <= config.vehicle_state_age:
        reasons += [f"vehicle: {fault}" for fault in state.heard.vehicle.faults]
        unable = _UNABLE.get(state.heard.vehicle.system_status)
        reasons += [unable] if unable else []
        reasons += _other_kind(config, state)
    return tuple(reasons)


def _other_kind(config: SupervisorConfig, state: State) -> list[str]:
    """The profile is for another kind of vehicle than the autopilot says to fly."""
    profile, told = config.profile, state.heard.vehicle.vehicle_type
    kinds = airframes_of(told)
    if not kinds or profile.vehicle in (Airframe.ANY, *kinds):
        return []
    fitting = " or ".join(one.value for one in kinds)
    text = (
        f"the profile {profile.name} is for the vehicle {profile.vehicle.value}, and the "
        f"autopilot reports MAV_TYPE {told} ({fitting}): set the parameter profile, or `vehicle` "
        "in a profile of your own"
    )
    return [text]


def _measured_problems(config: SupervisorConfig, state: State, now: float) -> list[str]:
    """What is measured of a vehicle that stands, and cannot be."""
    used = config.profile.measured
    unfit = state.heard.unfit
    wrong = [f"{name} cannot be used: {why}" for name, why in unfit.items() if name in used]
    wrong += [
        f"{name} is contradicted: {state.heard.denied[name]}"
        for name, since in state.heard.denied_since.items()
        if now >= since + CONTRADICTED_FOR and name in used and name not in unfit
    ]
    return wrong + [
        f"{part} is in doubt: another source differs, or it has jumped"
        for part in sorted(state.heard.disputed)
    ]


#: Measurement on which a rule may rest -> what nobody sees of a vehicle that does not tell it.
_BLIND = {
    VERTICAL_SPEED: "no vertical speed is reported: a sink is seen by the heights alone",
    ACCELERATION: "no acceleration is reported: a fall is seen by its speed alone",
    TILT: "no attitude is reported: what tips over is seen once it falls",
    "sink_beyond_target": "no target is reported: an uncommanded level sink is only an alarm",
    "attitude_error": "no commanded attitude is reported: "
    "an attitude flown on purpose looks like an accident",
    PRESSURE_ALTITUDE: "no pressure is reported: a wrong but consistent estimator is believed",
}


def not_seen(config: SupervisorConfig, state: State) -> str:
    """What the rules do not see of this vehicle, as it never told it; empty: nothing."""
    used = config.profile.measured
    blind = [
        text
        for name, text in _BLIND.items()
        if name in used and math.isnan(state.measured(name).measured_at)
    ]
    return "; ".join(blind)


def _rung_problem(rung: Rung, evidence: LinkEvidence) -> str:
    """A step of the ladder that is for a device which is not there would stop the motors and
    release nothing; empty: it is there, or the node chooses."""
    if rung.device in ("", TRIGGER):
        return ""
    status = evidence.devices.get(rung.device)
    if status is None:
        heard = ", ".join(sorted(evidence.devices)) or "none"
        return f"deploy_ladder names {rung}, which was never received (received: {heard})"
    if status.link_state is not LinkState.OK:
        return f"deploy_ladder names {rung}, which is {status.link_state.name}"
    return ""


def _vehicle_problem(config: SupervisorConfig, state: State, now: float) -> str:
    """Without vehicle/state nobody can tell flight from ground; empty: it is there."""
    age = state.heard.vehicle.armed_age + now - state.heard.vehicle_received
    if math.isnan(age):
        return "vehicle/state: armed or disarmed was never reported"
    if age > config.vehicle_state_age:
        limit = config.vehicle_state_age
        return f"vehicle/state: armed or not is {age:.1f} s old (limit {limit:g} s)"
    return ""


def arm_reasons(config: SupervisorConfig, state: State, day: int, now: float) -> tuple[str, ...]:
    """Every reason against arming the parachute now; empty: none. day: today by the wall clock,
    days since 1970-01-01."""
    reasons = [*block_reasons(config, state, now)]
    if state.mode is not Mode.ACTIVE:
        reasons.append(f"supervisor mode is {state.mode.name} (need ACTIVE)")
    if state.stage not in (Stage.READY, Stage.ARMED):
        reasons.append(f"the vehicle is {state.stage.name} (need READY)")
    if 0 <= day < _FIRST_DAY:
        said = datetime.date.fromordinal(_EPOCH + day).isoformat()
        reasons.append(f"the wall clock shows {said} (need 2024-01-01 or later)")
    for link in config.links:
        reasons += _clock(config, link, state.evidence(link))
    for link in config.deploy_links:
        for status in state.evidence(link).devices.values():
            if status.link_state is LinkState.OK:
                told = _device(config.preflight, status, day, state.stage in ON_GROUND)
                reasons += [f"{link} {status.device}: {text}" for text in told]
    reasons += _battery(config, state, now)
    # What is said in the air about the ground is noise; here a still vehicle is known to stand.
    if moves := flight.moving(config, state, now):
        reasons.append(f"the vehicle moves: {moves}")
    return tuple(reasons)


def _clock(config: SupervisorConfig, link: str, evidence: LinkEvidence) -> list[str]:
    limit, difference = config.preflight.max_clock_difference, evidence.clocks_differ_by
    if math.isnan(difference):
        # Within its first seconds the newest one is all that is known.
        difference = evidence.clock_difference
    if abs(difference) > limit:
        return [f"{link}: its clock differs by {difference:+.3f} s (limit {limit:g} s)"]
    return []


def _device(
    limits: PreflightLimits, status: ParachuteStatus, day: int, on_ground: bool
) -> list[str]:
    told = []
    if status.state not in (ParachuteState.READY, ParachuteState.TAKEOFF, ParachuteState.ARMED):
        told.append(f"its state is {status.state.name} (need READY, TAKEOFF or ARMED)")
    if status.deployed:
        told.append("it is released")
    # Where its node finds no fault in it, they are flags that do not apply to this product.
    if status.error_flags and status.faults:
        told.append(f"errors {', '.join(flag_names(status.error_flags))} (need none)")
    told += _packed(limits, status.packed_date, day)
    self_arms = bool(status.armed_triggers & TriggerFlags.ATS_AUTO_ARM)
    if limits.require_self_arm and not self_arms:
        told.append("ATS_AUTO_ARM is off (need on: it arms itself above its height)")
    cleared = status.safety_flags & SafetyFlags.GROUND_CLEARED
    if limits.forbid_ground_cleared and cleared and on_ground:
        told.append("GROUND_CLEARED is set on the ground (need not set)")
    if status.backup_voltage < limits.min_backup_voltage:
        told.append(
            f"backup voltage {status.backup_voltage:.2f} V (need {limits.min_backup_voltage:g} V)"
        )
    return told


def _packed(limits: PreflightLimits, packed_date: str, day: int) -> list[str]:
    try:
        packed = datetime.date.fromisoformat(packed_date).toordinal() - _EPOCH
    except ValueError:
        return ["no pack date (need one)"] if limits.require_pack_date else []
    if day < 0:
        return []
    age = day - packed
    if age < -1:
        return [f"packed on {packed_date}, {-age} days from now"]
    if 0 < limits.max_pack_age < age:
        return [f"packed on {packed_date}, {age} days ago (limit {limits.max_pack_age})"]
    return []


def _battery(config: SupervisorConfig, state: State, now: float) -> list[str]:
    limits, told = config.preflight, []
    for name, least, unit in (
        ("battery_remaining", limits.min_battery_remaining, ""),
        ("battery_voltage", limits.min_battery_voltage, " V"),
    ):
        value = readings.measured(config, state, name, now)
        if value < least:
            told.append(f"{name} {value:.2f}{unit} (need {least:g}{unit})")
    return told
