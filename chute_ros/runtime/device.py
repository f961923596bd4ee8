"""Runtime of every device node: heartbeats, decisions, reports, requests, the flight block.

A subclass for each kind of device says what its link is told. Nothing here knows ROS, a thread, a
file or the clock: the shell carries out what it says, and gives it events and the time.
"""

from __future__ import annotations

import enum
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, Generic, Protocol, TypeVar

from chute_ros.model import Action, Decision, LinkState, Outcome
from chute_ros.protocol.events import (
    DeviceLinkChanged,
    Notice,
    ParachuteChanged,
    RequestFinished,
    RequestReport,
    Severity,
    VehicleChanged,
    failed_request,
)
from chute_ros.runtime.decisions import DecisionCarrier
from chute_ros.runtime.requests import Begin, CallFailed, RequestTracker
from chute_ros.runtime.shell import Shell
from chute_ros.runtime.topics import (
    DeviceBeat,
    ParachuteTold,
    SafetyPicture,
    SupervisorBeat,
    VehicleTold,
)
from chute_ros.runtime.watch import SupervisorWatch
from chute_ros.settings import Settings, parameter
from chute_ros.supervisor.inputs import ParachuteReport, VehicleReport

#: Our own heartbeat on the wire stops when the owner was silent for this long, s.
OWNER_SILENCE = 1.0
#: Diagnostics are published each second: what they are made of need not be newer, s.
_DETAILS_INTERVAL = 0.5
#: Numbers of heartbeats begin anew here.
_SEQUENCES = 2**32


class OnSupervisorLost(enum.Enum):
    """What a lost supervisor means for the vehicle."""

    HOLD = "hold"
    BLOCK_FLIGHT = "block_flight"


class LinkConfig(Protocol):
    """The settings of any link."""

    @property
    def give_up_after(self) -> float:
        """Limit for all tries of a command together, s."""


@dataclass(frozen=True)
class DeviceSettings(Settings):
    """Settings of every device node; a subclass says which its link has."""

    link: LinkConfig
    max_decision_age: float = parameter(
        0.5, "a decision of the supervisor older than this is not carried out", 0.05, 10.0, "s"
    )
    heartbeat_rate: float = parameter(
        10.0,
        "rate of safety/heartbeat; below 4 Hz the supervisor's heartbeat_stale_after or "
        "link_limits must allow for it",
        1.0,
        100.0,
        "Hz",
    )
    supervisor_lost_after: float = parameter(
        1.0, "a supervisor that was received is lost after this silence", 0.2, 60.0, "s"
    )
    on_supervisor_lost: OnSupervisorLost = parameter(
        OnSupervisorLost.BLOCK_FLIGHT,
        "reaction to a lost supervisor: hold keeps to the last decision; block_flight also blocks "
        "flight on the ground, and does nothing in flight; upf_can cannot block flight",
    )


@dataclass(frozen=True)
class Summary:
    """The answer of the link to the owner's heartbeat."""

    link_state: LinkState
    device_healthy: bool
    #: Since the device was heard, s.
    age: float
    #: Why the device is not healthy, in words.
    reasons: tuple[str, ...] = ()
    #: What diagnostics are made of.
    details: Any = None


@dataclass(frozen=True)
class CarriedOut:
    """The link has done what a decision wants."""

    decision: Decision
    text: str


def block_reason(decision: Decision) -> str:
    """Why this decision keeps the vehicle on the ground; empty: it lets it go."""
    if decision.action is Action.FLIGHT_BLOCK_RELEASE:
        return ""
    return "; ".join(decision.reasons) or decision.rule


SettingsT = TypeVar("SettingsT", bound=DeviceSettings)


