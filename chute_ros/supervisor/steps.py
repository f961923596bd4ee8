"""The single steps of an update: moving, deciding, firing, answering. core.py says when."""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import Literal

from chute_ros.model import Action, Decision
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.machine import Stage, Stimulus, next_stage
from chute_ros.supervisor.state import LinkEvidence, Pending, State

Slot = Literal["block", "kill", "deploy"]
SLOTS: tuple[Slot, ...] = ("block", "kill", "deploy")


class Steps:
    """Works on state step by step and collects what is to be done."""

    def __init__(self, config: SupervisorConfig, state: State, now: float) -> None:
        self.config, self.state, self.now = config, state, now
        self.outputs: list[i.Output] = []

    def move(self, stimulus: Stimulus, why: str = "") -> None:
        """To the stage that the table names."""
        before = self.state.stage
        after = next_stage(before, stimulus)
        if after is before:
            return
        self.state = replace(self.state, stage=after, stage_since=self.now)
        text = f"{before.name} -> {after.name}: {stimulus.value}"
        self.outputs.append(i.Say(f"{text} ({why})" if why else text))

    def fire(self, action: Action, rule: str, reasons: tuple[str, ...]) -> None:
        """The only place from which a kill or a deploy leaves. Default is deny."""
        if self.state.mode is not i.Mode.ACTIVE:
            return
        if action is Action.KILL:
            self.decide("kill", action, rule, reasons, self.config.kill_links)
        elif self.state.stage is Stage.DEPLOYING and self.state.kill is not None:
            self.decide("deploy", action, rule, reasons, self.config.deploy_links)

    def decide(
        self,
        slot: Slot,
        action: Action,
        rule: str,
        reasons: tuple[str, ...],
        targets: tuple[str, ...],
    ) -> None:
        """Publish a new decision, in SHADOW only as what would have been done."""
        state = self.state
        shadow = state.mode is i.Mode.SHADOW
        decision = Decision(state.epoch, state.next_id, action, rule, reasons, targets, shadow)
        self.outputs.append(i.Decide(decision))
        self.state = replace(state, next_id=state.next_id + 1)
        self.put(slot, Pending(decision, targets, self.now, self.now))

    def renew(self, why: str) -> None:
        """Decide again, under a new number, what is still to be carried out.

        Only what the present stage still wants: a deploy that failed before is not tried again
        because a node restarts on the ground.
        """
        wanted: list[Slot] = ["block"]
        if self.state.stage in (Stage.KILLING, Stage.DEPLOYING, Stage.DEPLOYED):
            wanted.append("kill")
        if self.state.stage is Stage.DEPLOYING:
            wanted.append("deploy")
        for slot in wanted:
            pending = self.pending(slot)
            if pending is None or (pending.confirmed and slot != "block"):
                continue
            self.decide_again(slot, why)

    def decide_again(self, slot: Slot, why: str) -> None:
        """The same decision under a new number, to all that it was for."""
        pending = self.pending(slot)
        assert pending is not None
        renewed = self._under_new_number(slot, pending, pending.targets, why)
        # The time since the first decision goes on counting towards its limits.
        self.put(slot, replace(renewed, decided_at=pending.decided_at))

    def decide_for_missing(self, slot: Slot) -> None:
        """The same under a new number, to those that have not reported; what is known stays."""
        pending = self.pending(slot)
        assert pending is not None
        renewed = self._under_new_number(slot, pending, pending.unreported(), "not reported yet")
        self.put(slot, replace(pending, decision=renewed.decision, sent_at=self.now))

    def _under_new_number(
        self, slot: Slot, pending: Pending, targets: tuple[str, ...], why: str
    ) -> Pending:
        d = pending.decision
        reasons = d.reasons if why in d.reasons else (*d.reasons, why)
        self.decide(slot, d.action, d.rule, reasons, targets)
        renewed = self.pending(slot)
        assert renewed is not None
        return renewed

    def pending(self, slot: Slot) -> Pending | None:
        """The decision in this slot."""
        if slot == "block":
            return self.state.block
        return self.state.kill if slot == "kill" else self.state.deploy

    def put(self, slot: Slot, pending: Pending | None) -> None:
        """Remember a decision."""
        if slot == "block":
            self.state = replace(self.state, block=pending)
        elif slot == "kill":
            self.state = replace(self.state, kill=pending)
        else:
            self.state = replace(self.state, deploy=pending)

    def alarm(self, text: str) -> None:
        """Something that stays until a reset."""
        self.state = replace(self.state, alarms=(*self.state.alarms, text))
        self.outputs.append(i.Say(text, alarm=True))

    def finish(self, token: int, success: bool, accepted: bool, message: str) -> None:
        """Answer a request; token 0: nobody waits."""
        if token:
            self.outputs.append(i.Finish(token, success, accepted, message))

    def finish_kill(self, success: bool, accepted: bool, message: str) -> None:
        """Answer everyone who waits for the kill."""
        for token in self.state.kill_tokens:
            self.finish(token, success, accepted, message)
        self.state = replace(self.state, kill_tokens=())

    def finish_deploy(self, success: bool, accepted: bool, message: str) -> None:
        """Answer everyone who waits for the deploy."""
        for token in self.state.deploy_tokens:
            self.finish(token, success, accepted, message)
        self.state = replace(self.state, deploy_tokens=(), deploy_reason="")

    def give_up_waiting(self, why: str) -> None:
        """What was asked for is not pursued any more."""
        self.finish_kill(False, False, why)
        self.finish_deploy(False, False, why)

    def evidence(self, link: str) -> LinkEvidence:
        """What is known of a link."""
        return self.state.links.get(link, LinkEvidence())

    def set_evidence(self, link: str, evidence: LinkEvidence) -> None:
        """Remember what is known of a link."""
        links = {**self.state.links, link: evidence}
        self.state = replace(self.state, links=MappingProxyType(links))
