"""Orders to release in a recorded flight, each with what was reported of it and what was not."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from dataclasses import dataclass, field

from chute_msgs.srv import ParachuteAction, UpfCommand

from chute_ros.model import (
    NAN,
    Action,
    Decision,
    DeploymentTrigger,
    Outcome,
    ParachuteStatus,
    name_of,
)
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.gate import OPERATOR
from chute_ros.tools.flight_story import Asked, Decided, FlightStory
from chute_ros.tools.timeline_rows import OUTCOME_TONES

#: Calls that order a release: the service, and how its request in words begins.
_RELEASING = (
    ("~/deploy", ""),
    ("~/parachute_action", f"action={ParachuteAction.Request.RELEASE},"),
    ("~/command", f"command={UpfCommand.Request.DEPLOY},"),
    ("~/command", f"command={UpfCommand.Request.DEPLOY_FORCE},"),
    ("~/command", "command='drogue',"),
    ("~/command", "command='main',"),
)
#: A parachute that reports deployed so long after the last report on an order (s), or later, is
#: not taken for its effect.
_EFFECT_WITHIN = 10.0
#: SafetyDecision.device of a deploy past the controller of a UPF parachute.
_PAST_THE_CONTROLLER = "trigger"
_STEPS = (Outcome.SENT, Outcome.ACCEPTED, Outcome.CONFIRMED)


@dataclass(frozen=True)
class MotionThen:
    """Height, m above take-off, and vertical speed, m/s, up positive, as the vehicle reported
    them last, with their ages, s. NaN: not known."""

    height: float = NAN
    height_age: float = NAN
    vertical_speed: float = NAN
    vertical_speed_age: float = NAN


@dataclass(frozen=True)
class ReleaseStep:
    """What somebody reported of a release. after: the order, s; tone: a colour's name."""

    after: float
    who: str
    what: str
    tone: str
    detail: str = ""


class Fate(enum.Enum):
    """What became of an order to release."""

    RELEASED = "Released"
    UNCONFIRMED = "Ordered, without a report that it was released by this"
    REFUSED = "Ordered, and refused or failed"
    NOT_SENT = "Decided, and not sent"


@dataclass
class Release:
    """An order to release, or a parachute that was released without one. at: s from the start;
    parachute: link and device; order: who or what ordered it; missing: what did not come."""

    at: float
    parachute: str
    order: str
    reasons: tuple[str, ...] = ()
    motion: MotionThen = MotionThen()
    steps: list[ReleaseStep] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    fate: Fate = Fate.UNCONFIRMED


@dataclass(frozen=True)
class TurnedDeployed:
    """A parachute's own status says deployed. silent: since it said that it was not, s."""

    at: float
    link: str
    status: ParachuteStatus
    silent: float


@dataclass
class ReleaseOrder:
    """An order to a link, before its effect is known. until: of its last report, s; is_refused:
    its device or node says that it will not carry it out, or could not."""

    link: str
    device: str
    release: Release
    until: float
    is_sent: bool = True
    is_refused: bool = False
    #: Its node reports that it was carried out.
    is_confirmed: bool = False
    effects: list[TurnedDeployed] = field(default_factory=list)

    def is_for(self, device: str) -> bool:
        """Whether it may release this device of its link."""
        return self.device in ("", _PAST_THE_CONTROLLER, device)

    def explains(self, turned: TurnedDeployed) -> bool:
        """Whether a release may be its effect."""
        named = self.link == turned.link and self.is_for(turned.status.device)
        in_time = self.release.at <= turned.at <= self.until + _EFFECT_WITHIN
        return self.is_sent and named and in_time


def trigger_of(status: ParachuteStatus) -> str:
    """What released a parachute that says deployed, as itself says."""
    number = status.deployment_trigger
    return f"trigger {name_of(DeploymentTrigger, number)}" if number else "no trigger named"


def decided(story: FlightStory, end: float) -> Iterator[ReleaseOrder]:
    """One for each link that a decision to deploy is for."""
    for one in story.decisions:
        if one.decision.action is Action.DEPLOY:
            for link in one.decision.targets or ("nobody",):
                yield _decision(one, link, end)


