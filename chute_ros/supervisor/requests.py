"""What people and devices ask of the supervisor, and what it answers at once."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from chute_ros.model import Action, Armed
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.machine import Stage, Stimulus, listed
from chute_ros.supervisor.preflight import arm_reasons
from chute_ros.supervisor.steps import Steps

ON_GROUND = (Stage.STARTUP, Stage.BLOCKED, Stage.READY, Stage.ARMED, Stage.LANDED)
#: What a vehicle says so soon after a kill was decided may be from before it, s.
_KILL_SETTLES = 0.2
#: Devices whose wish to block flight is remembered: made-up names must not grow us.
MOST_DEVICE_BLOCKS = 64
_DEPLOY_ALLOWED = (Stage.IN_FLIGHT, Stage.KILLING, Stage.DEPLOYING, Stage.FAULT)


class Requests(Steps):
    """Every request with a token is answered exactly once, now or when its outcome is known."""

    def arm_request(self, one: i.ArmRequest) -> None:
        """Arming needs every pre-flight check; disarming only the ground."""
        if one.arm:
            wrong = arm_reasons(self.config, self.state, self.now)
        elif self.state.stage in ON_GROUND or self._down():
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
            self.only_say(Action.KILL, one.by, (reason,))
            self._nothing_sent(one.token)
            return
        self.end_kill()
        if one.token:
            self.state = replace(self.state, kill_tokens=(*self.state.kill_tokens, one.token))
        if listed(self.state.stage, Stimulus.KILL):
            self.move(Stimulus.KILL, reason)
        if not self._kill_joined(one.token):
            self.fire(Action.KILL, one.by, (reason,))

    def _kill_under_way(self) -> bool:
        """A kill is on its way and may still be confirmed."""
        kill = self.state.kill
        return kill is not None and not kill.confirmed and not self.kill_failed(kill)

    def _kill_joined(self, token: int) -> bool:
        """Does a kill that was decided already serve this request?

        A person who asks after the confirmation sees motors that turn, and is obeyed again. A
        device repeats itself; that must not become a new decision each time.
        """
        kill = self.state.kill
        if token or kill is None or self._kill_under_way():
            return self._kill_under_way()
        if kill.confirmed and self._armed_since(kill.decided_at + _KILL_SETTLES):
            return False
        wait = self.config.kill_timeout if kill.confirmed else self.config.resend_interval
        return self.now < kill.decided_at + wait

    def _armed_since(self, when: float) -> bool:
        """The vehicle says, and said after when, that its motors are armed (again)."""
        said_at = self.state.vehicle_received - self.state.vehicle.armed_age
        fresh = self.now - said_at <= self.config.vehicle_state_age
        return self.state.vehicle.armed is Armed.ARMED and fresh and said_at > when

    def block_request(self, one: i.BlockRequest) -> None:
        """Blocks flight on the ground as an unhealthy link does; in the air it is remembered."""
        blocks, device = dict(self.state.device_blocks), f"{one.link} {one.device}".strip()
        if not one.block:
            blocks.pop(device, None)
        elif device in blocks or len(blocks) < MOST_DEVICE_BLOCKS:
            blocks[device] = one.reason or "no reason given"
        elif not self.state.block_refused:
            self.state = replace(self.state, block_refused=True)
            text = f"not remembered, {len(blocks)} devices do already"
            self.outputs.append(i.Say(f"{device} asks to block flight: {text}", alarm=True))
        if blocks != self.state.device_blocks:
            full = self.state.block_refused and len(blocks) >= MOST_DEVICE_BLOCKS
            kept = MappingProxyType(blocks)
            self.state = replace(self.state, device_blocks=kept, block_refused=full)

    def deploy_request(self, one: i.DeployRequest) -> None:
        """Refused on the ground unless forced; one that is under way is joined."""
        stage = self.state.stage
        in_air = self.state.in_air(self.config, self.now)
        reason = f"operator{', forced' if one.force else ''}: {one.reason or 'no reason given'}"
        wrong = ""
        if stage is Stage.DEPLOYED:
            wrong = "a parachute is out already"
        elif stage not in _DEPLOY_ALLOWED and not one.force:
            unknown = " (nothing fresh says whether it is in the air)" if in_air is None else ""
            wrong = f"the vehicle is {stage.name}, not in flight{unknown}; "
            wrong += "force deploys all the same"
        if wrong:
            self.finish(one.token, False, False, "refused: " + wrong)
        elif self.state.mode is not i.Mode.ACTIVE:
            for action in (Action.KILL, Action.DEPLOY):
                self.only_say(action, "operator", (reason,))
            self._nothing_sent(one.token)
        else:
            tokens = (*self.state.deploy_tokens, one.token)
            self.state = replace(self.state, deploy_tokens=tokens)
            if not self.state.deploy_reason:
                self._begin_deploy(reason)

    def _begin_deploy(self, reason: str) -> None:
        """The kill first, unless one is on its way or confirmed."""
        if self.state.stage in ON_GROUND:
            self.note_released()
        self.end_kill()
        kill, since = self.state.kill, self.now
        if self.state.stage is Stage.KILLING and self._kill_under_way():
            assert kill is not None
            since = kill.decided_at
        elif self.state.stage is not Stage.KILLING or kill is None or not kill.confirmed:
            self.move(Stimulus.KILL, reason)
            self.fire(Action.KILL, "operator", (reason,))
        due = since + self.config.kill_to_deploy_delay
        self.state = replace(self.state, deploy_reason=reason, deploy_due=due)

    def reset_request(self, one: i.ResetRequest) -> None:
        """Back to the start, on the ground only."""
        stage = self.state.stage
        in_air = self.state.in_air(self.config, self.now)
        if in_air or stage is Stage.IN_FLIGHT:
            self.finish(one.token, False, False, "refused: the vehicle is in the air")
        elif in_air is None and self.state.deploy_reason:
            text = "refused: a deploy is under way and nothing fresh says that it is on the ground"
            self.finish(one.token, False, False, text)
        elif not listed(stage, Stimulus.RESET):
            self.finish(one.token, False, False, f"refused: the vehicle is {stage.name}")
        else:
            self.give_up_waiting("reset by a person")
            self.move(Stimulus.RESET)
            self.state = replace(
                self.state,
                started_at=self.now,
                block=None,
                kill=None,
                deploy=None,
                flown=False,
                alarms=(),
                # A device that still wants it asks again; one that was exchanged cannot.
                device_blocks=MappingProxyType({}),
            )
            self.note_released()
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
            if stage is Stage.DEPLOYING:
                self.move(Stimulus.DEPLOY_FAILED, "the mode was changed")
            block = self.state.block
            if block is not None and (
                block.decision.action is Action.FLIGHT_BLOCK or block.unreported()
            ):
                reasons = (f"mode changes from ACTIVE to {one.mode.name}",)
                release = Action.FLIGHT_BLOCK_RELEASE
                self.decide("block", release, "mode", reasons, self.config.links)
            else:
                self.state = replace(self.state, block=None)
        else:
            # What was said in the other mode was not sent; what holds now is decided anew.
            self.state = replace(self.state, block=None)
        self.state = replace(self.state, mode=one.mode)
        self.finish(one.token, True, True, f"mode {one.mode.name}")

    def _down(self) -> bool:
        """Known to be on the ground, and no deploy on its way."""
        if self.state.deploy_reason:
            return False
        return self.state.in_air(self.config, self.now) is False

    def _nothing_sent(self, token: int) -> None:
        text = f"refused: mode is {self.state.mode.name}; nothing is sent"
        self.finish(token, False, False, text)
