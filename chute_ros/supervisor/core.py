"""The supervisor's core: one function of (state, inputs, now) to (state, outputs).

It fuses the heartbeats of all links, blocks flight while a required one is not healthy, and
carries a person's arm, kill and deploy through to the devices: the kill first, then the deploy,
each until a device's own status confirms it. A fire command leaves only through Steps.fire.
"""

from __future__ import annotations

import math
from dataclasses import replace

from chute_ros.model import Action, LinkState, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage, Stimulus, listed
from chute_ros.supervisor.preflight import block_reasons
from chute_ros.supervisor.reports import Reports
from chute_ros.supervisor.requests import ON_GROUND
from chute_ros.supervisor.state import Pending, State
from chute_ros.supervisor.steps import SLOTS


def update(
    config: SupervisorConfig, state: State, inputs: tuple[i.Input, ...], now: float
) -> tuple[State, tuple[i.Output, ...]]:
    """Take in what came since the last call, look at the clock, and decide."""
    turn = _Update(config, state, now)
    for one in inputs:
        turn.take(one)
    turn.look()
    return turn.state, tuple(turn.outputs)


def next_deadline(config: SupervisorConfig, state: State, now: float) -> float:
    """When update has something to decide without any input, later than now; infinity: never."""
    deadlines = [
        evidence.heard + limit
        for evidence in state.links.values()
        for limit in (config.heartbeat.stale_after, config.heartbeat.lost_after)
    ]
    if state.stage in (Stage.STARTUP, Stage.READY, Stage.ARMED, Stage.LANDED):
        since = state.vehicle_received - state.vehicle.armed_age
        # Just after the limit, which still counts as young enough.
        deadlines.append(math.nextafter(since + config.vehicle_state_age, math.inf) + 1e-6)
    if state.stage is Stage.STARTUP:
        deadlines.append(state.started_at + config.startup_grace)
    if state.stage is Stage.DEPLOYED and state.deploy_tokens:
        deadlines.append(state.stage_since + config.report_wait)
    for pending in (state.block, state.kill, state.deploy):
        if pending is not None and pending.unreported():
            deadlines.append(pending.resend_at(config))
    if state.kill is not None:
        deadlines.append(state.kill.decided_at + config.kill_timeout)
    if state.stage is Stage.KILLING and state.deploy_reason:
        deadlines.append(state.deploy_due)
    if state.deploy is not None:
        deadlines.append(state.deploy.decided_at + config.deploy_timeout)
    return min((deadline for deadline in deadlines if deadline > now), default=math.inf)


