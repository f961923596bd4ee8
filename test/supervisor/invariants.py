"""What must hold whatever the configuration and the inputs; each update is watched for it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from story import LINK, START

from chute_ros.model import Action, Armed, LandedState, Outcome, VehicleState
from chute_ros.supervisor import flight, readings
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.rules import BelowMinimum
from chute_ros.supervisor.state import State
from chute_ros.supervisor.wakes import next_deadline

K, D = Action.KILL, Action.DEPLOY
#: A reason that begins so tells only of silence, or of how far the deploy has got.
_SILENCE = ("link ", "autopilot link", "counter ", "kill ", "step ")
#: What a moving vehicle told may be believed for so long, s: the age of a sample and its way.
_MOVED_LATELY = 1.2


class Watch:
    """Feeds a core and raises where something that must hold does not."""

    def __init__(self, config: SupervisorConfig, state: State | None = None) -> None:
        self.config = config
        self.state = state or State(epoch=7, started_at=START)
        self.now = START
        self.outputs: tuple[i.Output, ...] = ()
        self.moved_at = -math.inf
        self.killed_at = math.nan
        #: The motors were off once since then.
        self.stopped = False
        self.forced = False

    def copy(self) -> Watch:
        """One that goes on from here another way."""
        other = Watch(self.config, self.state)
        other.__dict__.update(self.__dict__)
        return other

    def wait(self, seconds: float) -> None:
        """Time passes; the core is woken at each deadline, as its node does."""
        end = self.now + seconds
        while (wake := next_deadline(self.config, self.state, self.now)) < end:
            self.now = wake
            self.feed()
        self.now = end

    def restart(self) -> None:
        """The supervisor begins anew with nothing but a higher epoch."""
        self.state = State(epoch=self.state.epoch + 4, started_at=self.now, mode=self.state.mode)
        self.killed_at = math.nan
        self.stopped = False
        self.forced = False

    def _looks_at_all_that_changes(self, before: State, inputs: tuple[i.Input, ...]) -> None:
        """A rule that is not looked at, as nothing has changed, would be what it was. Where the
        vehicle tells something, or time alone may have changed it, each is looked at anyhow."""
        told = any(isinstance(one, i.VehicleReport) for one in inputs)
        if told or self.now >= before.own.vehicle_rests_until:
            return
        looked_at = replace(before, own=replace(before.own, vehicle_rests_until=-math.inf))
        state, outputs = update(self.config, looked_at, inputs, self.now)
        until = state.own.vehicle_rests_until
        same = replace(self.state, own=replace(self.state.own, vehicle_rests_until=until))
        assert (repr(same), repr(outputs)) == (repr(state), repr(self.outputs))

    def feed(self, *inputs: i.Input) -> tuple[i.Output, ...]:
        """One update, watched."""
        before = self.state
        for one in inputs:
            if isinstance(one, i.VehicleReport):
                self._note(one.state)
            if isinstance(one, i.DeployRequest):
                self.forced |= one.force
        self.state, self.outputs = update(self.config, before, inputs, self.now)
        self._looks_at_all_that_changes(before, inputs)
        new = [
            output.decision
            for output in self.outputs
            if isinstance(output, i.Decide) and not output.decision.shadow
        ]
        done = [decision.action for decision in new]
        if before.mode is not i.Mode.ACTIVE and self.state.mode is not i.Mode.ACTIVE:
            assert not {K, D} & set(done), "in another mode nothing is sent"
        going_on = before.stage in (Stage.KILLING, Stage.DEPLOYING)
        if K in done and (math.isnan(self.killed_at) or not going_on):
            self.killed_at, self.stopped = self.now, False
        kill = self.state.killing.kill
        # One that is repeated was confirmed under its first number.
        self.stopped |= kill is not None and kill.confirmed
        ordered = self.state.deploying.deploy_rule and not before.deploying.deploy_rule
        self._kill_first(before, done)
        self._confirmed_is_not_told_again(before, inputs, done)
        self._released_stays_released(before, inputs, done)
        self._no_delay(before, inputs, done)
        if ordered and self.state.deploying.deploy_rule != "operator":
            self._rule_may_deploy(before)
        return self.outputs

    def _note(self, told: VehicleState) -> None:
        fast = abs(told.vertical_speed) > self.config.profile.moving_speed
        if fast or told.acceleration < flight.FREE_FALL:
            self.moved_at = self.now

    def _kill_first(self, before: State, done: list[Action]) -> None:
        """Every deploy is preceded by a kill, and waits for its confirmation or the delay."""
        if D in done:
            assert not math.isnan(self.killed_at), "a deploy without a kill before it"
            if K in done and before.stage is not Stage.DEPLOYING:
                assert done.index(K) < done.index(D)
            kill = self.state.killing.kill
            assert kill is not None
            waited = self.now - self.killed_at + 1e-9
            delays = [self.config.kill_to_deploy_delay]
            delays += [self.config.low_kill_to_deploy_delay] if self._may_be_low() else []
            assert kill.confirmed or self.stopped or waited >= min(delays)

    def _may_be_low(self) -> bool:
        height, speed = self.state.measured("height"), self.state.measured("vertical_speed").value
        passed = max(self.now - height.measured_at, 0.0)
        sinking = 0.0 if math.isnan(speed) else max(-speed, 0.0)
        lowest = min(height.value, height.before_jump)
        left = lowest - sinking * passed - 9.81 / 2.0 * passed**2
        return self.state.flight.airborne and left < self.config.profile.low_height + 1e-6

    def _confirmed_is_not_told_again(
        self, before: State, inputs: Sequence[i.Input], done: list[Action]
    ) -> None:
        """The same deploy is never sent twice to a device that confirmed."""
        if any(isinstance(one, (i.ResetRequest, i.ModeRequest)) for one in inputs):
            return
        # A report is judged before what follows it; what confirmed is out from then on.
        confirmed = any(deploy.confirmed for deploy in before.deploying.deploys)
        assert not (confirmed and D in done), "told again although one has confirmed"
        after = any(deploy.confirmed for deploy in self.state.deploying.deploys)
        assert not (after and D in done), "told in the update that heard the confirmation"

    def _released_stays_released(
        self, before: State, inputs: Sequence[i.Input], done: list[Action]
    ) -> None:
        """Only a reset leads back from a released parachute, whoever restarts; or its own word,
        where nobody had ordered it."""
        insists = any(isinstance(one, i.DeployRequest) and one.force for one in inputs)
        reset = any(isinstance(one, i.ResetRequest) for one in inputs)
        told = [one.status for one in inputs if isinstance(one, i.ParachuteReport)]
        takes_back = not before.deploying.deploys and any(not status.deployed for status in told)
        rules = [one for one in self.config.profile.rules if Stage.DEPLOYED in one.states]
        fails = any(one.action is D and self.state.rule(one.name).latched for one in rules)
        if before.stage is Stage.DEPLOYED and not (reset or insists or takes_back or fails):
            assert D not in done
            assert self.state.stage is Stage.DEPLOYED

    def _no_delay(self, before: State, inputs: Sequence[i.Input], done: list[Action]) -> None:
        """What is fulfilled in flight kills within this update; what is due leaves within it."""
        after = self.state
        if after.mode is not i.Mode.ACTIVE or not after.own.leading:
            return
        if (
            after.stage is Stage.KILLING
            and after.deploying.deploy_rule
            and after.killing.kill is not None
        ):
            assert not after.killing.kill.confirmed, "confirmed, and the deploy has not left"
            assert self.now < after.deploying.deploy_due, "due, and the deploy has not left"
        changed = any(isinstance(one, i.ModeRequest) for one in inputs)
        for rule in self.config.profile.rules:
            evidence = after.rule(rule.name)
            if rule.action < K or after.stage not in rule.states:
                continue
            if after.stage is Stage.IN_FLIGHT and evidence.fulfilled(rule) and not changed:
                assert evidence.latched or evidence.denied, "fulfilled, and nothing follows"
            newly = evidence.latched and not before.rule(rule.name).latched
            if newly and before.stage is Stage.IN_FLIGHT:
                kill = before.killing.kill
                under_way = kill is not None and not kill.confirmed and not kill.given_up
                assert K in done or under_way, "acted on, and no kill has left"

    def _rule_may_deploy(self, before: State) -> None:
        """Not on silence alone, not on the ground, not disarmed, not too low."""
        state, now = self.state, self.now
        told = state.deploying.deploy_reasons
        assert any(not reason.startswith(_SILENCE) for reason in told), "silence alone deploys"
        profile = self.config.profile
        height = readings.measured(self.config, state, "height", now)
        if profile.below_minimum is not BelowMinimum.DEPLOY:
            assert not height < profile.minimum_height, "below the minimum height"
        assert before.flight.airborne or state.flight.airborne, (
            "a rule deploys what is not in flight"
        )
        if before.stage is Stage.KILLING and before.killing.killed_in_flight:
            return  # our own kill has switched the motors off
        if self.now - self.moved_at <= _MOVED_LATELY:
            return  # what says otherwise is contradicted
        vehicle = state.heard.vehicle
        silence = now - state.heard.vehicle_received
        limit = self.config.vehicle_state_age - 1e-9
        landed_is_fresh = max(vehicle.landed_state_age, 0.0) + silence < limit
        if landed_is_fresh:
            assert vehicle.landed_state is not LandedState.ON_GROUND, "deployed on the ground"
        if max(vehicle.armed_age, 0.0) + silence < limit and not state.flight.rebooted:
            assert vehicle.armed is not Armed.DISARMED, "deployed although disarmed"


def reports_of(watch: Watch, action: Action, outcome: Outcome, link: str = LINK) -> list[i.Input]:
    """What a node reports on the newest decision of this action, if there is one."""
    pending = watch.state.killing.kill if action is K else watch.state.deploy
    if pending is None:
        return []
    number = pending.decision.epoch, pending.decision.id
    return [i.ActionReport(*number, link, outcome, outcome.name, number[0], number[1])]
