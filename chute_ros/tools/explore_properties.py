"""What must hold at every update of the supervisor's core, whatever came before.

The checks look at what the vehicle was told to be, at what was reported and at what came out; of
the core's own state they use the stage and little else.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from chute_ros.model import Action, Armed, Decision, LandedState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import ON_GROUND, Stage
from chute_ros.supervisor.state import State

_EPSILON = 1e-6
#: By name: what must hold.
PROPERTIES = {
    "raises": "an update never raises",
    "kill first": "a deploy leaves only after a kill that was decided since the start, the reset "
    "or the take-off",
    "delay": "the first step of a deploy leaves only once that kill is confirmed, or "
    "kill_to_deploy_delay after it, or low_kill_to_deploy_delay where the vehicle may be low",
    "ground": "no rule deploys from a stage on the ground, nor a vehicle that says undisputedly "
    "that it stands or is disarmed, unless it does so since a kill in flight, or says disarmed "
    "since its autopilot restarted in flight",
    "silence": "no rule deploys unless a sign of a fall came within the last second, or a kill "
    "was decided in flight, so high and so short a time ago that it is not down yet, or is "
    "confirmed: silence and lost links alone never do",
    "at once": "a rule that is fulfilled in flight and not denied kills in the same update, and "
    "it is denied only where the vehicle stands, is disarmed or is too low",
    "confirmed": "no deploy leaves after one was confirmed, until a person forces another",
    "deployed": "only a reset, a deploy that a person forces, or a parachute that nobody ordered "
    "out and that says in the air that it is not, leaves DEPLOYED",
    "stays out": "in DEPLOYED no deploy leaves, and flight is released only by leaving ACTIVE",
    "shadow": "in SHADOW nothing leaves but what is marked shadow, and the taking back of a "
    "flight block",
    "inhibited": "in INHIBITED nothing leaves but the taking back of a flight block",
    "one answer": "a request is answered at most once, and only if it was asked",
    "numbers": "the numbers of decisions rise",
}


class ViolationError(Exception):
    """A property does not hold."""

    def __init__(self, name: str, what: str) -> None:
        super().__init__(f"{PROPERTIES[name]}: {what}")
        self.name = name


@dataclass(frozen=True)
class StoryMemory:
    """What the properties remember of a story. Times: monotonic s; NaN: has not happened."""

    kill: Decision | None = None
    killed_at: float = math.nan
    #: Its numbers, with those under which it was decided again.
    kill_numbers: frozenset[tuple[int, int]] = frozenset()
    kill_confirmed: bool = False
    #: It was decided of a vehicle that stood, or was disarmed, already.
    kill_standing: bool = False
    #: In flight, at this height, m, sinking so fast, m/s; NaN: it was not, or was not told.
    kill_height: float = math.nan
    kill_sinking: float = math.nan
    #: When that was.
    first_killed_at: float = math.nan
    deploy_numbers: frozenset[tuple[int, int]] = frozenset()
    deploy_confirmed: bool = False
    newest: tuple[int, int] = (0, 0)

    def height_left(self, now: float) -> float:
        """At least so many m are left of its height since the kill; NaN: not known."""
        passed = now - self.first_killed_at
        return self.kill_height - self.kill_sinking * passed - 9.81 / 2.0 * passed**2


class Update(NamedTuple):
    """One update of the core: the states around it, what came, what came out, monotonic s."""

    before: State
    after: State
    inputs: tuple[i.Input, ...]
    outputs: tuple[i.Output, ...]
    now: float

    @property
    def decides(self) -> list[i.Decide]:
        """The decisions that came out."""
        return [one for one in self.outputs if isinstance(one, i.Decide)]


@dataclass
class Properties:
    """Checks every update; exercised: how often each property had something to say."""

    config: SupervisorConfig
    exercised: Counter[str] = field(default_factory=Counter)

    def check(self, memory: StoryMemory, update: Update) -> StoryMemory:
        """The memory after the update; ViolationError: a property does not hold."""
        before, after, inputs = update.before, update.after, update.inputs
        self.exercised["raises"] += 1
        memory = self._reported(memory, inputs)
        if any(isinstance(one, i.VehicleReport) for one in inputs):
            memory = self._told_after_kill(memory, after, update.now)
        reset = after.started_at != before.started_at
        took_off = after.stage is Stage.IN_FLIGHT and before.stage is not Stage.IN_FLIGHT
        if reset or took_off:
            memory = StoryMemory(newest=memory.newest)
        forced = any(isinstance(one, i.DeployRequest) and one.force for one in inputs)
        if forced:
            memory = replace(memory, deploy_confirmed=False)
        if before.stage is Stage.DEPLOYED:
            kept = after.stage is Stage.DEPLOYED or reset or forced
            kept = kept or self._taken_back(memory, update)
            self._expect("deployed", kept, f"DEPLOYED became {after.stage.name}")
        self._answers(update)
        self._orders(memory, update)
        if after.stage is Stage.IN_FLIGHT or before.stage is Stage.IN_FLIGHT:
            self._at_once(update)
        for output in update.decides:
            self._mode(update, output)
            memory = self._decision(memory, update, output)
        return memory

    def _taken_back(self, memory: StoryMemory, update: Update) -> bool:
        told = [one for one in update.inputs if isinstance(one, i.ParachuteReport)]
        said = not all(one.status.deployed for one in told) and not memory.deploy_numbers
        return said and update.before.flight.airborne and update.after.stage is Stage.IN_FLIGHT

    def _expect(self, name: str, holds: bool, what: str) -> None:
        self.exercised[name] += 1
        if not holds:
            raise ViolationError(name, what)

    def _reported(self, memory: StoryMemory, inputs: tuple[i.Input, ...]) -> StoryMemory:
        for one in inputs:
            if isinstance(one, i.ActionReport) and one.outcome is Outcome.CONFIRMED:
                number = (one.epoch, one.id)
                if number in memory.kill_numbers:
                    memory = replace(memory, kill_confirmed=True)
                if number in memory.deploy_numbers:
                    memory = replace(memory, deploy_confirmed=True)
        return memory

    def _told_after_kill(self, memory: StoryMemory, after: State, now: float) -> StoryMemory:
        """Who was not heard as it was killed may tell its height in the second after it."""
        if not now <= memory.first_killed_at + 1.0 or math.isnan(memory.kill_height):
            return memory
        told = after.heard.vehicle
        if not told.height > memory.kill_height:
            return memory
        return replace(
            memory, kill_height=told.height, kill_sinking=max(-told.vertical_speed, 0.0)
        )

    def _answers(self, update: Update) -> None:
        before, after = update.before.own, update.after.own
        waiting = [*before.kill_tokens, *before.deploy_tokens]
        waiting += [token for one in update.inputs if (token := getattr(one, "token", 0))]
        for output in update.outputs:
            if isinstance(output, i.Finish):
                self._expect("one answer", output.token in waiting, f"request {output.token}")
                waiting.remove(output.token)
        left = [*after.kill_tokens, *after.deploy_tokens]
        self._expect("one answer", set(left) <= set(waiting), f"{left} wait of {waiting}")

    def _orders(self, memory: StoryMemory, update: Update) -> None:
        """A rule wants a deploy: it was ordered in this update, or in SHADOW said."""
        before, after, now = update.before, update.after, update.now
        rules = {rule.name for rule in self.config.profile.rules}
        rule = after.deploying.deploy_rule
        ordered = rule in rules and before.deploying.deploy_rule != rule
        shadowed = [one.decision for one in update.decides if one.decision.shadow]
        said = any(one.action is Action.DEPLOY and one.rule in rules for one in shadowed)
        # Motors that were off before the kill are not its effect.
        killed = before.stage is Stage.KILLING and before.killing.killed_in_flight
        killed = killed and not memory.kill_standing
        stands = self._stands(after, now) and not killed
        falls = self._sign_of_a_fall(after, now)
        if ordered or said:
            told = f"rule {after.deploying.deploy_rule!r} from {before.stage.name}"
            # One that has just taken off is told to be in the air in this very update.
            ground = before.stage in ON_GROUND and not self._says_in_air(after)
            self._expect("ground", not ground and not stands, told)
            aloft = memory.height_left(now) + _EPSILON >= self.config.profile.minimum_height
            kill = before.killing.kill
            stopped = before.stage is Stage.KILLING and kill is not None and kill.confirmed
            stopped |= after.killing.kill is not None and after.killing.kill.confirmed
            self._expect("silence", falls or aloft or (stopped and killed), told)
        elif stands and falls:
            self.exercised["ground"] += 1
        elif before.flight.airborne and not falls and now - after.heard.vehicle_received > 1.0:
            self.exercised["silence"] += 1

    def _at_once(self, update: Update) -> None:
        before, after = update.before, update.after
        if after.mode is not i.Mode.ACTIVE or before.mode is not i.Mode.ACTIVE:
            return
        if before.stage is Stage.IN_FLIGHT and after.stage is Stage.KILLING:
            actions = [one.decision.action for one in update.decides]
            self._expect("at once", Action.KILL in actions, "KILLING without a kill")
        if after.stage is not Stage.IN_FLIGHT:
            return
        for rule in self.config.profile.rules:
            evidence = after.rule(rule.name)
            if rule.action is Action.NONE or not evidence.fulfilled(rule):
                continue
            if rule.action is Action.KILL and evidence.latched:
                continue  # it was acted on before the vehicle took off
            fine = self._stands(after, update.now)
            fine = fine or not self._sign_of_a_fall(after, update.now)
            self._expect("at once", fine, f"{rule.name!r} is fulfilled, denied {evidence.denied}")

    def _mode(self, update: Update, output: i.Decide) -> None:
        takes_back = output.decision.rule == "mode"
        mode = update.after.mode
        if update.before.mode is not mode:
            return
        if mode is i.Mode.SHADOW:
            fine = output.decision.shadow or takes_back
            self._expect("shadow", fine, output.decision.action.name)
        elif mode is i.Mode.INHIBITED:
            self._expect("inhibited", takes_back, output.decision.action.name)

    def _decision(self, memory: StoryMemory, update: Update, output: i.Decide) -> StoryMemory:
        decision = output.decision
        number = (decision.epoch, decision.id)
        if not output.again:
            self._expect("numbers", number > memory.newest, f"{number}, {memory.newest}")
            memory = replace(memory, newest=number)
        if update.before.stage is update.after.stage is Stage.DEPLOYED:
            released = decision.action is Action.FLIGHT_BLOCK_RELEASE and decision.rule != "mode"
            wrong = released or decision.action is Action.DEPLOY
            self._expect("stays out", not wrong or decision.shadow, decision.action.name)
        if decision.shadow:
            return memory
        if decision.action is Action.KILL and not output.again:
            return self._killed(memory, update, decision)
        if decision.action is Action.DEPLOY:
            self._expect("kill first", memory.kill is not None, decision.rule)
            if not memory.deploy_numbers:
                waited = update.now - memory.killed_at + _EPSILON
                delays = [self.config.kill_to_deploy_delay]
                low = self._low(update.after, update.now)
                delays += [self.config.low_kill_to_deploy_delay] if low else []
                fine = memory.kill_confirmed or waited >= min(delays)
                self._expect("delay", fine, f"{waited:.2f} s after the kill")
            self._expect("confirmed", not memory.deploy_confirmed, str(decision.targets))
            numbers = memory.deploy_numbers | {number}
            return replace(memory, deploy_numbers=numbers)
        return memory

    def _killed(self, memory: StoryMemory, update: Update, decision: Decision) -> StoryMemory:
        before, after, now = update.before, update.after, update.now
        number, known = (decision.epoch, decision.id), memory.kill
        again = (
            known is not None
            and decision.rule == known.rule
            and decision.reasons[: len(known.reasons)] == known.reasons
        )
        if again or before.deploying.deploy_rule:
            # The delay goes on counting from the first.
            return replace(memory, kill_numbers=memory.kill_numbers | {number})
        told, stands = after.heard.vehicle, self._stands(after, now)
        new = replace(
            memory,
            kill=decision,
            killed_at=now,
            kill_numbers=frozenset({number}),
            kill_confirmed=False,
            kill_standing=False,
            deploy_numbers=frozenset(),
        )
        if before.stage is Stage.KILLING:
            return new
        return replace(
            new,
            kill_standing=stands,
            kill_height=told.height if after.flight.airborne and not stands else math.nan,
            kill_sinking=max(-told.vertical_speed, 0.0),
            first_killed_at=now,
        )

    def _low(self, state: State, now: float) -> bool:
        """By the height that was taken last, and a fall since then."""
        height, speed = state.measured("height"), state.measured("vertical_speed").value
        passed = max(now - height.measured_at, 0.0)
        sinking = 0.0 if math.isnan(speed) else max(-speed, 0.0)
        fallen = sinking * passed + 9.81 / 2.0 * passed**2
        lowest = min(height.value, height.before_jump)
        low = self.config.profile.low_height + _EPSILON
        return state.flight.airborne and lowest - fallen < low

    def _stands(self, state: State, now: float) -> bool:
        """What was told last says that it stands or is disarmed, and no number contradicts."""
        told = state.heard.vehicle
        if not now - state.heard.vehicle_received <= self.config.vehicle_state_age:
            return False
        moves = abs(told.vertical_speed) > self.config.profile.moving_speed
        moves = moves or told.acceleration < 4.9
        # An autopilot that started anew in the air says disarmed, whatever the motors do.
        rebooted = state.flight.airborne and state.flight.rebooted
        off = told.armed is Armed.DISARMED and not rebooted
        down = told.landed_state is LandedState.ON_GROUND or off
        return down and not moves

    def _says_in_air(self, state: State) -> bool:
        return state.heard.vehicle.landed_state is LandedState.IN_AIR

    def _sign_of_a_fall(self, state: State, now: float) -> bool:
        told = state.heard.vehicle
        if not now - state.heard.vehicle_received <= 1.0 + _EPSILON:
            return False
        falls = told.vertical_speed < -5.0 or told.acceleration < 4.0
        return falls or told.tilt > math.radians(45.0)
