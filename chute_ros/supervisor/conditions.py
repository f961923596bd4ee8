"""Whether a condition holds now, with its value and its limit in words."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from chute_ros.model import Armed, LinkState, ParachuteState
from chute_ros.supervisor import flight
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.contradictions import DIVE
from chute_ros.supervisor.link_evidence import LinkJudgement
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measurements import (
    ACCELERATION,
    CLIMB_RATE,
    TILT,
    VERTICAL_ACCELERATION,
    VERTICAL_SPEED,
)
from chute_ros.supervisor.rules import (
    ALL,
    ANY,
    AutopilotCondition,
    AutopilotFact,
    Condition,
    DeviceCondition,
    DeviceFact,
    LinkCondition,
    MeasurementCondition,
)
from chute_ros.supervisor.state import ASK_LASTS, State

_EMERGENCY = (6, 8)  # MAV_STATE_EMERGENCY, MAV_STATE_FLIGHT_TERMINATION
#: Measurement -> the one of which it is said that it is denied; those that claim it by being low.
_CLAIMS = {
    VERTICAL_SPEED: VERTICAL_SPEED,
    CLIMB_RATE: VERTICAL_SPEED,
    VERTICAL_ACCELERATION: VERTICAL_SPEED,
    "sink_beyond_target": VERTICAL_SPEED,
    ACCELERATION: ACCELERATION,
    TILT: TILT,
    "attitude_error": TILT,
}
_CLAIMED_BELOW = (VERTICAL_SPEED, CLIMB_RATE, VERTICAL_ACCELERATION, ACCELERATION)


class Finding(NamedTuple):
    """holds None: it cannot be said. tell: says what was found, asked only where somebody reads
    it. samples: so many distinct ones came so far; -1: none do. doubted: the sensor that tells it
    has just told what cannot be. presumed: it is not known, and taken to be so."""

    holds: bool | None
    tell: Callable[[], str]
    samples: int = -1
    doubted: bool = False
    presumed: bool = False
    #: It does not hold, but goes on to where it did until the rule's counter was full.
    lingers: bool = False

    @property
    def text(self) -> str:
        """What was found, with its limit."""
        return self.tell()


def find(config: SupervisorConfig, state: State, condition: Condition, now: float) -> Finding:
    """Look at what is known now."""
    return _FINDERS[type(condition)](config, state, condition, now)


def _measurement(
    config: SupervisorConfig, state: State, condition: MeasurementCondition, now: float
) -> Finding:
    name, known = condition.measurement, state.measured(condition.measurement)
    samples = known.count
    value, why = flight.reading(config, state, name, now)
    if why:

        def tell() -> str:
            taken = ", taken to be so" if condition.if_unknown else ""
            return f"{name} cannot be used: {why} (asked for: {condition.limits}){taken}"

        if condition.if_unknown:
            return Finding(True, tell, presumed=True)
        return Finding(None, tell, samples)
    doubt = flight.doubt(state, name, value, now)
    if name == CLIMB_RATE or value != known.value:
        samples = flight.rate_count(config, state, now)  # told by heights instead
    if name == VERTICAL_ACCELERATION:
        samples = state.measured(VERTICAL_SPEED).count
    # A limit that is not asked for is NaN, and nothing is beyond it.
    holds = not (value <= condition.above or value >= condition.below)
    denied = _denied(config, state, condition, now) if holds else ""
    if holds and condition.unless_dived:
        denied = denied or state.commanded.get(DIVE, "")

    def told() -> str:
        weaker = f"; in doubt: {doubt}" if doubt else ""
        return f"{name} {value:.2f} ({condition.limits}{weaker})"

    if denied:
        return Finding(False, lambda: f"{told()} denied: {denied}", samples)

    lingers = not holds and condition.lingers(value)
    return Finding(holds, told, samples, bool(doubt), lingers=lingers)


def _denied(
    config: SupervisorConfig, state: State, condition: MeasurementCondition, now: float
) -> str:
    """Why what this claims of a fall is not so, by other origins; empty: none denies it."""
    name = condition.measurement
    if not (state.denied or state.commanded) or name not in _CLAIMS:
        return ""
    below = not math.isnan(condition.below)
    claims_a_fall = below if name in _CLAIMED_BELOW else not math.isnan(condition.above)
    by_barometer = name == CLIMB_RATE and not math.isnan(flight.pressure_rate(config, state, now))
    if not claims_a_fall:
        return ""
    claim = _CLAIMS[name]
    denied = "" if by_barometer else state.denied.get(claim, "")
    return denied or state.commanded.get(name if name == CLIMB_RATE else claim, "")


def _link(config: SupervisorConfig, state: State, condition: LinkCondition, now: float) -> Finding:
    names = config.required_links if condition.link in (ANY, ALL) else (condition.link,)
    looks, so = [], []
    for name in names:
        evidence, limits = state.evidence(name), config.limits(name)
        judged = evidence.judged(limits, now)
        in_grace = now < state.started_at + limits.startup_grace
        starting = judged is LinkJudgement.NEVER_SEEN and in_grace
        looks.append((name, judged, starting, evidence.heard))
        so.append(judged in condition.judged and not starting)

    def tell() -> str:
        told = [
            f"{name} is still starting"
            if starting
            else f"{name} is {judged.name}, heard {now - heard:.2f} s ago"
            for name, judged, starting, heard in looks
        ]
        wanted = " or ".join(judgement.name for judgement in condition.judged)
        return f"link {', '.join(told)} (asked for: {wanted})"

    return Finding(all(so) if condition.link == ALL else any(so), tell)


def _autopilot(
    config: SupervisorConfig, state: State, condition: AutopilotCondition, now: float
) -> Finding:
    vehicle, fact = state.vehicle, condition.fact
    if fact is AutopilotFact.REBOOTED:
        rebooted = state.rebooted
        return Finding(rebooted, lambda: f"autopilot restarts in flight {int(rebooted)}")
    if fact is AutopilotFact.LOST:
        silence, limit = now - state.vehicle_received, config.vehicle_state_age
        if math.isnan(silence):
            return Finding(None, lambda: "autopilot never heard")
        lost = silence > limit or vehicle.link_state is LinkState.LOST
        return Finding(
            lost,
            lambda: (
                f"autopilot link {vehicle.link_state.name}, vehicle/state {silence:.2f} s old "
                f"(lost after {limit:g} s)"
            ),
        )
    if fact is AutopilotFact.KILLED_ALOFT:
        left, minimum = flight.height_since_kill(config, state, now), config.profile.minimum_height
        silent = flight.silent_since_kill(config, state, now)
        return Finding(
            left >= minimum and silent,
            lambda: (
                f"killed aloft {now - state.killed_at:.2f} s ago, at least {left:.1f} m are left "
                f"(minimum {minimum:g} m), and {'nothing' if silent else 'something'} tells "
                "whether it falls"
            ),
        )
    if fact is AutopilotFact.MOTORS_STOPPED:
        kill = state.kill
        ours = (
            state.stage is Stage.KILLING and state.killed_in_flight and not state.killed_standing
        )
        stopped = ours and kill is not None and kill.confirmed
        minimum = config.profile.minimum_height
        return Finding(
            stopped and state.killed_height >= minimum,
            lambda: (
                "its motors were stopped in flight, as its own state confirms, at "
                f"{state.killed_height:.1f} m (minimum {minimum:g} m)"
            ),
        )
    if fact is AutopilotFact.DISARMED:
        said = flight.armed(config, state, now)
        return Finding(said is Armed.DISARMED, lambda: f"autopilot says {said.name}")
    status = vehicle.system_status
    if now - state.vehicle_received > config.vehicle_state_age:
        return Finding(None, lambda: "autopilot's own state is old")
    return Finding(status in _EMERGENCY, lambda: f"autopilot's own state is {status} (6 or 8)")


def _device(
    config: SupervisorConfig, state: State, condition: DeviceCondition, now: float
) -> Finding:
    names = config.links if condition.link == ANY else (condition.link,)
    if condition.fact is DeviceFact.ASKS_FOR_KILL:
        # One whose link is not among ours may ask all the same: to kill is the safe side.
        asks = [
            f"{who}: {ask.reason}"
            for who, ask in state.asks.items()
            if now < ask.at + ASK_LASTS and (condition.link == ANY or ask.link in names)
        ]
        return Finding(bool(asks), lambda: "; ".join(asks) or "no device asks for a kill")
    if condition.fact is DeviceFact.DEPLOYED:
        out = sorted(one for one in state.newly_released(config, now) if one[0] in names)

        def tell() -> str:
            who = ", ".join(" ".join(one) for one in out)
            return f"{who}: its own status says deployed" if out else "no parachute is out"

        return Finding(bool(out), tell)
    wrong = [
        f"{name} {device} is ABNORMAL ({'; '.join(status.faults) or 'no reason given'})"
        for name in names
        for device, status in state.evidence(name).devices.items()
        if status.state is ParachuteState.ABNORMAL
        and state.links[name].is_heard(config.limits(name), now)
    ]
    return Finding(bool(wrong), lambda: "; ".join(wrong) or "no device is ABNORMAL")


_FINDERS: dict[type[Condition], Callable[[SupervisorConfig, State, Any, float], Finding]] = {
    MeasurementCondition: _measurement,
    LinkCondition: _link,
    AutopilotCondition: _autopilot,
    DeviceCondition: _device,
}
