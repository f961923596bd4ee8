"""Every release of a recorded flight, ordered or not: by whose order, what was reported of it and
what was not. Nothing in it that the recording does not show."""

from __future__ import annotations

import bisect
from collections.abc import Iterator
from dataclasses import dataclass, field

from chute_msgs.srv import ParachuteAction, UpfCommand

from chute_ros.model import (
    NAN,
    Action,
    Decision,
    DeploymentTrigger,
    LinkState,
    Outcome,
    ParachuteStatus,
    VehicleState,
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
class Motion:
    """Height, m above take-off, and vertical speed, m/s, up positive, as the vehicle reported
    them last, with their ages, s. NaN: not known."""

    height: float = NAN
    height_age: float = NAN
    vertical_speed: float = NAN
    vertical_speed_age: float = NAN


@dataclass(frozen=True)
class Step:
    """What somebody reported of a release. after: the order, s; tone: a colour's name."""

    after: float
    who: str
    what: str
    tone: str
    detail: str = ""


@dataclass
class Release:
    """An order to release, or a parachute that was released without one. at: s from the start;
    parachute: link and device; order: who or what ordered it; missing: what did not come."""

    at: float
    parachute: str
    order: str
    reasons: tuple[str, ...] = ()
    motion: Motion = Motion()
    steps: list[Step] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)


@dataclass
class _Order:
    """An order to a link, before its effect is known. until: of its last report, s; is_refused:
    its device or node says that it will not carry it out, or could not."""

    link: str
    device: str
    release: Release
    until: float
    is_sent: bool = True
    is_refused: bool = False
    effects: list[_Turned] = field(default_factory=list)

    def explains(self, turned: _Turned) -> bool:
        named = self.device in ("", _PAST_THE_CONTROLLER, turned.status.device)
        in_time = self.release.at <= turned.at <= self.until + _EFFECT_WITHIN
        return self.is_sent and self.link == turned.link and named and in_time


@dataclass(frozen=True)
class _Turned:
    """A parachute's own status says deployed. silent: since it said that it was not, s."""

    at: float
    link: str
    status: ParachuteStatus
    silent: float


def releases(story: FlightStory, end: float) -> list[Release]:
    """All of a story, in the order of time. end: of the recording, s from the start."""
    own = _Own(story)
    orders = [*_decided(story, end), *_called(story, end)]
    foreign = list(_foreign(story))
    found = list(_in_vain(story, end))
    for turned in own.turned:
        order = _newest(orders, turned)
        if order is None and (order := _newest(foreign, turned)) is not None:
            orders.append(order)
        if order is None:
            found.append(_unordered(turned))
        else:
            order.effects.append(turned)
    for order in orders:
        own.add_effects(order, end)
        found.append(order.release)
    found.sort(key=lambda one: one.at)
    for one in found:
        one.motion = _motion(story.vehicle, one.at)
        one.steps.sort(key=lambda step: step.after)
    return found


class _Own:
    """What the parachutes say themselves."""

    def __init__(self, story: FlightStory) -> None:
        #: (link, device) -> (s, deployed) of every report of the device itself.
        self._told: dict[tuple[str, str], list[tuple[float, bool]]] = {}
        self.turned: list[_Turned] = []
        for at, report in story.statuses:
            status = report.status
            if status.link_state is not LinkState.OK:
                continue  # its node repeats what was
            told = self._told.setdefault((report.link, status.device), [])
            if status.deployed and told and not told[-1][1]:
                self.turned.append(_Turned(at, report.link, status, at - told[-1][0]))
            told.append((at, status.deployed))

    def add_effects(self, order: _Order, end: float) -> None:
        """What the parachutes of an order's link say after it."""
        release = order.release
        for turned in order.effects:
            release.steps.append(_step(turned, turned.at - release.at))
        devices = [
            device
            for link, device in self._told
            if link == order.link and order.device in ("", _PAST_THE_CONTROLLER, device)
        ]
        reached = [turned.status.device for turned in order.effects] or devices
        named = ", ".join(reached) if len(reached) == 1 or order.effects else order.device
        release.parachute = f"{order.link} {named}".strip()
        if order.effects or not order.is_sent:
            return
        out = [device for device in devices if self._was_out(order.link, device, release.at)]
        for device in out:
            text = f"{device} reported it before the order"
            release.steps.append(Step(0.0, "own status", "deployed already", "quiet", text))
        later = (one.at for one in self.turned if self._is_of(one, order, devices))
        if (at := min(later, default=None)) is not None:
            release.missing.append(f"not deployed by it: its own status says so at {at:.3f} s")
            return
        after = any(self._told[order.link, device][-1][0] > release.at for device in devices)
        if not after:
            release.missing.append(
                f"no status of a parachute of {order.link} in the {end - release.at:.1f} s to the "
                "recording's end"
            )
        elif not out:
            release.missing.append(
                f"no own status that says deployed in the {end - release.at:.1f} s to the "
                "recording's end"
            )

    @staticmethod
    def _is_of(turned: _Turned, order: _Order, devices: list[str]) -> bool:
        """A later release of what the order was for."""
        same = turned.link == order.link and turned.status.device in devices
        return same and turned.at >= order.release.at

    def _was_out(self, link: str, device: str, at: float) -> bool:
        before = [deployed for when, deployed in self._told[link, device] if when <= at]
        return bool(before) and before[-1]


