"""Tells timed stories to the supervisor's core: at t+..., this comes; then, this is decided."""

from __future__ import annotations

import copy
import functools
import math
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from chute_ros.model import (
    Action,
    Armed,
    Decision,
    LandedState,
    LinkState,
    Outcome,
    ParachuteState,
    ParachuteStatus,
    VehicleState,
)
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.codec import INLINE
from chute_ros.supervisor.conditions.base import Condition
from chute_ros.supervisor.conditions.measurement import MeasurementCondition
from chute_ros.supervisor.config import TRIGGER, SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.preflight import block_reasons
from chute_ros.supervisor.profile_reader import read_profile
from chute_ros.supervisor.record import CoreTurn
from chute_ros.supervisor.rules import Profile, Rule
from chute_ros.supervisor.state import State
from chute_ros.supervisor.state_text import state_text
from chute_ros.supervisor.wakes import next_deadline

LINK = "mavlink_parachute"
START = 1000.0
FLYING = VehicleState(
    armed=Armed.ARMED, armed_age=0.0, landed_state=LandedState.IN_AIR, landed_state_age=0.0
)
STANDING = VehicleState(
    armed=Armed.DISARMED, armed_age=0.0, landed_state=LandedState.ON_GROUND, landed_state_age=0.0
)
#: On the ground, the motors still turn.
IDLING = VehicleState(
    armed=Armed.ARMED, armed_age=0.0, landed_state=LandedState.ON_GROUND, landed_state_age=0.0
)
#: What a vehicle that flies well says besides; tilt in degrees.
FLYING_WELL: dict[str, Any] = {
    "armed": Armed.ARMED,
    "landed_state": LandedState.IN_AIR,
    "link_state": LinkState.OK,
    "system_status": 4,
    "height": 50.0,
    "vertical_speed": 0.1,
    "tilt": 5.0,
    "acceleration": 9.8,
    "battery_remaining": 0.8,
    "latitude": 48.0,
    "longitude": 11.0,
}
#: What one that stands with its motors off says.
DOWN: dict[str, Any] = {"armed": Armed.DISARMED, "landed_state": LandedState.ON_GROUND}
_AGES = {
    "armed": "armed_age",
    "landed_state": "landed_state_age",
    "height": "height_age",
    "altitude": "altitude_age",
    "pressure": "pressure_age",
    "attitude_error": "attitude_error_age",
    "target_vertical_speed": "target_age",
    "below_target": "target_age",
    "vertical_speed": "vertical_speed_age",
    "tilt": "attitude_age",
    "acceleration": "acceleration_age",
    "battery_remaining": "battery_age",
    "battery_voltage": "battery_age",
    "latitude": "position_age",
    "longitude": "position_age",
}
#: A real sensor is never the same to the last bit; so much a told value wanders.
_NOISE = 1e-9
PROFILES = Path(__file__).parents[2] / "config" / "profiles"


def changed(state: State, **known: Any) -> State:
    """state with these fields changed, each in the group that it is in."""
    for name, value in known.items():
        if name in vars(state):
            state = replace(state, **{name: value})
        else:
            groups = [one.name for one in fields(state) if one.metadata == INLINE]
            group = next(one for one in groups if hasattr(getattr(state, one), name))
            state = replace(state, **{group: replace(getattr(state, group), **{name: value})})
    return state


def vehicle(age: float = 0.0, **told: Any) -> i.VehicleReport:
    """The vehicle tells these parts, each measured age s ago. tilt, attitude_error: degrees."""
    for name in ("tilt", "attitude_error"):
        if name in told:
            told = {**told, name: math.radians(told[name])}
    ages = {_AGES[name]: age for name in told if name in _AGES}
    return i.VehicleReport(VehicleState(**{**ages, **told}))


def pressure_at(height: float, ground: float = 488.0) -> float:
    """Pa, by the standard atmosphere, at this height over a ground so high, m."""
    return 101_325.0 * (1.0 - (height + ground) / 44_330.77) ** (1.0 / 0.190263)


def falling(t: float, height: float = 100.0) -> dict[str, float]:
    """What a vehicle tells t s after its motors stopped at this height; it drags at 20 m/s."""
    speed = 20.0 * math.tanh(9.81 * t / 20.0)
    way = 20.0**2 / 9.81 * math.log(math.cosh(9.81 * t / 20.0))
    force = 9.81 * (speed / 20.0) ** 2
    return {"height": height - way, "vertical_speed": -speed, "acceleration": force}


