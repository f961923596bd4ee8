"""The deploy as it goes on: it waits for the kill, climbs its ladder, ends with a confirmation."""

from __future__ import annotations

from chute_ros.model import Action, Outcome
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.gate import OPERATOR, too_low
from chute_ros.supervisor.machine import Stage, Stimulus, listed
from chute_ros.supervisor.policy import Policy
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.state import Pending, State


def step_deadline(config: SupervisorConfig, state: State, step: Pending) -> float:
    """When the newest step of the ladder is given up, monotonic s."""
    if len(state.deploys) >= len(state.ladder(config)):
        return step.decided_at + config.deploy_timeout
    return step.decided_at + config.ladder_step_timeout


def release_due(config: SupervisorConfig, state: State, now: float) -> float:
    """When a deploy that waits for its kill waits no longer, monotonic s. Sooner where the vehicle
    is low: lines above motors that may still turn are a risk, the ground that comes first is none.
    That it falls on unheard is assumed only where a rule that deploys has acted."""
    if state.kill is None:
        return state.deploy_due
    deploys = (one.name for one in config.profile.rules if one.action is Action.DEPLOY)
    falls = any(state.rule(name).latched for name in deploys)
    low = flight.low_at(config, state, falls, now)
    return min(state.deploy_due, max(low, state.kill.decided_at + config.low_kill_to_deploy_delay))


