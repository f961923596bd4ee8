"""What the device nodes report: their heartbeats, their parachutes, how decisions fare."""

from __future__ import annotations

import math
from dataclasses import replace
from types import MappingProxyType

from chute_ros.model import Outcome
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.requests import Requests
from chute_ros.supervisor.state import State
from chute_ros.supervisor.steps import SLOTS

_LARGEST_EPOCH = 2**32 - 1


class Reports(Requests):
    """Takes reports in. Nobody but a link that is configured is listened to."""

    def __init__(self, config: SupervisorConfig, state: State, now: float) -> None:
        super().__init__(config, state, now)
        #: Links that said in this very turn that a parachute is released.
        self.told_released: set[str] = set()

    def heartbeat(self, one: i.LinkHeartbeat) -> None:
        """A node lives. One whose count does not rise has restarted; a lost one may have."""
        if one.link not in self.config.links:
            return
        before = self.evidence(one.link)
        known = not math.isnan(before.heard)
        silent = before.silent(self.config.heartbeat.lost_after, self.now)
        evidence = replace(
            before,
            heard=self.now,
            reported=one.link_state,
            device_healthy=one.device_healthy,
            seq=one.seq,
        )
        self.set_evidence(one.link, evidence)
        if known and (silent or one.seq <= before.seq):
            # It may know of no decision; what still holds for it is decided anew.
            why = f"{one.link} {'is back' if silent else 'restarted'}"
            for slot in SLOTS:
                pending = self.pending(slot)
                if pending is not None and one.link in pending.targets:
                    self.renew(slot, why)

    def parachute(self, one: i.ParachuteReport) -> None:
        """One device on a link says whether it is released."""
        if one.link not in self.config.links:
            return
        evidence = self.evidence(one.link)
        deployed = evidence.deployed - {one.device}
        if one.deployed and one.alive:
            deployed |= {one.device}
            self.told_released.add(one.link)
        elif one.alive:
            before = self.state.released_before - {(one.link, one.device)}
            self.state = replace(self.state, released_before=before)
        faults = MappingProxyType({**evidence.faults, one.device: one.faults})
        self.set_evidence(one.link, replace(evidence, deployed=deployed, faults=faults))

    def action_report(self, one: i.ActionReport) -> None:
        """How far a node got with a decision, and which is the newest that it knows."""
        if one.link not in self.config.links or one.outcome is Outcome.NONE:
            return
        of_our_epoch = one.epoch == self.state.epoch
        # Somebody else decides, or decided before us, under our epoch: the numbers are not ours.
        same = one.newest_epoch == self.state.epoch
        foreign = same and one.newest_id >= self.state.next_id
        if not foreign:
            self._take_outcome(one)
        if of_our_epoch and (foreign or one.newest_epoch > self.state.epoch):
            self._overtake(one)

    def _take_outcome(self, one: i.ActionReport) -> None:
        for slot in SLOTS:
            pending = self.pending(slot)
            if pending is None or one.link not in pending.targets:
                continue
            number, failed = (one.epoch, one.id), one.outcome is Outcome.FAILED
            if number != pending.number:
                asked_again = one.link in pending.decision.targets
                if number not in pending.earlier or (asked_again and failed):
                    continue
            elif (
                failed
                and not pending.of(one.link)
                and self.wanted(slot)
                and self._overtaken(number, one.link)
            ):
                # Refused as older, not tried: those that have not begun get a new number.
                self.renew_missing(slot, f"{one.link} saw a newer decision first")
                continue
            reached = pending.of(one.link) | {one.outcome}
            outcomes = MappingProxyType({**pending.outcomes, one.link: reached})
            details, text = pending.details, f"{one.link}: {one.detail}"
            if text not in details:
                details = (*details, text)[-8:]
            self.put(slot, replace(pending, outcomes=outcomes, details=details))

    def _overtaken(self, number: tuple[int, int], link: str) -> bool:
        """A node that saw a later decision of ours before this one refuses this one as older."""
        others = [self.pending(slot) for slot in SLOTS]
        return any(
            other is not None and link in other.targets and other.number > number
            for other in others
        )

    def _overtake(self, one: i.ActionReport) -> None:
        """A node refuses what is older than it has seen: go on above that."""
        if one.newest_epoch >= _LARGEST_EPOCH:
            self.alarm(f"{one.link} has seen epoch {one.newest_epoch}, the largest: restart it")
            return
        epoch = one.newest_epoch + 1
        text = f"{one.link} has seen epoch {one.newest_epoch}: going on as {epoch}"
        self.outputs.append(i.Say(text))
        self.state = replace(self.state, epoch=epoch)
        for slot in SLOTS:
            pending = self.pending(slot)
            # What every target has begun with goes on there; a second order would start it again.
            if pending is not None and (slot == "block" or pending.not_begun()):
                self.renew(slot, f"{one.link} knows a newer epoch")