def rule(
    *conditions: Condition,
    action: Action = Action.DEPLOY,
    states: tuple[Stage, ...] = (Stage.IN_FLIGHT, Stage.KILLING),
    **settings: Any,
) -> Rule:
    """A rule that needs all its conditions, at once unless hold says otherwise."""
    settings.setdefault("needed", sum(condition.weight for condition in conditions))
    settings.setdefault("name", "tested")
    return Rule(conditions=conditions, action=action, states=states, **settings)


#: It sinks faster than 12 m/s.
SINKS = MeasurementCondition("vertical_speed", below=-12.0)
#: It lies on its side, or nearly.
TILTS = MeasurementCondition("tilt_deg", above=60.0)


def with_rules(
    *rules: Rule, profile: dict[str, Any] | None = None, **settings: Any
) -> SupervisorConfig:
    """Settings with a profile of these rules."""
    return SupervisorConfig(profile=Profile("tested", rules, **(profile or {})), **settings)


def shipped(name: str, **settings: Any) -> SupervisorConfig:
    """Settings with a profile as it is shipped."""
    links = SupervisorConfig(**settings).links
    return SupervisorConfig(profile=_read(name, links), **settings)


@functools.cache
def _read(name: str, links: tuple[str, ...]) -> Profile:
    """Once for all stories."""
    text = (PROFILES / f"{name}.yaml").read_text(encoding="utf-8")
    return read_profile(text, name, links)


def parachute(
    link: str = LINK,
    device: str = "1/161",
    deployed: bool = False,
    faults: tuple[str, ...] = (),
    alive: bool = True,
    armed: bool = False,
) -> i.ParachuteReport:
    """A parachute tells its picture; one that is not alive is told of by its node."""
    state = ParachuteState.LAUNCHED if deployed else ParachuteState.READY
    link_state = LinkState.OK if alive else LinkState.LOST
    status = ParachuteStatus(
        device, link_state, state, armed=armed, deployed=deployed, faults=faults
    )
    return i.ParachuteReport(link, status)


def refused(token: int, why: str) -> i.Finish:
    """The answer to a request that is not taken."""
    return i.Finish(token, False, False, f"refused: {why}")


