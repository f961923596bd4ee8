"""What people and devices ask of the supervisor, and what it answers at once."""

from __future__ import annotations

import math
from types import MappingProxyType

from chute_ros.model import Action
from chute_ros.supervisor import flight
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.gate import OPERATOR, against_person
from chute_ros.supervisor.machine import Stage, Stimulus, listed
from chute_ros.supervisor.orders import ON_GROUND, Orders
from chute_ros.supervisor.preflight import arm_reasons
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.state import Ask

#: Devices whose wish to block flight is remembered: made-up names must not grow us.
MOST_DEVICE_BLOCKS = 64


class Requests(Orders):
    """Every request with a token is answered exactly once, now or when its outcome is known."""

    def arm_request(self, one: i.ArmRequest) -> None:
        """Arming needs every pre-flight check; disarming only the ground."""
        if one.arm:
            wrong = "; ".join(arm_reasons(self.config, self.state, one.day, self.now))
        else:
            wrong = self._against_disarming()
        if wrong:
            self.finish(one.token, False, False, "refused: " + wrong)
        else:
            links = self.config.deploy_links
            self.outputs.append(i.ArmDevices(one.token, one.arm, one.triggers, links))

    def arm_done(self, one: i.ArmDone) -> None:
        """The device nodes have answered."""
        stimulus = Stimulus.ARMED if one.arm else Stimulus.DISARMED
        if one.success and listed(self.state.stage, stimulus):
            self.move(stimulus)
        if one.success:
            self.state = replace(self.state, armed_by_us=one.arm)
        elif not one.token:
            self.alarm(f"the parachutes are not disarmed after the flight: {one.message}")
        self.finish(one.token, one.success, one.success, one.message)

    def kill_request(self, one: i.KillRequest) -> None:
        """A person's is never refused while ACTIVE; a device's is evidence for the rules."""
        reason = f"{one.by}: {one.reason}"
        if not one.token:
            self._device_asks(one)
            return
        if not self.state.leading:
            self.finish(one.token, False, False, f"refused: {i.CALL_AGAIN}")
            return
        self.order_kill(one.by, (reason,), one.token, one.kill_only)
        if self.state.mode is not i.Mode.ACTIVE:
            self._nothing_sent(one.token)

    def _device_asks(self, one: i.KillRequest) -> None:
        asks = {who: ask for who, ask in self.state.asks.items() if self.now < ask.ends_at}
        if one.by in asks or len(asks) < MOST_DEVICE_BLOCKS:
            asks[one.by] = Ask(self.now, one.by.partition(" ")[0], one.reason)
        rules = dict(self.state.rules)
        for rule in self.config.profile.rules:
            # Asked anew is a new occasion, whatever became of the last.
            if rule.asks_for_a_kill:
                rules[rule.name] = replace(self.state.rule(rule.name), latched=False)
        self.state = replace(
            self.state, asks=MappingProxyType(asks), rules=MappingProxyType(rules)
        )

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
        wrong = against_person(self.config, self.state, one.force, self.now)
        reason = f"operator{', forced' if one.force else ''}: {one.reason or 'no reason given'}"
        if wrong:
            self.finish(one.token, False, False, "refused: " + wrong)
        elif self.state.mode is not i.Mode.ACTIVE:
            self.order_deploy(OPERATOR, (reason,))
            self._nothing_sent(one.token)
        else:
            tokens = (*self.state.deploy_tokens, one.token)
            self.state = replace(self.state, deploy_tokens=tokens)
            self.order_deploy(OPERATOR, (reason,))

    def reset_request(self, one: i.ResetRequest) -> None:
        """Back to the start, on the ground only."""
        stage = self.state.stage
        in_air = flight.in_air(self.config, self.state, self.now)
        if in_air and flight.says_air_in_vain(self.config, self.state, self.now):
            in_air = False
        if in_air or stage is Stage.IN_FLIGHT:
            self.finish(one.token, False, False, "refused: the vehicle is in the air")
        elif in_air is None and self.state.deploy_rule:
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
                deploys=(),
                flown=False,
                airborne=False,
                killed_in_flight=False,
                rebooted=False,
                rules=MappingProxyType({}),
                asks=MappingProxyType({}),
                alarms=(),
                alarm_at=math.nan,
                canopy_fails=False,
                kill_only=False,
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
            self.state = replace(self.state, kill=None, deploys=())
            if stage is Stage.DEPLOYING:
                # What is judged anew must find a stage in which the rules live.
                self.move(Stimulus.MODE_CHANGED)
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
        why = one.reason or "no reason given"
        self.outputs.append(i.Say(f"mode {before.name} -> {one.mode.name} ({why})"))
        # What was only said in one mode is done in the other.
        self.state = replace(self.state, mode=one.mode, rules=MappingProxyType({}))
        self.finish(one.token, True, True, f"mode {one.mode.name}")

    def _against_disarming(self) -> str:
        """Why the parachute is not disarmed; empty: it is on the ground, no deploy on its way."""
        stage = self.state.stage
        down = flight.in_air(self.config, self.state, self.now) is False
        if stage in ON_GROUND or (down and not self.state.deploy_rule):
            return ""
        return f"the vehicle is {stage.name}: not disarmed in flight"

    def _nothing_sent(self, token: int) -> None:
        text = f"refused: mode is {self.state.mode.name}; nothing is sent"
        self.finish(token, False, False, text)
