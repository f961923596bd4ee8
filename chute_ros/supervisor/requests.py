"""What people and devices ask of the supervisor, and what it answers at once."""

from __future__ import annotations

from dataclasses import replace

from chute_ros.model import Action
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage, Stimulus, listed
from chute_ros.supervisor.preflight import arm_reasons
from chute_ros.supervisor.steps import Steps

ON_GROUND = (Stage.STARTUP, Stage.BLOCKED, Stage.READY, Stage.ARMED, Stage.LANDED)
_DEPLOY_ALLOWED = (Stage.IN_FLIGHT, Stage.KILLING, Stage.DEPLOYING, Stage.FAULT)


class Requests(Steps):
    """Every request with a token is answered exactly once, now or when its outcome is known."""

    def arm_request(self, one: i.ArmRequest) -> None:
        """Arming needs every pre-flight check; disarming only the ground."""
        if one.arm:
            wrong = arm_reasons(self.config, self.state, self.now)
        elif self.state.stage in ON_GROUND:
            wrong = ()
        else:
            wrong = (f"the vehicle is {self.state.stage.name}: not disarmed in flight",)
        if wrong:
            self.finish(one.token, False, False, "refused: " + "; ".join(wrong))
        else:
            links = self.config.deploy_links
            self.outputs.append(i.ArmDevices(one.token, one.arm, one.triggers, links))

    def arm_done(self, one: i.ArmDone) -> None:
        """The device nodes have answered."""
        stimulus = Stimulus.ARMED if one.arm else Stimulus.DISARMED
        if one.success and listed(self.state.stage, stimulus):
            self.move(stimulus)
        self.finish(one.token, one.success, one.success, one.message)

    def kill_request(self, one: i.KillRequest) -> None:
        """Never refused while ACTIVE; one that is under way is joined."""
        reason = f"{one.by}: {one.reason}"
        if self.state.mode is not i.Mode.ACTIVE:
            self._only_said(one.token, (Action.KILL,), reason)
            return
        if one.token:
            self.state = replace(self.state, kill_tokens=(*self.state.kill_tokens, one.token))
        kill = self.state.kill
        under_way = self.state.stage in (Stage.KILLING, Stage.DEPLOYING)
        if under_way and kill is not None and not kill.all_failed():
            return
        if listed(self.state.stage, Stimulus.KILL):
            self.move(Stimulus.KILL, reason)
        self.fire(Action.KILL, one.by, (reason,))

    def deploy_request(self, one: i.DeployRequest) -> None:
        """Refused on the ground unless forced; one that is under way is joined."""
        stage = self.state.stage
        reason = f"operator{', forced' if one.force else ''}: {one.reason or 'no reason given'}"
        wrong = ""
        if stage is Stage.DEPLOYED:
            wrong = "a parachute is out already"
        elif stage not in _DEPLOY_ALLOWED and not one.force:
            wrong = f"the vehicle is {stage.name}, not in flight; force deploys all the same"
        if wrong:
            self.finish(one.token, False, False, "refused: " + wrong)
        elif self.state.mode is not i.Mode.ACTIVE:
            self._only_said(one.token, (Action.KILL, Action.DEPLOY), reason)
        else:
            tokens = (*self.state.deploy_tokens, one.token)
            reason = self.state.deploy_reason or reason
            self.state = replace(self.state, deploy_tokens=tokens, deploy_reason=reason)
            if stage is not Stage.DEPLOYING and (
                stage is not Stage.KILLING or not self.state.kill
            ):
                self.move(Stimulus.KILL, reason)
                self.fire(Action.KILL, "operator", (reason,))

    def reset_request(self, one: i.ResetRequest) -> None:
        """Back to the start, on the ground only."""
        stage = self.state.stage
        if self.state.in_air(self.config, self.now) or stage is Stage.IN_FLIGHT:
            self.finish(one.token, False, False, "refused: the vehicle is in the air")
        elif not listed(stage, Stimulus.RESET):
            self.finish(one.token, False, False, f"refused: the vehicle is {stage.name}")
        else:
            self.give_up_waiting("reset by a person")
            self.move(Stimulus.RESET)
            self.state = replace(
                self.state, started_at=self.now, block=None, kill=None, deploy=None, alarms=()
            )
            self.finish(one.token, True, True, "back to the start")

    def mode_request(self, one: i.ModeRequest) -> None:
        """In flight only with force. Whoever leaves ACTIVE takes its flight block back first."""
        before, stage = self.state.mode, self.state.stage
        if one.mode is before:
            self.finish(one.token, True, True, f"mode is {before.name} already")
            return
        if stage not in ON_GROUND and not one.force:
            text = f"refused: the vehicle is {stage.name}; force changes it all the same"
            self.finish(one.token, False, False, text)
            return
        if before is i.Mode.ACTIVE:
            self.give_up_waiting(f"mode changed to {one.mode.name}")
            self.state = replace(self.state, kill=None, deploy=None)
            block = self.state.block
            if block is not None and block.decision.action is Action.FLIGHT_BLOCK:
                reasons = (f"mode changes from ACTIVE to {one.mode.name}",)
                release = Action.FLIGHT_BLOCK_RELEASE
                self.decide("block", release, "mode", reasons, self.config.links)
        else:
            # What was said in the other mode was not sent; what holds now is decided anew.
            self.state = replace(self.state, block=None)
        self.state = replace(self.state, mode=one.mode)
        self.finish(one.token, True, True, f"mode {one.mode.name}")

    def _only_said(self, token: int, actions: tuple[Action, ...], reason: str) -> None:
        """Not ACTIVE: in SHADOW the decisions are published as what would have been done."""
        mode = self.state.mode
        if mode is i.Mode.SHADOW:
            for action in actions:
                if action is Action.KILL:
                    self.decide("kill", action, "operator", (reason,), self.config.kill_links)
                else:
                    self.decide("deploy", action, "operator", (reason,), self.config.deploy_links)
            self.state = replace(self.state, kill=None, deploy=None)
        self.finish(token, False, False, f"refused: mode is {mode.name}; nothing is sent")
