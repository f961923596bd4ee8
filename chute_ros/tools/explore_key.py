"""Which states of the core are the same to the exploration.

Times are taken relative to now, to a millisecond, and as "long ago" where every limit on them has
passed; numbers of decisions by their order. Left out is what only becomes text, what only times
the repetition of a decision that has been made, and the rules that only raise an alarm.
"""

from __future__ import annotations

import math
from collections.abc import Hashable

from chute_ros.model import FIRES, Action
from chute_ros.supervisor import flight
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.counter import UNKNOWN_STANDS
from chute_ros.supervisor.gate import OPERATOR
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measured import JUMP_DOUBTED, REJECTION_DOUBTED
from chute_ros.supervisor.pending import ASK_LASTS, Pending
from chute_ros.supervisor.rules import Rule
from chute_ros.supervisor.state import State

#: Fields that do not decide: texts, counts for people, what only times a repetition, and what is
#: always the same here.
LEFT_OUT = frozenset(
    {
        "late_count",
        "updated_at",  # always now
        "next_id",
        "newest",
        "epoch",
        "deploy_reasons",
        "block_refused",
        "leading",
        "denied",
        "seq",  # of which every heartbeat here brings the next, or begins anew
        "lost_count",
        "clock_difference",
        "clock_spell_since",  # no clock is told here
        "clock_least",
        "clock_least_before",
        "same_since",  # no value here stays the same
        "source",  # here one source tells all
        "others",
        "sent_at",
        "details",
        "earlier",
        "heights",  # only where no speed is told, which is told here with every height
        "vehicle_rests_until",  # told by the measurements
        "killed_at",  # as the next, told by the height that is left since
        "killed_height",
        "deploy_height",  # for people alone
        "home",  # from it only the fence is measured, whose rule raises an alarm
        "reasons",
        "behind",  # every node here keeps up
        "pressure_heights",  # no pressure, altitude, target or fault is told here
        "pressure_before",
        "ground_pressure_altitude",
        "at_ground_since",
        "home_altitude",
        "commanded",
        "faults_told",
        "motion",  # pictures come too seldom here to contradict each other
        "denied_since",
        "unfit",
        "fitness_since",
        "armed_on_ground",  # after a flight, of devices that the explorer does not look at
    }
)
_MEASURED = ("height", "vertical_speed", "tilt_deg", "acceleration", "battery_remaining")
_LONG_AGO = 1e9


def canonical(config: SupervisorConfig, state: State, now: float) -> Hashable:
    """Equal for two states that decide the same from now on."""
    slots = (state.block, state.killing.kill, *state.deploying.deploys)
    grace = max(config.limits(link).startup_grace for link in config.links)
    return (
        state.stage,
        state.mode,
        _since(state.started_at, now, grace) if state.stage is Stage.STARTUP else 0.0,
        _stage_since(config, state, now),
        tuple(_link(config, state, link, now) for link in config.links),
        _vehicle(config, state, now),
        tuple(_measured(config, state, name, now) for name in _MEASURED),
        tuple(
            _rule(state, rule) for rule in config.profile.rules if rule.action is not Action.NONE
        ),
        tuple((who, _since(ask.at, now, ASK_LASTS)) for who, ask in sorted(state.asks.items())),
        tuple(_pending(config, state, pending, now) for pending in slots),
        # Which was decided after which.
        tuple(sorted(range(len(slots)), key=lambda n: _number(slots[n]))),
        bool(state.deploying.deploy_rule),
        round(state.deploying.deploy_due - now, 3) if state.deploying.deploy_due > now else 0.0,
        tuple((rung.link, rung.device) for rung in state.deploying.deploy_ladder),
        (state.flight.flown, state.flight.airborne, state.flight.rebooted),
        state.killing.killed_in_flight,
        state.flight.was_high or _since(state.flight.airborne_since, now, flight.HIGH_AFTER),
        # No story here lasts as long as a landing counts.
        math.isnan(state.flight.landed_at),
        state.flight.reboots_before,
        state.killing.killed_standing,
        state.killing.killed_low,
        _left(flight.height_since_kill(config, state, now), config.profile.minimum_height),
        _known(state.killing.killed_sinking),
        _until(flight.low_at(config, state, True, now), now),
        state.deploying.deploy_rule == OPERATOR,
        bool(state.deploying.deploys) and state.deploying.deploys[0].decision.rule == OPERATOR,
        _since(
            state.flight.down_since,
            now,
            flight.down_after_kill_at(config, state) - state.flight.down_since,
        ),
        round(state.flight.armed_height, 3),
        _known(state.flight.took_off_height),
        tuple(sorted(state.flight.released_before)),
        tuple(sorted(state.released_since_reset)),
        tuple(sorted(state.device_blocks)),
        (len(state.own.kill_tokens) > 0, len(state.own.deploy_tokens) > 0),
        (bool(state.alarming.alarms), math.isnan(state.alarming.alarm_at)),
        (state.alarming.canopy_fails, state.killing.kill_only),
        round(state.flight.up_for, 3),
        _since(state.heard.still_since, now, flight.STILL_FOR),
        _since(state.heard.rests_since, now, flight.RESTS_FOR),
    )