def _decision(one: Decided, link: str, end: float) -> ReleaseOrder:
    decision = one.decision
    order = f"rule '{decision.rule}'"
    if decision.rule == OPERATOR:
        order = f"a person's request at safety/deploy (rule '{OPERATOR}')"
    release = Release(one.at, link, f"{order}, {decision.named}", decision.reasons)
    reports = [(after, report) for after, report in one.reports if report.link == link]
    release.steps += [_report(after, report) for after, report in reports]
    reached = {report.outcome for _, report in reports}
    rest = f"in the {end - one.at:.1f} s to the recording's end"
    if decision.shadow:
        release.missing.append("not sent: the decision is marked SHADOW")
    elif not decision.targets:
        release.missing.append("not sent: the decision names no parachute")
    elif not reached:
        release.missing.append(f"no report of {link} on this decision {rest}")
    elif Outcome.CONFIRMED not in reached:
        lacking = [f"no {step.name}" for step in _STEPS if step not in reached]
        release.missing.append(f"{', '.join(lacking)} {rest}")
    until = one.at + max((after for after, _ in reports), default=0.0)
    is_sent = bool(decision.targets) and not decision.shadow
    confirmed = Outcome.CONFIRMED in reached
    refused = not confirmed and bool(reached & {Outcome.FAILED, Outcome.REFUSED})
    return ReleaseOrder(
        link,
        decision.device,
        release,
        until,
        is_sent=is_sent,
        is_refused=refused,
        is_confirmed=confirmed,
    )


def _report(after: float, report: i.ActionReport) -> ReleaseStep:
    tone = OUTCOME_TONES[report.outcome]
    return ReleaseStep(after, report.link, report.outcome.name, tone, report.detail)


def called(story: FlightStory, end: float) -> Iterator[ReleaseOrder]:
    for call in story.calls:
        if any(call.what == name and call.details.startswith(begin) for name, begin in _RELEASING):
            order = f"a call of {call.what} of {call.link}, past the supervisor"
            release = Release(call.at, call.link, order, (call.details,))
            until = call.at + _add_answer(release, call, call.link, end)
            finish = call.answer and call.answer[1]
            refused = finish is not None and not (finish.success or finish.accepted)
            confirmed = finish is not None and finish.success
            yield ReleaseOrder(
                call.link, "", release, until, is_refused=refused, is_confirmed=confirmed
            )


def in_vain(story: FlightStory, end: float) -> Iterator[Release]:
    """Requests at safety/deploy after which nothing was decided."""
    for one in story.requests:
        if one.what != "deploy":
            continue
        until = end if one.answer is None else one.at + one.answer[0]
        decided = (d.at for d in story.decisions if d.decision.action is Action.DEPLOY)
        if any(one.at <= at <= until for at in decided):
            continue
        order = "a person's request at safety/deploy"
        release = Release(one.at, "none", order, (one.details,))
        _add_answer(release, one, "supervisor", end)
        release.missing.append("no decision to deploy followed")
        if one.answer is not None:
            release.fate = Fate.REFUSED
        yield release


def _add_answer(release: Release, asked: Asked, who: str, end: float) -> float:
    """How long it took, s; 0: there is none."""
    if asked.answer is None:
        rest = end - asked.at
        release.missing.append(f"no answer in the {rest:.1f} s to the recording's end")
        return 0.0
    after, finish = asked.answer
    tone, what = ("good", "success") if finish.success else ("bad", "no success")
    what += ", accepted" if finish.accepted else ""
    release.steps.append(ReleaseStep(after, who, f"answered: {what}", tone, finish.message))
    return after


def foreign(story: FlightStory) -> Iterator[ReleaseOrder]:
    """Decisions of which only the reports were recorded. Whether they deploy is not known: they
    count only where a parachute came out after them."""
    found: dict[tuple[int, int, str], ReleaseOrder] = {}
    for at, report in story.foreign_reports:
        key = (report.epoch, report.id, report.link)
        if key not in found:
            named = Decision(report.epoch, report.id, Action.NONE, "", (), ()).named
            text = f"{named}, not in this recording: of another supervisor, or before it"
            found[key] = ReleaseOrder(report.link, "", Release(at, report.link, text), at)
        order = found[key]
        order.until = at
        order.release.steps.append(_report(at - order.release.at, report))
    yield from found.values()