class Deploying(Policy):
    """What follows a deploy that was ordered."""

    def look_at_parachutes(self) -> None:
        """One that says that it is released ends every deploy, whoever fired it."""
        out = sorted(self.state.newly_released(self.config, self.now))
        if out and listed(self.state.stage, Stimulus.PARACHUTE_OPEN):
            said = f"{', '.join(map(' '.join, out))} says deployed"
            self.move(Stimulus.PARACHUTE_OPEN, said)

    def look_at_kill(self) -> None:
        """The deploy follows the kill's confirmation, or its delay."""
        kill = self.state.kill
        if kill is None:
            return
        self.end_kill()
        if self.state.stage is not Stage.KILLING or not self.state.deploy_rule:
            return
        if kill.confirmed or self.now >= release_due(self.config, self.state, self.now):
            low = too_low(self.config, self.state, self.now)
            if low and self.state.deploy_rule != OPERATOR:
                # It was high enough when the kill left; a canopy needs the height now.
                self.alarm(f"no deploy by rule '{self.state.deploy_rule}' after the kill: {low}")
                self.put_off(self.state.deploy_rule)
                # Nobody waits for it: a person's is held back by no height.
                self.state = replace(self.state, deploy_rule="", deploy_reasons=())
                return
            if kill.unreported():
                # A node that misses the kill must not see the deploy first: it would refuse the
                # kill as older from then on.
                self.send_again("kill")
            waited = self.now - kill.decided_at
            why = f"kill {'confirmed' if kill.confirmed else 'not confirmed'} after {waited:.2f} s"
            limit = self._limit(kill)
            self.move(Stimulus.DEPLOY_DUE, why)
            self._fire(f"{why} ({limit})")

    def _limit(self, kill: Pending) -> str:
        """For how long this deploy waits for its kill, in words."""
        config, height = self.config, self.state.measured("height")
        low = release_due(config, self.state, self.now) < self.state.deploy_due
        if kill.confirmed or not low:
            return f"limit {config.kill_to_deploy_delay:g} s"
        told = f"{height.value:.1f} m told {self.now - height.measured_at:.2f} s ago"
        limit = (
            f"limit {config.low_kill_to_deploy_delay:g} s below {config.profile.low_height:g} m"
        )
        return f"{limit}: {told}"

    def look_at_deploy(self) -> None:
        """Confirmed, one step further, or at the end of the ladder."""
        confirmed = self.deploy_reached(Outcome.CONFIRMED)
        # Also while somebody kills once more after the ladder's end.
        if confirmed and self.state.stage in (Stage.KILLING, Stage.DEPLOYING, Stage.FAULT):
            self.move(Stimulus.PARACHUTE_OPEN, self.deploy_details())
        elif self.state.stage is Stage.DEPLOYING and self.state.deploys:
            self._climb()
        elif self.state.stage is Stage.FAULT:
            self._try_again()
        self._answer()
        self._alarm_again()

    def _try_again(self) -> None:
        """As long as it is in the air, whoever could not be reached may be now. A device that has
        confirmed is not among them."""
        since = self.state.stage_since
        back = any(self.evidence(rung.link).regained_at > since for rung in self.ladder)
        over = back or self.now >= since + self.config.deploy_timeout
        if (
            over
            and self._still_in_air()
            and self.state.deploys
            and self.state.mode is i.Mode.ACTIVE
        ):
            rule = self.state.deploys[0].decision.rule
            if rule != OPERATOR and too_low(self.config, self.state, self.now):
                return
            waited = self.now - self.state.stage_since
            why = f"tried again {waited:.1f} s after the ladder's end: it is still in the air"
            self.order_deploy(rule, (why,))

    def _still_in_air(self) -> bool:
        """As the autopilot says; where it is silent, because it moves as nothing on the ground."""
        in_air = flight.in_air(self.config, self.state, self.now)
        moves = flight.moving(self.config, self.state, self.now)
        return bool(in_air or (in_air is None and self.state.airborne and moves))

    def _climb(self) -> None:
        """Step by step, each with its limit. One whose node is silent is sent, not awaited."""
        for _ in self.ladder:
            step = self.state.deploys[-1]
            text = step.newest_details() or "no device node reported"
            waited = self.now - step.decided_at
            last = len(self.state.deploys) >= len(self.ladder)
            silent = all(
                self.evidence(link).silent(self.config.limits(link).lost_after, self.now)
                for link in step.targets
            )
            over = step.all_failed() or self.now >= step_deadline(self.config, self.state, step)
            # What refuses may yet do it, and the next step need not wait for that.
            over |= not last and step.all_refused()
            if not over and (last or not silent):
                return
            if last:
                first = self.state.deploys[0].decided_at
                self.move(Stimulus.DEPLOY_FAILED, text)
                self.alarm(f"no parachute confirmed within {self.now - first:.1f} s: {text}")
                alarm_at = self.now + self.config.alarm_interval
                self.state = replace(self.state, alarm_at=alarm_at)
                return
            number = len(self.state.deploys)
            rung = self.ladder[number - 1]
            why = "its node is silent" if silent and not over else f"not confirmed: {text}"
            self._fire(f"step {number} of {len(self.ladder)}, {rung}: {why} ({waited:.2f} s)")

    def _fire(self, why: str) -> None:
        self.fire(Action.DEPLOY, self.state.deploy_rule, (*self.state.deploy_reasons, why))

    def _answer(self) -> None:
        accepted, text = self.deploy_reached(Outcome.ACCEPTED), self.deploy_details()
        out = self.state.stage is Stage.DEPLOYED
        text = text or ("its own status says deployed" if out else "no device node reported")
        kill = self.state.kill
        if kill is not None and not kill.confirmed:
            why = kill.newest_details() or "nobody reported"
            text = f"WARNING, the motors may still turn ({why}): {text}"
        if self.state.stage is Stage.FAULT:
            self.finish_deploy(False, accepted, text)
        elif self.state.stage is Stage.DEPLOYED:
            reported = not self.state.deploys or self.deploy_reached(Outcome.CONFIRMED)
            waited = self.now >= self.state.stage_since + self.config.report_wait
            if reported or waited or not self.state.deploy_tokens:
                self.finish_deploy(True, accepted, text)

    def _alarm_again(self) -> None:
        """The end of the ladder without a parachute is an alarm that does not stop until one is
        out or a person resets, whatever is tried meanwhile; so is a canopy that does not carry."""
        out = self.state.stage is Stage.DEPLOYED
        if (not out or self.state.canopy_fails) and self.now >= self.state.alarm_at:
            # A state that was handed over or read from a black box may know of no alarm.
            begin = "the canopy does not carry" if out else "still no parachute"
            text = ": ".join((begin, *self.state.alarms[-1:]))
            self.outputs.append(i.Say(text, alarm=True))
            alarm_at = self.now + self.config.alarm_interval
            self.state = replace(self.state, alarm_at=alarm_at)