def _step(turned: _Turned, after: float) -> Step:
    number = turned.status.deployment_trigger
    trigger = f"trigger {trigger_name(number)}" if number else "no trigger named"
    text = f"{turned.status.device}, {trigger}; not deployed {turned.silent:.1f} s before"
    return Step(after, "own status", "deployed", "act", text)


def trigger_name(number: int) -> str:
    """What released a parachute by its own report (ParachuteStatus.deployment_trigger)."""
    known = number in DeploymentTrigger._value2member_map_
    return DeploymentTrigger(number).name if known else f"number {number}"


def _newest(orders: list[_Order], turned: _Turned) -> _Order | None:
    """The order that a release is taken for the effect of: the newest, rather one that was not
    refused."""
    explaining = [one for one in orders if one.explains(turned)]
    return max(explaining, key=lambda one: (not one.is_refused, one.release.at), default=None)


def _decided(story: FlightStory, end: float) -> Iterator[_Order]:
    """One for each link that a decision to deploy is for."""
    for one in story.decisions:
        if one.decision.action is Action.DEPLOY:
            for link in one.decision.targets or ("nobody",):
                yield _decision(one, link, end)


def _decision(one: Decided, link: str, end: float) -> _Order:
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
    is_refused = Outcome.FAILED in reached and Outcome.CONFIRMED not in reached
    return _Order(link, decision.device, release, until, is_sent, is_refused)


def _report(after: float, report: i.ActionReport) -> Step:
    tone = OUTCOME_TONES[report.outcome]
    return Step(after, report.link, report.outcome.name, tone, report.detail)


def _called(story: FlightStory, end: float) -> Iterator[_Order]:
    for call in story.calls:
        if any(call.what == name and call.details.startswith(begin) for name, begin in _RELEASING):
            order = f"a call of {call.what} of {call.link}, past the supervisor"
            release = Release(call.at, call.link, order, (call.details,))
            until = call.at + _add_answer(release, call, call.link, end)
            finish = call.answer and call.answer[1]
            is_refused = finish is not None and not (finish.success or finish.accepted)
            yield _Order(call.link, "", release, until, is_refused=is_refused)


def _in_vain(story: FlightStory, end: float) -> Iterator[Release]:
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
    release.steps.append(Step(after, who, f"answered: {what}", tone, finish.message))
    return after


def _foreign(story: FlightStory) -> Iterator[_Order]:
    """Decisions of which only the reports were recorded. Whether they deploy is not known: they
    count only where a parachute came out after them."""
    found: dict[tuple[int, int, str], _Order] = {}
    for at, report in story.foreign_reports:
        key = (report.epoch, report.id, report.link)
        if key not in found:
            named = Decision(report.epoch, report.id, Action.NONE, "", (), ()).named
            text = f"{named}, not in this recording: of another supervisor, or before it"
            found[key] = _Order(report.link, "", Release(at, report.link, text), at)
        order = found[key]
        order.until = at
        order.release.steps.append(_report(at - order.release.at, report))
    yield from found.values()


def _unordered(turned: _Turned) -> Release:
    order = "no order is in this recording: the device itself, or by hand"
    release = Release(turned.at, f"{turned.link} {turned.status.device}", order)
    release.steps.append(_step(turned, 0.0))
    return release


def _motion(vehicle: list[tuple[float, VehicleState]], at: float) -> Motion:
    """By the newest report until then."""
    number = bisect.bisect_right(vehicle, at, key=lambda one: one[0])
    if not number:
        return Motion()
    when, state = vehicle[number - 1]
    older = at - when
    return Motion(
        state.height,
        state.height_age + older,
        state.vertical_speed,
        state.vertical_speed_age + older,
    )
