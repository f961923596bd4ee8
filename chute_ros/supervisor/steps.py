"""The single steps of an update: moving, deciding, firing, answering. core.py says when."""

from __future__ import annotations

from types import MappingProxyType
from typing import Literal

from chute_ros.model import Action, Decision, Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.link_evidence import LinkEvidence
from chute_ros.supervisor.machine import TRANSITIONS, Stage, Stimulus
from chute_ros.supervisor.quick_replace import replace
from chute_ros.supervisor.state import Pending, State
from chute_ros.transitions import after

#: A decision that may be on its way; a number is that of the deploy's step, from 0.
Slot = Literal["block", "kill"] | int


#: Alarms that are remembered: a device that repeats itself must not grow us.
_MOST_ALARMS = 16


class Steps:
    """Works on state step by step and collects what is to be done."""

    def __init__(self, config: SupervisorConfig, state: State, now: float) -> None:
        self.config, self.state, self.now = config, state, now
        #: As it was at the end of the last update.
        self.before = state
        self.outputs: list[i.Output] = []

    def move(self, stimulus: Stimulus, why: str = "") -> None:
        """To the stage that the table names."""
        before = self.state.stage
        stage = after(TRANSITIONS, before, stimulus)
        if stage is before:
            return
        self.state = replace(self.state, stage=stage, stage_since=self.now)
        text = f"{before.name} -> {stage.name}: {stimulus.value}"
        self.outputs.append(i.Say(f"{text} ({why})" if why else text))

    @property
    def ladder(self) -> tuple[Rung, ...]:
        """The steps of the deploy."""
        return self.state.ladder(self.config)

    @property
    def slots(self) -> tuple[Slot, ...]:
        """Every decision that may be on its way."""
        return ("block", "kill", *range(len(self.state.deploys)))

    def fire(self, action: Action, rule: str, reasons: tuple[str, ...]) -> None:
        """The only place from which a kill or a deploy leaves. Default is deny."""
        state = self.state
        if not state.leading or state.mode is i.Mode.INHIBITED:
            return
        if state.mode is i.Mode.SHADOW:
            self.only_say(action, rule, reasons)
        elif action is Action.KILL:
            self.decide("kill", action, rule, reasons, self.config.kill_links)
        elif state.stage is Stage.DEPLOYING and state.kill is not None:
            step = len(state.deploys)
            if step < len(self.ladder) and not any(d.confirmed for d in state.deploys):
                rung = self.ladder[step]
                self.decide(step, action, rule, reasons, (rung.link,), rung.device)

    def only_say(self, action: Action, rule: str, reasons: tuple[str, ...]) -> None:
        """In SHADOW a kill or a deploy is published as what would have been done; nobody carries
        it out, so nothing is awaited."""
        first = self.config.ladder[0]
        links = self.config.kill_links if action is Action.KILL else (first.link,)
        device = "" if action is Action.KILL else first.device
        self.publish(action, rule, reasons, links, device)

    def publish(
        self,
        action: Action,
        rule: str,
        reasons: tuple[str, ...],
        targets: tuple[str, ...],
        device: str,
    ) -> Decision:
        """A new decision under the next number, in SHADOW only as what would have been done."""
        state = self.state
        shadow = state.mode is i.Mode.SHADOW
        decision = Decision(
            state.epoch, state.next_id, action, rule, reasons, targets, shadow, device
        )
        self.outputs.append(i.Decide(decision))
        self.state = replace(state, next_id=state.next_id + 1, newest=decision)
        return decision

    def decide(
        self,
        slot: Slot,
        action: Action,
        rule: str,
        reasons: tuple[str, ...],
        targets: tuple[str, ...],
        device: str = "",
    ) -> None:
        """Publish a new decision and await what comes of it."""
        decision = self.publish(action, rule, reasons, targets, device)
        self.put(slot, Pending(decision, targets, self.now, self.now))

    def wanted(self, slot: Slot) -> bool:
        """Does the present stage still want what is in this slot carried out?

        A deploy that failed before is not tried again because a node restarts on the ground, and
        a flight block must not overtake a kill or a deploy that is on its way.
        """
        stage = self.state.stage
        if slot == "block":
            under_way = stage is Stage.KILLING and (
                self.state.killed_in_flight or bool(self.state.deploy_rule)
            )
            return stage is not Stage.DEPLOYING and not under_way
        if slot == "kill":
            if self.state.deploy_rule or stage is Stage.DEPLOYED:
                return stage in (Stage.KILLING, Stage.DEPLOYING, Stage.DEPLOYED)
            # One that failed long ago is not what a node that is back must do.
            kill = self.state.kill
            young = kill is not None and self.kill_can_help(kill)
            return young and stage in (Stage.KILLING, Stage.DEPLOYING, Stage.FAULT)
        return stage is Stage.DEPLOYING

    def renew(self, slot: Slot, why: str) -> None:
        """Decide again, under a new number, what is still to be carried out."""
        pending = self.pending(slot)
        if pending is None or not self.wanted(slot) or not self.state.leading:
            return
        if pending.confirmed and slot != "block":
            return
        new = self._under_new_number(slot, pending, pending.targets, why)
        # The time since the first decision goes on counting towards its limits.
        new = replace(new, decided_at=pending.decided_at, given_up=pending.given_up)
        self.put(slot, new)

    def renew_not_begun(self, why: str) -> None:
        """Decide again what not every target has begun with: it goes on where it was begun, and a
        second order would start it again."""
        for slot in self.slots:
            pending = self.pending(slot)
            if pending is not None and (slot == "block" or pending.not_begun()):
                self.renew(slot, why)

    def renew_missing(self, slot: Slot, why: str) -> None:
        """The same under a new number, to those that have not reported; what is known stays."""
        pending = self.pending(slot)
        assert pending is not None
        if not self.state.leading:
            return
        new = self._under_new_number(slot, pending, pending.unreported(), why)
        earlier = pending.earlier | {pending.number}
        renewed = replace(pending, decision=new.decision, earlier=earlier, sent_at=self.now)
        self.put(slot, renewed)

    def _under_new_number(
        self, slot: Slot, pending: Pending, targets: tuple[str, ...], why: str
    ) -> Pending:
        d = pending.decision
        reasons = d.reasons if why in d.reasons else (*d.reasons, why)
        self.decide(slot, d.action, d.rule, reasons, targets, d.device)
        renewed = self.pending(slot)
        assert renewed is not None
        return renewed

    def note_released(self) -> None:
        """What is released now was so before the flight and says nothing of what happens in it."""
        before = self.state.released_before | self.state.released(self.config)
        self.state = replace(self.state, released_before=before)

    def send_again(self, slot: Slot) -> None:
        """The same decision once more: its number lets a node that knows it do nothing."""
        pending = self.pending(slot)
        assert pending is not None
        self.outputs.append(i.Decide(pending.decision, again=True))
        self.put(slot, replace(pending, sent_at=self.now))

    def pending(self, slot: Slot) -> Pending | None:
        """The decision in this slot."""
        if slot == "block":
            return self.state.block
        return self.state.kill if slot == "kill" else self.state.deploys[slot]

    def put(self, slot: Slot, pending: Pending) -> None:
        """Remember a decision."""
        if slot == "block":
            self.state = replace(self.state, block=pending)
        elif slot == "kill":
            self.state = replace(self.state, kill=pending)
        else:
            deploys = self.state.deploys
            self.state = replace(
                self.state, deploys=(*deploys[:slot], pending, *deploys[slot + 1 :])
            )

    def deploy_reached(self, outcome: Outcome) -> bool:
        """A step of the deploy has got this far, or further."""
        return any(deploy.reached(outcome) for deploy in self.state.deploys)

    def deploy_details(self) -> str:
        """What was reported last on each step of the deploy, in words."""
        return "; ".join(d.newest_details() for d in self.state.deploys if d.details)

    def alarm(self, text: str) -> None:
        """Something that stays until a reset, or until what it tells is over."""
        if text not in self.state.alarms:
            self.state = replace(self.state, alarms=(*self.state.alarms, text)[-_MOST_ALARMS:])
        self.outputs.append(i.Say(text, alarm=True))

    def finish(self, token: int, success: bool, accepted: bool, message: str) -> None:
        """Answer a request; token 0: nobody waits."""
        if token:
            self.outputs.append(i.Finish(token, success, accepted, message))

    def kill_failed(self, kill: Pending) -> bool:
        """Nobody has confirmed it, and nobody is expected to any more."""
        late = self.now >= kill.decided_at + self.config.kill_timeout
        return not kill.confirmed and (late or kill.all_failed())

    def kill_can_help(self, kill: Pending) -> bool:
        """It was decided so short a time ago that it is still meant."""
        limit = max(self.config.kill_timeout, self.config.deploy_timeout)
        return self.now < kill.decided_at + limit

    def end_kill(self) -> None:
        """Say how the kill went as soon as that is known, before another takes its place."""
        kill = self.state.kill
        if kill is None:
            return
        failed = self.kill_failed(kill)
        waited = self.now - kill.decided_at
        text = kill.newest_details() or f"no report within {waited:.1f} s"
        if kill.confirmed or failed:
            self.finish_kill(kill.confirmed, kill.reached(Outcome.ACCEPTED), text)
        if failed and not kill.given_up:
            self.put("kill", replace(kill, given_up=True))
            self.alarm(f"the motors may still turn, no kill confirmed: {text}")

    def finish_kill(self, success: bool, accepted: bool, message: str) -> None:
        """Answer everyone who waits for the kill."""
        for token in self.state.kill_tokens:
            self.finish(token, success, accepted, message)
        self.state = replace(self.state, kill_tokens=())

    def finish_deploy(self, success: bool, accepted: bool, message: str) -> None:
        """Answer everyone who waits for the deploy."""
        for token in self.state.deploy_tokens:
            self.finish(token, success, accepted, message)
        self.state = replace(self.state, deploy_tokens=(), deploy_rule="", deploy_reasons=())

    def answer_all(self, why: str) -> None:
        """Nobody waits any more; what was ordered goes on, here or elsewhere."""
        for token in (*self.state.kill_tokens, *self.state.deploy_tokens):
            self.finish(token, False, False, why)
        self.state = replace(self.state, kill_tokens=(), deploy_tokens=())

    def give_up_waiting(self, why: str) -> None:
        """What was asked for is not pursued any more."""
        self.finish_kill(False, False, why)
        self.finish_deploy(False, False, why)

    def evidence(self, link: str) -> LinkEvidence:
        """What is known of a link."""
        return self.state.evidence(link)

    def set_evidence(self, link: str, evidence: LinkEvidence) -> None:
        """Remember what is known of a link."""
        links = {**self.state.links, link: evidence}
        self.state = replace(self.state, links=MappingProxyType(links))
