"""What is true of the autopilot, as a condition."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from chute_ros.model import Armed, LinkState
from chute_ros.supervisor import flight
from chute_ros.supervisor.conditions.base import JUST_AFTER, Condition, Finding
from chute_ros.supervisor.conditions.measurement import known_by
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.measurements import FALL_SIGNS
from chute_ros.supervisor.yaml_lines import ProfileLines, Where

if TYPE_CHECKING:
    from chute_ros.supervisor.config import SupervisorConfig
    from chute_ros.supervisor.state import Killing, State

_EMERGENCY = (6, 8)  # MAV_STATE_EMERGENCY, MAV_STATE_FLIGHT_TERMINATION


class AutopilotFact(enum.Enum):
    """What can be true of the autopilot."""

    LOST = "lost"  # vehicle/state, or the autopilot behind it, is silent
    REBOOTED = "rebooted"  # it restarted in flight
    DISARMED = "disarmed"  # it says that the motors are off
    EMERGENCY = "emergency"  # it says MAV_STATE_EMERGENCY or MAV_STATE_FLIGHT_TERMINATION
    #: We stopped its motors in the air, so long ago that it still falls, and nothing tells how.
    KILLED_ALOFT = "killed_aloft"
    #: We stopped its motors in the air, which is confirmed, and nobody asked for the kill alone.
    MOTORS_STOPPED = "motors_stopped"


@dataclass(frozen=True)
class AutopilotCondition(Condition):
    """The autopilot is so.

    counted False: the rule's counter goes up without it as well. It must hold once the rule is
    acted on; but what has been waited for already, as silence has, need not be waited for twice.
    """

    fact: AutopilotFact
    weight: float = 1.0
    counted: bool = True
    key: ClassVar = "autopilot"
    may_go_uncounted: ClassVar = True

    @property
    def is_silence(self) -> bool:
        """Of one that is lost nothing else is known."""
        return self.fact is AutopilotFact.LOST

    @property
    def rests_on_the_vehicle(self) -> bool:
        """All but what our kill did."""
        return self.fact not in (AutopilotFact.KILLED_ALOFT, AutopilotFact.MOTORS_STOPPED)

    @classmethod
    def parse(
        cls, lines: ProfileLines, what: str, where: Where, entries: dict[str, Where], weight: float
    ) -> AutopilotCondition:
        """What the autopilot is, and whether that is waited for."""
        fact = lines.member(entries["autopilot"], f"autopilot in {what}", AutopilotFact)
        counted = True
        if "counted" in entries:
            counted = lines.truth(entries["counted"], f"counted of {fact.value} in {what}")
        return cls(fact, weight, counted)

    def find(self, config: SupervisorConfig, state: State, now: float) -> Finding:
        """As its fact is found."""
        return _FINDERS[self.fact](config, state, now)

    def deadlines(
        self, config: SupervisorConfig, state: State, holds: bool | None, doubts: bool, now: float
    ) -> Iterable[float]:
        """When what it says is too old, and when what tells of a fall is."""
        told = [state.heard.vehicle_received + config.vehicle_state_age]
        if self.fact is AutopilotFact.REBOOTED:
            told.append(state.flight.steady_since + flight.STEADY_FOR)
        if self.fact is AutopilotFact.DISARMED:
            told += [until for until in (flight.flies_until(state),) if not math.isnan(until)]
        if self.fact is AutopilotFact.KILLED_ALOFT:
            names = [name for sign in FALL_SIGNS for name in known_by(sign)]
            limits = config.profile.limits
            told += [state.measured(name).turns_at(limits[name], now) for name in names]
        return [one + JUST_AFTER for one in told]


def _rebooted(config: SupervisorConfig, state: State, now: float) -> Finding:
    rebooted = state.flight.rebooted and not flight.flies_again(state, now)
    return Finding(rebooted, lambda: f"autopilot restarts in flight {int(rebooted)}")


def _lost(config: SupervisorConfig, state: State, now: float) -> Finding:
    silence, limit = now - state.heard.vehicle_received, config.vehicle_state_age
    if math.isnan(silence):
        return Finding(None, lambda: "vehicle/state never received")
    link = state.heard.vehicle.link_state
    return Finding(
        silence > limit or link is LinkState.LOST,
        lambda: (
            f"autopilot link {link.name}, vehicle/state {silence:.2f} s old "
            f"(lost after {limit:g} s)"
        ),
    )


def _killed_aloft(config: SupervisorConfig, state: State, now: float) -> Finding:
    left, minimum = flight.height_since_kill(config, state, now), config.profile.minimum_height
    silent = flight.silent_since_kill(config, state, now)
    return Finding(
        left >= minimum and silent,
        lambda: (
            f"killed aloft {now - state.killing.killed_at:.2f} s ago, at least {left:.1f} m are "
            f"left (minimum {minimum:g} m), and {'nothing' if silent else 'something'} reports "
            "whether it falls"
        ),
    )


def _motors_stopped(config: SupervisorConfig, state: State, now: float) -> Finding:
    known = state.killing
    ours = state.stage is Stage.KILLING and known.killed_in_flight and not known.killed_standing
    stopped = ours and known.kill is not None and known.kill.confirmed
    return Finding(
        stopped and not known.killed_low,
        lambda: (
            "its motors were stopped in flight, as its own state confirms, "
            f"{'too low' if known.killed_low else 'high enough'}: {_at_kill(config, known)}"
        ),
    )


def _at_kill(config: SupervisorConfig, known: Killing) -> str:
    height = "unknown" if math.isnan(known.killed_height) else f"{known.killed_height:.1f} m"
    return f"height {height} (minimum {config.profile.minimum_height:g} m)"


def _disarmed(config: SupervisorConfig, state: State, now: float) -> Finding:
    said = flight.armed(config, state, now)
    disarmed, off = said is Armed.DISARMED, flight.says_off(state, now)
    besides = " and IN_AIR" if disarmed and not off else ""
    return Finding(disarmed and off, lambda: f"autopilot says {said.name}{besides}")


def _emergency(config: SupervisorConfig, state: State, now: float) -> Finding:
    status = state.heard.vehicle.system_status
    if now - state.heard.vehicle_received > config.vehicle_state_age:
        return Finding(None, lambda: "autopilot's own state is old")
    return Finding(status in _EMERGENCY, lambda: f"autopilot's own state is {status} (6 or 8)")


_FINDERS: dict[AutopilotFact, Callable[[SupervisorConfig, State, float], Finding]] = {
    AutopilotFact.LOST: _lost,
    AutopilotFact.REBOOTED: _rebooted,
    AutopilotFact.DISARMED: _disarmed,
    AutopilotFact.EMERGENCY: _emergency,
    AutopilotFact.KILLED_ALOFT: _killed_aloft,
    AutopilotFact.MOTORS_STOPPED: _motors_stopped,
}
