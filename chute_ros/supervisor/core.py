"""The supervisor's core: one function of (state, inputs, now) to (state, outputs).

It fuses the heartbeats of all links, blocks flight while a required one is not healthy, and carries
a person's arm, kill and deploy through to the devices: the kill first, then the deploy, each until
a device's own status confirms it. A fire command leaves only through _fire.
"""

from __future__ import annotations

import math
from dataclasses import replace

from chute_ros.model import Action, Decision, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage, Stimulus, listed, next_stage
from chute_ros.supervisor.preflight import block_reasons
from chute_ros.supervisor.state import LinkEvidence, Pending, State, frozen

_ON_GROUND = (Stage.STARTUP, Stage.BLOCKED, Stage.READY, Stage.ARMED)


def update(
    config: SupervisorConfig, state: State, inputs: tuple[i.Input, ...], now: float
) -> tuple[State, tuple[i.Output, ...]]:
    """Take in what came since the last call, look at the clock, and decide."""
    turn = _Turn(config, state, now)
    for one in inputs:
        turn.take(one)
    turn.look()
    return turn.state, tuple(turn.outputs)


def next_deadline(config: SupervisorConfig, state: State, now: float) -> float:
    """When update has something to decide without any input; infinity: never."""
    deadlines = []
    for evidence in state.links.values():
        for limit in (config.heartbeat.stale_after, config.heartbeat.lost_after):
            deadlines.append(evidence.heard + limit)
    if state.stage is Stage.STARTUP:
        deadlines.append(state.started_at + config.startup_grace)
    for pending in (state.block, state.kill, state.deploy):
        if pending is not None and pending.unreported():
            deadlines.append(pending.sent_at + config.resend_interval)
    if state.kill is not None:
        deadlines.append(state.kill.decided_at + config.kill_to_deploy_delay)
        deadlines.append(state.kill.decided_at + config.kill_timeout)
    if state.deploy is not None:
        deadlines.append(state.deploy.decided_at + config.deploy_timeout)
    return min((d for d in deadlines if d > now), default=math.inf)