@dataclass
class Story:
    """One supervisor from its start; t is seconds since then."""

    config: SupervisorConfig = field(default_factory=SupervisorConfig)
    mode: i.Mode = i.Mode.ACTIVE

    def __post_init__(self) -> None:
        self.t = 0.0
        self.seq = 0
        self.noise = 0
        self.turns: list[CoreTurn] = []
        self.state = State(epoch=7, started_at=START, mode=self.mode)
        self.outputs: list[tuple[float, i.Output]] = []

    def at(self, t: float, *inputs: i.Input) -> list[i.Output]:
        """Go to t, waking at every deadline on the way as the node does, then take in inputs."""
        assert t >= self.t
        while True:
            wake = next_deadline(self.config, self.state, START + self.t) - START
            if wake >= t:
                break
            self._update((), wake)
        return self._update(inputs, t)

    def fork(self) -> Story:
        """Another story that goes on from here."""
        other = copy.copy(self)
        other.turns, other.outputs = [*self.turns], [*self.outputs]
        return other

    def _update(self, inputs: tuple[i.Input, ...], t: float) -> list[i.Output]:
        self.t = t
        self.state, outputs = update(self.config, self.state, inputs, START + t)
        self.turns.append(CoreTurn(START + t, inputs, outputs))
        self.outputs += [(t, output) for output in outputs]
        return list(outputs)

    # -- what comes ------------------------------------------------------------------------------

    def heartbeat(
        self, link: str = LINK, healthy: bool = True, state: LinkState = LinkState.OK
    ) -> i.LinkHeartbeat:
        """A heartbeat of a device node."""
        self.seq += 1
        return i.LinkHeartbeat(link, state, healthy, self.seq)

    def alive(self, until: float, *links: str) -> None:
        """Healthy heartbeats ten times a second from now to until."""
        while self.t + 0.1 <= until + 1e-9:
            self.at(self.t + 0.1, *[self.heartbeat(link) for link in links or (LINK,)])

    def told(self, **told: Any) -> i.VehicleReport:
        """What a vehicle says that flies well but for what is named; with noise as of a sensor."""
        self.noise = (self.noise + 1) % 97
        parts = {**FLYING_WELL, **told}
        for name, value in parts.items():
            if type(value) is float and name in _AGES:
                parts[name] = value + _NOISE * self.noise
        return vehicle(**parts)

    def fly(self, until: float, every: float = 0.05, **told: Any) -> Story:
        """Heartbeats and the vehicle's state from now to until; what is not named is well."""
        start, steps = self.t, round((until - self.t) / every)
        for step in range(1, steps + 1):
            self.at(start + step * every, self.heartbeat(), self.told(**told))
        return self

    def fall(self, until: float, height: float = 100.0, **told: Any) -> Story:
        """As fly, with motors that stop now at this height."""
        start, steps = self.t, round((until - self.t) / 0.05)
        for step in range(1, steps + 1):
            parts = {**falling(step * 0.05, height), **told}
            self.at(start + step * 0.05, self.heartbeat(), self.told(**parts))
        return self

    def sink(self, until: float, fastest: float, **told: Any) -> Story:
        """As fly, sinking as fast as bodies fall, down to fastest, m/s: no speed that jumps."""
        start, steps = self.t, round((until - self.t) / 0.05)
        for step in range(1, steps + 1):
            parts = {**told, "vertical_speed": -min(9.81 * step * 0.05, fastest)}
            self.at(start + step * 0.05, self.heartbeat(), self.told(**parts))
        return self

    def sent(self, *actions: Action, start: float = 0.0) -> list[tuple[float, Action, bool]]:
        """When each of these decisions left since start, and whether it was sent again."""
        return [
            (t, o.decision.action, o.again)
            for t, o in self.outputs
            if t >= start and isinstance(o, i.Decide) and o.decision.action in actions
        ]

    def fired(self) -> list[str]:
        """Every kill and deploy, each once, in their order."""
        return [d.action.name for d in self.decisions() if d.action >= Action.KILL]

    def said(self) -> str:
        """All lines of the log."""
        return "\n".join(o.text for _, o in self.outputs if isinstance(o, i.LogMessage))

    def ready(self) -> Story:
        """Links healthy, standing on the ground; the devices that the ladder names are there."""
        named = [one for one in self.config.deploy_ladder if one.device not in ("", TRIGGER)]
        devices = [parachute(link=one.link, device=one.device) for one in named]
        self.at(self.t, self.heartbeat(), *devices, i.VehicleReport(STANDING))
        assert self.state.stage is Stage.READY
        return self

    def flying(self) -> Story:
        """In the air with healthy links."""
        self.ready()
        self.at(self.t, i.VehicleReport(FLYING))
        assert self.state.stage is Stage.IN_FLIGHT
        return self

    def ordered(self, *links: str) -> Story:
        """In flight; a person asks for a deploy at 1.0 (token 5), heartbeats of links at 0.9."""
        self.flying()
        if links:
            self.at(0.9, *[self.heartbeat(link) for link in links])
        self.at(1.0, i.DeployRequest(5, False, "it falls"))
        return self

    def deploying(self, *links: str, confirmed: float = 1.1) -> Story:
        """The same, its kill confirmed."""
        self.ordered(*links)
        self.at(confirmed, self.report(Action.KILL, Outcome.CONFIRMED))
        assert self.state.stage is Stage.DEPLOYING
        return self

    def follows(self) -> Story:
        """Another supervisor decides from now on."""
        self.at(self.t, i.StepDown("the other was first"))
        return self

    def report(
        self, action: Action, outcome: Outcome, link: str = LINK, detail: str = "told"
    ) -> i.ActionReport:
        """A device node reports on the newest decision of this action."""
        decision = self.newest(action)
        return i.ActionReport(
            decision.epoch, decision.id, link, outcome, detail, newest_epoch=decision.epoch
        )

    # -- what was decided ------------------------------------------------------------------------

    def decisions(self, action: Action | None = None) -> list[Decision]:
        """Decisions in their order, each once."""
        return [
            output.decision
            for _, output in self.outputs
            if isinstance(output, i.Decide)
            and not output.again
            and action in (None, output.decision.action)
        ]

    def newest(self, action: Action) -> Decision:
        """The newest decision of this action."""
        return self.decisions(action)[-1]

    def when(self, action: Action) -> float:
        """When this action was first decided, t."""
        return next(
            t
            for t, output in self.outputs
            if isinstance(output, i.Decide) and output.decision.action is action
        )

    def answers(self, token: int) -> list[i.Finish]:
        """The answers to a request."""
        return [o for _, o in self.outputs if isinstance(o, i.Finish) and o.token == token]

    def answer(self, token: int) -> i.Finish:
        """The one answer to a request."""
        (answer,) = self.answers(token)
        return answer

    def text(self) -> str:
        """The sentence that is shown of its state now."""
        now = START + self.t
        reasons = block_reasons(self.config, self.state, now)
        return state_text(self.config, self.state, reasons, now)

    def alarms(self) -> list[str]:
        """What was said as an alarm."""
        return [o.text for _, o in self.outputs if isinstance(o, i.LogMessage) and o.alarm]