class _Update(Reports):
    """One update."""

    def take(self, one: i.Input) -> None:
        """One input, in the order in which it came."""
        if isinstance(one, i.LinkHeartbeat):
            self.heartbeat(one)
        elif isinstance(one, i.ParachuteReport):
            self.parachute(one)
        elif isinstance(one, i.VehicleReport):
            self.state = replace(self.state, vehicle=one.state, vehicle_received=self.now)
        elif isinstance(one, i.ActionReport):
            self.action_report(one)
        elif isinstance(one, i.ArmRequest):
            self.arm_request(one)
        elif isinstance(one, i.ArmDone):
            self.arm_done(one)
        elif isinstance(one, i.KillRequest):
            self.kill_request(one)
        elif isinstance(one, i.BlockRequest):
            self.block_request(one)
        elif isinstance(one, i.DeployRequest):
            self.deploy_request(one)
        elif isinstance(one, i.ResetRequest):
            self.reset_request(one)
        else:
            self.mode_request(one)

    def look(self) -> None:
        """What follows from all that is known now."""
        self._look_at_vehicle()
        self._look_at_links()
        self._look_at_parachutes()
        self._look_at_kill()
        self._look_at_deploy()
        self._block_or_release()
        self._send_again()

    def _look_at_vehicle(self) -> None:
        in_air = self.state.in_air(self.config, self.now)
        stage = self.state.stage
        if in_air and listed(stage, Stimulus.TAKEN_OFF):
            if stage in (Stage.STARTUP, Stage.BLOCKED):
                self.alarm(f"in the air although {stage.name}")
            self.move(Stimulus.TAKEN_OFF)
            self.state = replace(self.state, flown=True)
        elif in_air is False and listed(stage, Stimulus.LANDED):
            self.move(Stimulus.LANDED)
        if self.state.stage is Stage.LANDED and self.state.disarmed(self.config, self.now):
            self.move(Stimulus.SECURED)
        if in_air is False and not self.state.flown and self.state.stage in ON_GROUND:
            self.note_released()

    def _look_at_links(self) -> None:
        reasons = block_reasons(self.config, self.state, self.now)
        grace = self.now < self.state.started_at + self.config.startup_grace
        if self.state.stage is Stage.STARTUP and reasons and grace:
            return
        stimulus = Stimulus.LINKS_UNHEALTHY if reasons else Stimulus.LINKS_HEALTHY
        if listed(self.state.stage, stimulus):
            self.move(stimulus, "; ".join(reasons))

    def _look_at_parachutes(self) -> None:
        said = self.state.released(self.config) - self.state.released_before
        out = sorted(one for one in said if self._fresh(one[0]))
        stage = self.state.stage
        if not out or not listed(stage, Stimulus.PARACHUTE_OPEN):
            return
        self.move(Stimulus.PARACHUTE_OPEN, f"{', '.join(map(' '.join, out))} says deployed")
        if stage is Stage.IN_FLIGHT:
            # Released by itself: motors that turn under an open canopy tear it.
            self.fire(Action.KILL, "parachute open", ("its own status says deployed",))

    def _fresh(self, link: str) -> bool:
        """What a link says counts now; what a lost one said last is not what it is."""
        evidence = self.evidence(link)
        return evidence.state(self.config, self.now) is LinkState.OK or link in self.told_released

    def _look_at_kill(self) -> None:
        kill = self.state.kill
        if kill is None:
            return
        self.end_kill()
        if self.state.stage is not Stage.KILLING or not self.state.deploy_reason:
            return
        if kill.confirmed or self.now >= self.state.deploy_due:
            if kill.unreported():
                # A node that misses the kill must not see the deploy first: it would refuse the
                # kill as older from then on.
                self.send_again("kill")
            waited = self.now - kill.decided_at
            why = f"kill {'confirmed' if kill.confirmed else 'not confirmed'} after {waited:.2f} s"
            limit = f"limit {self.config.kill_to_deploy_delay:g} s"
            self.move(Stimulus.DEPLOY_DUE, why)
            self.fire(Action.DEPLOY, "operator", (self.state.deploy_reason, f"{why} ({limit})"))

    def _look_at_deploy(self) -> None:
        deploy = self.state.deploy
        if self.state.stage is Stage.DEPLOYING and deploy is not None:
            waited = self.now - deploy.decided_at
            if deploy.confirmed:
                self.move(Stimulus.PARACHUTE_OPEN, deploy.details[-1])
            elif deploy.all_failed() or self.now >= deploy.decided_at + self.config.deploy_timeout:
                text = deploy.newest_details() or "no device node reported"
                self.move(Stimulus.DEPLOY_FAILED, text)
                self.alarm(f"no parachute confirmed within {waited:.1f} s: {text}")
        accepted = deploy is not None and deploy.reached(Outcome.ACCEPTED)
        text = deploy.newest_details() if deploy is not None else ""
        if self.state.stage is Stage.FAULT:
            self.finish_deploy(False, accepted, text or "no device node reported")
        elif self.state.stage is Stage.DEPLOYED and self.state.deploy_tokens:
            reported = deploy is None or deploy.confirmed
            if reported or self.now >= self.state.stage_since + self.config.report_wait:
                self.finish_deploy(True, accepted, text or "its own status says deployed")

    def _block_or_release(self) -> None:
        """Flight is blocked on the ground until READY, and after a deploy until a reset."""
        if self.state.mode is i.Mode.INHIBITED:
            return
        if self.state.stage in (Stage.READY, Stage.ARMED):
            action = Action.FLIGHT_BLOCK_RELEASE
            reasons: tuple[str, ...] = ("every required link is healthy",)
        elif self.state.stage in (Stage.STARTUP, Stage.BLOCKED, Stage.DEPLOYED, Stage.FAULT):
            action = Action.FLIGHT_BLOCK
            reasons = block_reasons(self.config, self.state, self.now) or ("starting",)
        elif self.state.stage is Stage.IN_FLIGHT:
            action, reasons = Action.FLIGHT_BLOCK_RELEASE, ("in the air",)
        else:
            return
        block = self.state.block
        if self.state.mode is i.Mode.SHADOW and block is not None and not block.decision.shadow:
            # Leaving ACTIVE took the block back; that must arrive before anything is only said.
            if self._worth_sending(block):
                return
            block = None
        if block is None or block.decision.action is not action:
            self.decide("block", action, "links", reasons, self.config.links)

    def _send_again(self) -> None:
        for slot in SLOTS:
            pending = self.pending(slot)
            if pending is None or pending.decision.shadow or not self._worth_sending(pending):
                continue
            if self.now >= pending.resend_at(self.config):
                self.send_again(slot)

    def _worth_sending(self, pending: Pending) -> bool:
        """Somebody has not reported: a node that is alive, or any while it can still help."""
        action = pending.decision.action
        if action is Action.DEPLOY:
            # It ends with the stage, by its limit or because a parachute is out.
            return self.state.stage is Stage.DEPLOYING and bool(pending.unreported())
        if action is Action.KILL:
            limit = max(self.config.kill_timeout, self.config.deploy_timeout)
            return self.now < pending.decided_at + limit and bool(pending.unreported())
        lost_after = self.config.heartbeat.lost_after
        return any(
            not self.evidence(link).silent(lost_after, self.now) for link in pending.unreported()
        )