class DeviceRuntime(ABC, Generic[SettingsT]):
    """details: in the link's turn, what diagnostics are made of, twice a second."""

    #: Events that may be left out where the owner does not keep up: the next one tells the same.
    PICTURES: tuple[type, ...] = (ParachuteChanged, VehicleChanged)
    #: Of these the next one tells all that one before it told.
    REPLACED: tuple[type, ...] = (VehicleChanged,)
    #: Events that need only be told of, within a heartbeat's interval.
    UNHURRIED: tuple[type, ...] = ()
    #: What this node says to its device keeps a vehicle on the ground: the link has
    #: flight_block(reason, now), where an empty reason lets it go.
    BLOCKS_FLIGHT = True

    def __init__(
        self,
        name: str,
        settings: SettingsT,
        shell: Shell,
        details: Callable[[Any, float], Any] = lambda link, now: None,
    ) -> None:
        self.name, self.settings, self.shell = name, settings, shell
        self._details = details
        self.watch = SupervisorWatch(settings.max_decision_age, settings.supervisor_lost_after)
        self.decisions = DecisionCarrier(
            *(name, settings.max_decision_age, shell, self.watch.age),
            *(self.carry_out, self.decided_for_others),
        )
        self.desk = RequestTracker(shell, self.decisions.report)
        #: The newest answer of the link; None: none came yet.
        self.summary: Summary | None = None
        #: Of the link's turn: what diagnostics are made of, and when that is renewed, monotonic s.
        self._newest_details: Any = None
        self._details_due = -math.inf
        #: Why flight is blocked by decision; empty: it is not.
        self.decided_block = ""
        self._seq = count()

    # -- for the subclass to fill ---------------------------------------------------------------

    @abstractmethod
    def summarise(self, link: Any, now: float) -> Summary:
        """In the link's turn: how the device is. details are filled in by whoever asks."""

    @abstractmethod
    def carry_out(self, decision: Decision) -> None:
        """Do what the gate let through."""

    def decided_for_others(self, decision: Decision) -> None:
        """Another node carries this out; it may come again."""

    def failed_end(self, token: int, text: str) -> Any:
        """The end of a request that could not be begun."""
        return failed_request(token, text)

    def in_turn(self, events: list[Any]) -> None:
        """In the link's turn, before events wait for the owner: what cannot wait."""

    def event(self, event: Any) -> None:
        """One that only this kind of link has; by default for who follows its type."""
        self.shell.publish(event)

    def picture(self, one: SafetyPicture) -> None:
        """The supervisor's picture came."""

    # -- what comes over ROS --------------------------------------------------------------------

    def heard_decisions(self, waiting: Iterable[tuple[Decision, float]], now: float) -> None:
        """Each with the wall clock here less its stamp, s."""
        self.decisions.heard(waiting, now)

    def heard_supervisor(self, beat: SupervisorBeat, difference: float, now: float) -> None:
        """A supervisor's heartbeat."""
        self.watch.heartbeat(beat, difference, now)

    def heard_picture(self, one: SafetyPicture, difference: float, now: float) -> None:
        """The supervisor's picture."""
        self.watch.picture(one, self.name, difference, now)
        self.picture(one)

    # -- what a person asks ---------------------------------------------------------------------

    def arm(self, arm: bool, triggers: int, answered: Callable[[Any], None]) -> None:
        """Arm the parachute, or disarm it; answered gets the end."""
        self.desk.request(lambda link, token, now: link.arm(token, arm, triggers, now), answered)

    def deploy(self, force: bool, answered: Callable[[Any], None]) -> None:
        """Release the parachute; answered gets the end."""
        self.desk.request(lambda link, token, now: link.deploy(token, force, now), answered)

    # -- what comes from the link ---------------------------------------------------------------

    def take(self, event: Any, now: float) -> None:
        """In the owner's turn: an event of the link."""
        if isinstance(event, Summary):
            self._publish_beat(event, now)
        elif isinstance(event, ParachuteChanged):
            picture = ParachuteReport(self.name, event.status)
            self.shell.publish(ParachuteTold(picture, event.received))
        elif isinstance(event, VehicleChanged):
            # It has waited for its turn: no part of it is as new as it was.
            vehicle = VehicleReport(event.state.aged(now - event.made))
            self.shell.publish(VehicleTold(vehicle, now))
        elif isinstance(event, RequestReport):
            report = event.report
            self.desk.report(report.token, report.outcome, report.detail)
        elif isinstance(event, RequestFinished):
            self.desk.finished(event.finished.token, event)
        elif isinstance(event, CarriedOut):
            self.decisions.report(event.decision, Outcome.CONFIRMED, event.text)
        elif isinstance(event, CallFailed):
            self.desk.report(event.token, Outcome.FAILED, event.text)
            self.desk.finished(event.token, self.failed_end(event.token, event.text))
        elif isinstance(event, DeviceLinkChanged):
            self.shell.log(link_notice(event))
        elif isinstance(event, Notice):
            self.shell.log(event)
        else:
            self.event(event)

    # -- time -----------------------------------------------------------------------------------

    def beat(self, now: float) -> None:
        """Once each interval of the heartbeat, which makes one round: the link answers with a
        summary, which is published. A hang of either turn is silence."""
        self.shell.at_turns_end(self._answer)
        if self.desk.holds:
            self.shell.in_link(self.desk.try_held)
        lost = self.watch.look(now)
        if lost is not None:
            self._supervisor_lost(lost)

    # -- what the subclass may use ---------------------------------------------------------------

    def carry_out_at_once(
        self, decision: Decision, function: Callable[[Any, float], None], text: str
    ) -> None:
        """Have function(link, now) called in the link's turn, and report text once it was."""

        def run(link: Any, now: float) -> None:
            function(link, now)
            self.shell.deliver([CarriedOut(decision, text)])

        self.shell.in_link(run)

    def carry_out_flight_block(self, decision: Decision, blocked: str, released: str) -> None:
        """What the supervisor decided of it, reported with one of the two texts."""
        self.decided_block = reason = block_reason(decision)
        text = blocked if reason else released
        self.carry_out_at_once(decision, lambda link, now: link.flight_block(reason, now), text)

    def deploy_for(self, decision: Decision, begin: Begin) -> None:
        """Have begin(link, token, now) called for a decision, once a parachute is heard."""
        wait = self.settings.link.give_up_after
        self.desk.request_once(decision, begin, lambda link: link.has_parachute(), wait)

    # -- inside ---------------------------------------------------------------------------------

    def _answer(self, link: Any, now: float) -> None:
        link.owner_alive(now + OWNER_SILENCE)
        if now >= self._details_due:
            self._details_due = now + _DETAILS_INTERVAL
            self._newest_details = self._details(link, now)
        summary = replace(self.summarise(link, now), details=self._newest_details)
        self.shell.deliver([summary])

    def _publish_beat(self, one: Summary, now: float) -> None:
        self.summary = one
        beat = DeviceBeat(
            self.name,
            one.link_state,
            one.device_healthy,
            next(self._seq) % _SEQUENCES,
            one.age,
            one.reasons,
            self.shell.behind(),
        )
        self.watch.sent(self.shell.publish(beat), now)

    def _supervisor_lost(self, lost: bool) -> None:
        """Nobody would stop the motors: a vehicle that stands stays where it is."""
        wanted = self.settings.on_supervisor_lost is OnSupervisorLost.BLOCK_FLIGHT
        blocks = wanted and self.BLOCKS_FLIGHT
        if lost:
            what = "flight is blocked" if blocks else "held"
            self.shell.log(Notice(Severity.ERROR, f"the supervisor is lost: {what}"))
        else:
            self.shell.log(Notice(Severity.WARNING, "the supervisor is back"))
        if blocks:
            reason = "the supervisor is lost" if lost else self.decided_block
            self.shell.in_link(lambda link, now: link.flight_block(reason, now))


def link_notice(event: DeviceLinkChanged) -> Notice:
    """At the level that it deserves."""
    change = event.change
    if change.before is LinkState.NEVER_SEEN:
        return Notice(Severity.INFO, f"{event.name} received for the first time")
    after = f"after {change.silence:.1f} s of silence"
    if change.regained:
        return Notice(Severity.WARNING, f"{event.name} regained {after}")
    if change.after is LinkState.OK:
        return Notice(Severity.INFO, f"{event.name} is OK again {after}")
    silent = f"silent for {change.silence:.1f} s"
    return Notice(Severity.WARNING, f"{event.name} is {change.after.name}: {silent}")