def _known(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 3)


def _left(height: float, minimum: float) -> float:
    """Of a height, m, above the minimum; -1: it is not known, or below it."""
    return round(height - minimum, 3) if height >= minimum else -1.0


def _until(when: float, now: float) -> float | None:
    """Time that is left, s; 0: none; None: it does not come."""
    return None if math.isinf(when) else round(max(when - now, 0.0), 3)


def _since(when: float, now: float, limit: float) -> float:
    """Age in s; -1: it has not happened; _LONG_AGO: the limit has passed."""
    if math.isnan(when):
        return -1.0
    age = round(now - when, 3)
    return age if age <= limit else _LONG_AGO


def _stage_since(config: SupervisorConfig, state: State, now: float) -> float:
    if state.stage is Stage.FAULT:
        return _since(state.stage_since, now, config.deploy_timeout)
    waited_for = state.stage is Stage.DEPLOYED and state.own.deploy_tokens
    return _since(state.stage_since, now, config.report_wait) if waited_for else 0.0


def _link(config: SupervisorConfig, state: State, link: str, now: float) -> Hashable:
    evidence, limits = state.evidence(link), config.limits(link)
    devices = sorted(evidence.devices.items())
    return (
        _since(evidence.heard, now, limits.lost_after),
        evidence.reported,
        evidence.device_healthy,
        _since(evidence.regained_at, now, limits.regain_after),
        _since(evidence.released_at, now, limits.lost_after),
        tuple((name, status.link_state, status.deployed) for name, status in devices),
    )


def _vehicle(config: SupervisorConfig, state: State, now: float) -> Hashable:
    vehicle = state.heard.vehicle
    return (
        _since(state.heard.vehicle_received, now, config.vehicle_state_age),
        vehicle.armed,
        vehicle.landed_state,
        vehicle.link_state,
        vehicle.system_status,
        vehicle.reboot_count,
        state.heard.disputed,
    )


def _measured(config: SupervisorConfig, state: State, name: str, now: float) -> Hashable:
    measured, limits = state.measured(name), config.profile.limits[name]
    return (
        round(measured.value, 3) if not math.isnan(measured.value) else None,
        _since(measured.measured_at, now, max(limits.max_age, UNKNOWN_STANDS)),
        _since(measured.doubted_at, now, REJECTION_DOUBTED),
        _since(measured.jumped_at, now, JUMP_DOUBTED),
        round(measured.before_jump, 3) if not math.isnan(measured.before_jump) else None,
        bool(measured.rejected),
        round(measured.candidate, 3) if measured.candidates else None,
        _since(measured.candidate_at, now, limits.max_age),
        measured.candidates,
    )


def _rule(state: State, rule: Rule) -> Hashable:
    evidence = state.rule(rule.name)
    come = tuple(
        state.measured(condition.measurement).count
        if isinstance(condition, MeasurementCondition)
        else -1
        for condition in rule.conditions
    )
    shown = tuple(round(count, 3) for count in evidence.shown)
    new = tuple(a != b for a, b in zip(evidence.seen, come, strict=False))
    level = round(evidence.level, 3)
    unknown = min(round(evidence.unknown, 3), UNKNOWN_STANDS)
    kept = tuple(round(left, 3) for left in evidence.kept)
    sure = evidence.holds, evidence.sure
    return sure, level, shown, (evidence.latched, evidence.put_off), kept, new, unknown


def _number(pending: Pending | None) -> tuple[int, int]:
    return pending.number if pending is not None else (0, 0)


def _pending(
    config: SupervisorConfig, state: State, pending: Pending | None, now: float
) -> Hashable:
    if pending is None:
        return None
    blocks = pending.decision.action not in FIRES
    longest = max(config.kill_timeout, config.deploy_timeout)
    return (
        pending.decision.action,
        pending.decision.shadow,
        pending.decision.epoch == state.epoch,
        pending.decision.targets,
        pending.targets,
        0.0 if blocks else _since(pending.decided_at, now, longest),
        tuple((link, tuple(sorted(told))) for link, told in sorted(pending.outcomes.items())),
        pending.given_up,
    )
