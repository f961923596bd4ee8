"""The loops of the soak on one vehicle: fault, measure, judge."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from chute_ros.model import Action
from chute_ros.supervisor.machine import Stage
from faults.soak_faults import Fault
from faults.soak_judge import ANSWER_WITHIN, NAN, WHOLE_WITHIN, Happened, judge
from faults.soak_plan import MOTOR, Plan
from faults.soak_processes import Sample
from faults.soak_relay import DEPLOY, KILL
from faults.soak_vehicle import Vehicle

_TELL_AGAIN = 0.5  # s
_HIGH_WITHIN = 60.0  # s


@dataclass
class Result:
    """One loop. Times in s, NaN: not measured."""

    plan: Plan
    supervisors: int
    findings: list[str] = field(default_factory=list)
    heartbeats_missed: int = 0
    frames_dropped: int = 0
    decisions_unanswered: int = 0
    entries_lost: int = 0
    #: From the end of the fault, or the kill of a process.
    until_whole: float = NAN
    #: From the cause, or the end of the fault if that is later.
    until_kill: float = NAN
    until_out: float = NAN
    #: (name, which of its lives) -> what it held once it was whole again.
    samples: dict[tuple[str, int], Sample] = field(default_factory=dict)


class Loops:
    """Runs plans one after another, on a vehicle that is in the air."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self._mistakes: set[str] = set()

    def run(self, plan: Plan) -> Result:
        """One loop; SoakError if the vehicle does not get into the air any more."""
        vehicle = self.vehicle
        if not vehicle.flies():
            vehicle.new_flight()
        if plan.cause:
            vehicle.must("it is high enough", _HIGH_WITHIN, vehicle.is_high)
        result = Result(plan, len(vehicle.supervisors))
        began = time.monotonic()
        missed = vehicle.watch.heartbeats_missed.total()
        dropped, lost = vehicle.wires.dropped(), vehicle.watch.recording_lost()
        seen = self._fly(plan)
        result.findings = judge(seen)
        result.until_whole = seen.whole_at - seen.fault_over
        begins = max(seen.cause_at, seen.fault_over)
        result.until_kill = min(seen.killed, default=NAN) - begins
        result.until_out = min((when for when, _ in seen.released), default=NAN) - begins
        result.heartbeats_missed = vehicle.watch.heartbeats_missed.total() - missed
        result.frames_dropped = vehicle.wires.dropped() - dropped
        result.decisions_unanswered = vehicle.watch.unanswered(began, time.monotonic() - 1.0)
        result.entries_lost = max(0, vehicle.watch.recording_lost() - lost)
        for name, child in vehicle.keeper.children.items():
            if vehicle.keeper.running():
                result.samples[name, child.life] = vehicle.keeper.sample(name)
        return result

    def _fly(self, plan: Plan) -> Happened:
        vehicle, seen = self.vehicle, Happened()
        began, vehicle.held_up = time.monotonic(), 0.0
        vehicle.rest(plan.after)
        fault = Fault(vehicle, plan)
        seen.fault_at = time.monotonic()
        fault.begin()
        try:
            cause = self._cause(plan, seen)
            while time.monotonic() < seen.fault_at + plan.seconds:
                vehicle.turn()
                cause()
        finally:
            fault.end()
        seen.fault_over = time.monotonic()
        if plan.cause:
            self._await_answer(cause, began)
        elif vehicle.until(WHOLE_WITHIN, lambda: self._whole_since(seen.fault_over)):
            seen.whole_at = time.monotonic()
        else:
            seen.complaints = vehicle.watch.complaints()
        self._note(seen, plan, began)
        return seen

    def _cause(self, plan: Plan, seen: Happened) -> Callable[[], bool]:
        """To be called again and again: brings the cause about; whether it is there."""
        if not plan.cause:
            return lambda: True
        vehicle, due = self.vehicle, seen.fault_at + plan.cause_after
        again_at = due
        if plan.cause != MOTOR:
            ask = vehicle.ask_deploy()

            def person() -> bool:
                if time.monotonic() < due:
                    return False
                if math.isnan(seen.cause_at):
                    seen.cause_at = time.monotonic()
                return self._stage() is not Stage.IN_FLIGHT or ask()

            return person

        def motor() -> bool:
            nonlocal again_at
            now = time.monotonic()
            if now >= again_at and math.isnan(seen.cause_at):
                vehicle.pilot.fail_motor()
                again_at = now + _TELL_AGAIN
            for one in vehicle.told:
                if one.when >= due and "MOTOR FAILURE" in one.line and math.isnan(seen.cause_at):
                    # Read a little later than it was; nothing can answer it before.
                    seen.cause_at = max(due, one.when - _TELL_AGAIN)
            return not math.isnan(seen.cause_at)

        return motor

    def _await_answer(self, cause: Callable[[], bool], since: float) -> None:
        vehicle = self.vehicle
        vehicle.until(10.0, cause)
        vehicle.until(
            ANSWER_WITHIN,
            lambda: bool(
                vehicle.deployed(since)
                and vehicle.killed(since)
                and self._stage() is Stage.DEPLOYED
            ),
        )
        # Whoever would still fire does it within its next turns.
        vehicle.rest(0.5)

    def _whole_since(self, when: float) -> bool:
        return self.vehicle.watch.diagnostics_after(when) and self.vehicle.whole()

    def _stage(self) -> Stage:
        return Stage(self.vehicle.watch.safety.state)

    def _note(self, seen: Happened, plan: Plan, began: float) -> None:
        vehicle = self.vehicle
        seen.held_up = vehicle.held_up
        seen.orders = [(one.when, one.what) for one in vehicle.wires.orders if one.when >= began]
        seen.released = [(one.when, one.name) for one in vehicle.deployed(began)]
        seen.killed = [one.when for one in vehicle.killed(began)]
        seen.decided = [
            (when, text)
            for action, text in ((Action.KILL, KILL), (Action.DEPLOY, DEPLOY))
            for when, _ in vehicle.watch.decided(action, began)
        ]
        meant = Stage.DEPLOYED if plan.cause else Stage.IN_FLIGHT
        seen.state_text, seen.ended_as_meant = self._stage().name, self._stage() is meant
        new = [one for one in vehicle.watch.mistakes() if one not in self._mistakes]
        self._mistakes.update(new)
        seen.troubles = [*vehicle.keeper.findings, *new]
        vehicle.keeper.findings.clear()
        for words in vehicle.keeper.last_words:
            print(words, flush=True)
        vehicle.keeper.last_words.clear()