class _Turn:
    """One update: works on state step by step and collects what is to be done."""

    def __init__(self, config: SupervisorConfig, state: State, now: float) -> None:
        self.config, self.state, self.now = config, state, now
        self.outputs: list[i.Output] = []

    # -- inputs --------------------------------------------------------------------------------

    def take(self, one: i.Input) -> None:
        """One input, in the order in which it came."""
        if isinstance(one, i.LinkHeartbeat):
            self._heartbeat(one)
        elif isinstance(one, i.ParachuteReport):
            evidence = self._evidence(one.link)
            self._set_link(one.link, replace(evidence, deployed=one.deployed, faults=one.faults))
        elif isinstance(one, i.VehicleReport):
            self.state = replace(self.state, vehicle=one.state, vehicle_received=self.now)
        elif isinstance(one, i.ActionReport):
            self._action_report(one)
        elif isinstance(one, i.ArmRequest):
            self._arm_request(one)
        elif isinstance(one, i.ArmDone):
            self._arm_done(one)
        elif isinstance(one, i.KillRequest):
            self._kill_request(one)
        elif isinstance(one, i.DeployRequest):
            self._deploy_request(one)
        elif isinstance(one, i.ResetRequest):
            self._reset_request(one)
        else:
            self._mode_request(one)

    def _heartbeat(self, one: i.LinkHeartbeat) -> None:
        if one.link not in self.config.links:
            return
        evidence = self._evidence(one.link)
        restarted = one.seq < evidence.seq and not math.isnan(evidence.heard)
        evidence = replace(
            evidence,
            heard=self.now,
            reported=one.link_state,
            device_healthy=one.device_healthy,
            seq=one.seq,
        )
        self._set_link(one.link, evidence)
        if restarted:
            self._renew(f"{one.link} restarted")

    def _action_report(self, one: i.ActionReport) -> None:
        if one.newest_epoch > self.state.epoch:
            epoch = one.newest_epoch + 1
            self.outputs.append(
                i.Say(f"{one.link} has seen epoch {one.newest_epoch}: going on as {epoch}")
            )
            self.state = replace(self.state, epoch=epoch)
            self._renew(f"{one.link} knows a newer epoch")
            return
        for name in ("block", "kill", "deploy"):
            pending: Pending | None = getattr(self.state, name)
            if pending is None or (one.epoch, one.id) != (
                pending.decision.epoch,
                pending.decision.id,
            ):
                continue
            reached = dict(pending.reached)
            reached[one.link] = max(one.outcome, reached.get(one.link, Outcome.NONE))
            details = (*pending.details, f"{one.link}: {one.detail}")
            pending = replace(pending, reached=frozen(reached), details=details)
            self.state = replace(self.state, **{name: pending})

    def _arm_request(self, one: i.ArmRequest) -> None:
        stage = self.state.stage
        if one.arm:
            wrong = list(block_reasons(self.config, self.state, self.now))
            if stage not in (Stage.READY, Stage.ARMED):
                wrong.append(f"the vehicle is {stage.name} (need READY)")
        else:
            wrong = []
            if stage not in _ON_GROUND + (Stage.LANDED,):
                wrong.append(f"the vehicle is {stage.name}: not disarmed in flight")
        if wrong:
            self._finish(one.token, False, False, "refused: " + "; ".join(wrong))
            return
        links = self.config.deploy_links
        self.outputs.append(i.ArmDevices(one.token, one.arm, one.triggers, links))

    def _arm_done(self, one: i.ArmDone) -> None:
        if one.success:
            stimulus = Stimulus.ARMED if one.arm else Stimulus.DISARMED
            if listed(self.state.stage, stimulus):
                self._move(stimulus)
        self._finish(one.token, one.success, one.success, one.message)

    def _kill_request(self, one: i.KillRequest) -> None:
        if self.state.mode is not i.Mode.ACTIVE:
            self._only_said(one.token, Action.KILL, one.reason)
        elif not listed(self.state.stage, Stimulus.KILL):
            text = f"refused: the vehicle is {self.state.stage.name}, the kill was already given"
            self._finish(one.token, False, False, text)
        elif one.token == 0 and self.state.in_air(self.config, self.now) is None:
            # A device's word alone does not stop motors that may hold a vehicle in the air.
            self.outputs.append(
                i.Say(f"{one.by} asks for a kill; vehicle/state does not say where it is", True)
            )
            self._fire_kill(f"{one.by}: {one.reason}")
        else:
            self.state = replace(self.state, kill_token=one.token)
            self._fire_kill(f"{one.by}: {one.reason}")

    def _deploy_request(self, one: i.DeployRequest) -> None:
        state, stage = self.state, self.state.stage
        wrong = ""
        if stage is Stage.DEPLOYED:
            wrong = "a parachute is out already"
        elif state.deploy_token or stage is Stage.DEPLOYING:
            wrong = "a deploy is under way"
        elif stage not in (Stage.IN_FLIGHT, Stage.KILLING, Stage.FAULT) and not one.force:
            wrong = f"the vehicle is {stage.name}, not in flight; force deploys all the same"
        if state.mode is not i.Mode.ACTIVE and not wrong:
            self._only_said(one.token, Action.DEPLOY, one.reason)
        elif wrong:
            self._finish(one.token, False, False, "refused: " + wrong)
        else:
            reason = f"operator{', forced' if one.force else ''}: {one.reason or 'no reason given'}"
            self.state = replace(state, deploy_token=one.token, deploy_reason=reason)
            if stage is not Stage.KILLING:
                self._fire_kill(reason)

    def _reset_request(self, one: i.ResetRequest) -> None:
        in_air = self.state.in_air(self.config, self.now)
        if in_air or self.state.stage is Stage.IN_FLIGHT:
            self._finish(one.token, False, False, "refused: the vehicle is in the air")
        elif not listed(self.state.stage, Stimulus.RESET):
            text = f"refused: the vehicle is {self.state.stage.name}"
            self._finish(one.token, False, False, text)
        else:
            self._answer_waiting("reset by a person")
            self._move(Stimulus.RESET)
            self.state = replace(
                self.state,
                started_at=self.now,
                block=None,
                kill=None,
                deploy=None,
                deploy_reason="",
                alarms=(),
            )
            self._finish(one.token, True, True, "back to the start")

    def _mode_request(self, one: i.ModeRequest) -> None:
        flying = self.state.stage not in _ON_GROUND + (Stage.LANDED,)
        if flying and not one.force and one.mode is not self.state.mode:
            text = f"refused: the vehicle is {self.state.stage.name}; force changes it all the same"
            self._finish(one.token, False, False, text)
            return
        self.state = replace(self.state, mode=one.mode)
        self._finish(one.token, True, True, f"mode {one.mode.name}")

    # -- the clock and the whole picture -----------------------------------------------------------

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
        if in_air and listed(self.state.stage, Stimulus.TAKEN_OFF):
            if self.state.stage in (Stage.STARTUP, Stage.BLOCKED):
                self._alarm(f"in the air although {self.state.stage.name}")
            self._move(Stimulus.TAKEN_OFF)
        elif in_air is False and listed(self.state.stage, Stimulus.LANDED):
            self._move(Stimulus.LANDED)

    def _look_at_links(self) -> None:
        reasons = block_reasons(self.config, self.state, self.now)
        if self.state.stage is Stage.STARTUP and reasons:
            if self.now - self.state.started_at < self.config.startup_grace:
                return
        stimulus = Stimulus.LINKS_UNHEALTHY if reasons else Stimulus.LINKS_HEALTHY
        if listed(self.state.stage, stimulus):
            self._move(stimulus, "; ".join(reasons))

    def _look_at_parachutes(self) -> None:
        open_links = [n for n in self.config.deploy_links if self._evidence(n).deployed]
        if not open_links or not listed(self.state.stage, Stimulus.PARACHUTE_OPEN):
            return
        stage = self.state.stage
        self._move(Stimulus.PARACHUTE_OPEN, f"{', '.join(open_links)} says deployed")
        if stage is Stage.IN_FLIGHT:
            # Released by itself: motors that turn under an open canopy tear it.
            self._fire(Action.KILL, "parachute open", ("its own status says deployed",))

    def _look_at_kill(self) -> None:
        kill = self.state.kill
        if kill is None:
            return
        waited = self.now - kill.decided_at
        confirmed = kill.furthest() is Outcome.CONFIRMED
        if self.state.kill_token and (confirmed or waited >= self.config.kill_timeout):
            accepted = kill.furthest() >= Outcome.ACCEPTED
            text = "; ".join(kill.details[-3:]) or f"no report within {waited:.1f} s"
            self._finish(self.state.kill_token, confirmed, accepted, text)
            self.state = replace(self.state, kill_token=0)
        if self.state.stage is not Stage.KILLING or not self.state.deploy_reason:
            return
        if confirmed or waited >= self.config.kill_to_deploy_delay:
            why = f"kill {'confirmed' if confirmed else 'not confirmed'} after {waited:.2f} s"
            limit = f"limit {self.config.kill_to_deploy_delay:g} s"
            reasons = (self.state.deploy_reason, f"{why} ({limit})")
            self._move(Stimulus.DEPLOY_DUE, why)
            self._fire(Action.DEPLOY, "operator", reasons)

    def _look_at_deploy(self) -> None:
        deploy = self.state.deploy
        if self.state.stage is Stage.DEPLOYING and deploy is not None:
            waited = self.now - deploy.decided_at
            if deploy.furthest() is Outcome.CONFIRMED:
                self._move(Stimulus.PARACHUTE_OPEN, deploy.details[-1])
            elif deploy.all_failed() or waited >= self.config.deploy_timeout:
                text = "; ".join(deploy.details[-3:]) or "no device node reported"
                self._move(Stimulus.DEPLOY_FAILED, text)
                self._alarm(f"no parachute confirmed within {waited:.1f} s: {text}")
        if self.state.stage in (Stage.DEPLOYED, Stage.FAULT) and self.state.deploy_token:
            accepted = deploy is not None and deploy.furthest() >= Outcome.ACCEPTED
            text = "; ".join(deploy.details[-3:]) if deploy is not None else ""
            success = self.state.stage is Stage.DEPLOYED
            self._finish(self.state.deploy_token, success, accepted, text or "deployed by itself")
            self.state = replace(self.state, deploy_token=0, deploy_reason="")

    def _block_or_release(self) -> None:
        """Flight is blocked in every stage on the ground but READY and ARMED."""
        if self.state.stage in (Stage.READY, Stage.ARMED):
            action = Action.FLIGHT_BLOCK_RELEASE
            reasons: tuple[str, ...] = ("every required link is healthy",)
        elif self.state.stage in (Stage.STARTUP, Stage.BLOCKED):
            action = Action.FLIGHT_BLOCK
            reasons = block_reasons(self.config, self.state, self.now) or ("starting",)
        else:
            return
        block = self.state.block
        if block is None or block.decision.action is not action:
            self._decide("block", action, "links", reasons, self.config.links)

    def _send_again(self) -> None:
        for name in ("block", "kill", "deploy"):
            pending: Pending | None = getattr(self.state, name)
            if pending is None or not pending.unreported() or pending.decision.shadow:
                continue
            if self.now - pending.sent_at >= self.config.resend_interval:
                self.outputs.append(i.Decide(pending.decision, again=True))
                self.state = replace(self.state, **{name: replace(pending, sent_at=self.now)})

    # -- steps -------------------------------------------------------------------------------------

    def _fire_kill(self, reason: str) -> None:
        self._move(Stimulus.KILL, reason)
        self._fire(Action.KILL, "operator", (reason,))

    def _fire(self, action: Action, rule: str, reasons: tuple[str, ...]) -> None:
        """The only place from which a kill or a deploy leaves."""
        if self.state.mode is not i.Mode.ACTIVE:
            return
        if action is Action.KILL:
            self._decide("kill", action, rule, reasons, self.config.kill_links)
        elif self.state.stage is Stage.DEPLOYING and self.state.kill is not None:
            self._decide("deploy", action, rule, reasons, self.config.deploy_links)

    def _decide(
        self,
        name: str,
        action: Action,
        rule: str,
        reasons: tuple[str, ...],
        targets: tuple[str, ...],
        shadow: bool = False,
    ) -> None:
        state = self.state
        decision = Decision(state.epoch, state.next_id, action, rule, reasons, targets, shadow)
        self.outputs.append(i.Decide(decision))
        pending = Pending(decision, self.now, self.now)
        self.state = replace(state, next_id=state.next_id + 1)
        if not shadow:
            self.state = replace(self.state, **{name: pending})

    def _renew(self, why: str) -> None:
        """Decide again, under a new number, what is still to be carried out."""
        for name in ("block", "kill", "deploy"):
            pending: Pending | None = getattr(self.state, name)
            if pending is None or pending.furthest() is Outcome.CONFIRMED and name != "block":
                continue
            d = pending.decision
            self._decide(name, d.action, d.rule, (*d.reasons, why), d.targets)
            renewed: Pending = getattr(self.state, name)
            # The time since the first decision goes on counting towards its limits.
            renewed = replace(renewed, decided_at=pending.decided_at)
            self.state = replace(self.state, **{name: renewed})

    def _only_said(self, token: int, action: Action, reason: str) -> None:
        mode = self.state.mode
        if mode is i.Mode.SHADOW:
            targets = self.config.kill_links + self.config.deploy_links
            self._decide("", action, "operator", (reason,), tuple(dict.fromkeys(targets)), shadow=True)
        self._finish(token, False, False, f"refused: mode is {mode.name}; nothing is sent")

    def _answer_waiting(self, why: str) -> None:
        for name in ("kill_token", "deploy_token"):
            token: int = getattr(self.state, name)
            if token:
                self._finish(token, False, False, why)
                self.state = replace(self.state, **{name: 0})

    def _move(self, stimulus: Stimulus, why: str = "") -> None:
        before = self.state.stage
        after = next_stage(before, stimulus)
        if after is before:
            return
        self.state = replace(self.state, stage=after, stage_since=self.now)
        text = f"{before.name} -> {after.name}: {stimulus.value}"
        self.outputs.append(i.Say(f"{text} ({why})" if why else text))

    def _alarm(self, text: str) -> None:
        self.state = replace(self.state, alarms=(*self.state.alarms, text))
        self.outputs.append(i.Say(text, alarm=True))

    def _finish(self, token: int, success: bool, accepted: bool, message: str) -> None:
        if token:
            self.outputs.append(i.Finish(token, success, accepted, message))

    def _evidence(self, link: str) -> LinkEvidence:
        return self.state.links.get(link, LinkEvidence())

    def _set_link(self, link: str, evidence: LinkEvidence) -> None:
        self.state = replace(self.state, links=frozen({**self.state.links, link: evidence}))
