"""What happened in a recorded flight: decisions with their outcomes, requests with their
answers, alarms, what devices and vehicle reported, and the rows of its timeline."""

from __future__ import annotations

import dataclasses
import enum
import typing
from dataclasses import dataclass, field

from chute_ros.model import FIRES, Decision, VehicleState
from chute_ros.ros.messages import decision_from, nanoseconds
from chute_ros.supervisor import inputs as i
from chute_ros.tools.recording import Recording
from chute_ros.tools.timeline_rows import ACTION_TONES, OUTCOME_TONES, Mark

DECISION, PERSON = "safety/decision", "safety/person"
#: The inputs by which somebody asks for something.
_REQUESTS = tuple(kind for kind in typing.get_args(i.Input) if kind.__name__.endswith("Request"))


@dataclass
class Decided:
    """A decision, when it was made (s from the start), and how it went on."""

    at: float
    decision: Decision
    #: How often it was sent again, nobody having reported on it.
    again: int = 0
    #: (s since the decision, report), each step of each link once.
    reports: list[tuple[float, i.ActionReport]] = field(default_factory=list)

    @property
    def tone(self) -> str:
        """Its colour."""
        return ACTION_TONES[self.decision.action]

    @property
    def name(self) -> str:
        """Its action in words."""
        return self.decision.action.name.replace("_", " ").lower()


@dataclass
class Asked:
    """A request, when it came (s from the start), and its answer. link: whose service was called;
    empty: the supervisor's."""

    at: float
    what: str
    details: str
    #: Seconds until the answer, and the answer; None: none came, or none is given.
    answer: tuple[float, i.Finish] | None = None
    link: str = ""


@dataclass
class FlightStory:
    """All of it, each list in the order of time, times in s from the start. requests: of the
    supervisor; calls: of device nodes' services; said: lines of the log; foreign_reports: on
    decisions that are not in the recording."""

    decisions: list[Decided] = field(default_factory=list)
    requests: list[Asked] = field(default_factory=list)
    calls: list[Asked] = field(default_factory=list)
    said: list[tuple[float, i.LogMessage]] = field(default_factory=list)
    statuses: list[tuple[float, i.ParachuteReport]] = field(default_factory=list)
    vehicle: list[tuple[float, VehicleState]] = field(default_factory=list)
    foreign_reports: list[tuple[float, i.ActionReport]] = field(default_factory=list)
    #: The recording has the topic of the calls, if only without any.
    has_calls: bool = True

    @property
    def alarms(self) -> list[tuple[float, str]]:
        """What was said as an alarm."""
        return [(at, say.text) for at, say in self.said if say.alarm]

    @property
    def parachutes(self) -> list[tuple[float, i.ParachuteReport]]:
        """The newest status of every parachute."""
        newest = {(one.link, one.status.device): (at, one) for at, one in self.statuses}
        return list(newest.values())

    @property
    def fired(self) -> list[float]:
        """When a kill or a deploy was decided, and when it was reported on, s."""
        moments = []
        for one in self.decisions:
            if one.decision.action in FIRES:
                moments += [one.at, *(one.at + after for after, _ in one.reports)]
        return moments

    def decision_marks(self) -> list[Mark]:
        """Each decision with its number in the table."""
        return [
            Mark(one.at, str(number), f"{one.name} by '{one.decision.rule}'", one.tone)
            for number, one in enumerate(self.decisions, 1)
        ]

    def report_marks(self) -> list[Mark]:
        """Each report of a link on a kill or a deploy."""
        marks = []
        for number, one in enumerate(self.decisions, 1):
            if one.decision.action not in FIRES:
                continue
            for after, report in one.reports:
                text = f"{report.link}: {one.name} {report.outcome.name}: {report.detail}"
                tone = OUTCOME_TONES[report.outcome]
                marks.append(Mark(one.at + after, f"{number} {report.outcome.name}", text, tone))
        return marks

    def alarm_marks(self) -> list[Mark]:
        """Each alarm."""
        return [Mark(at, "!", text, "bad") for at, text in self.alarms]


def tell(recording: Recording) -> FlightStory:
    """The story of a recording, of which DECISION and PERSON were read as well."""
    story = FlightStory(calls=_calls(recording), has_calls=recording.has(PERSON))
    decided = _published(recording)
    in_turns: set[tuple[int, int]] = set()
    waiting: dict[int, Asked] = {}
    for recorded in recording.turns:
        at = recording.seconds(recorded.wall)
        for one in recorded.turn.inputs:
            if isinstance(one, i.ActionReport):
                about = decided.get((one.epoch, one.id))
                if about is None:
                    story.foreign_reports.append((at, one))
                else:
                    _report(about, at, one)
            elif isinstance(one, i.ParachuteReport):
                story.statuses.append((at, one))
            elif isinstance(one, i.VehicleReport):
                story.vehicle.append((at, one.state))
            elif isinstance(one, _REQUESTS):
                asked = Asked(at, _words(type(one).__name__), fields_of(one))
                story.requests.append(asked)
                token = getattr(one, "token", 0)
                if token:
                    waiting[token] = asked
        for output in recorded.turn.outputs:
            if isinstance(output, i.Decide):
                key = (output.decision.epoch, output.decision.id)
                if key in in_turns:
                    decided[key].again += 1
                else:
                    in_turns.add(key)
                    decided[key] = Decided(at, output.decision)
            elif isinstance(output, i.Finish):
                answered = waiting.pop(output.token, None)
                if answered is not None:
                    answered.answer = (at - answered.at, output)
            elif isinstance(output, i.LogMessage):
                story.said.append((at, output))
    story.decisions += sorted(decided.values(), key=lambda one: one.at)
    return story


def fields_of(one: object) -> str:
    """The fields of an input in words, but the token, which says nothing to a person."""
    told = []
    for each in dataclasses.fields(one):  # type: ignore[arg-type]
        value = getattr(one, each.name)
        if each.name == "token" or value in ("", ()):
            continue
        if isinstance(value, enum.Enum):
            value = value.name
        told.append(f"{each.name.replace('_', ' ')}: {value}")
    return ", ".join(told)


def _published(recording: Recording) -> dict[tuple[int, int], Decided]:
    """By what was said on the topic: what is decided at a takeover is in no turn."""
    found: dict[tuple[int, int], Decided] = {}
    for wall, message in recording.messages.get(DECISION, []):
        decision = decision_from(message)
        key = (decision.epoch, decision.id)
        found.setdefault(key, Decided(recording.seconds(wall), decision))
    return found


def _calls(recording: Recording) -> list[Asked]:
    """Each with its answer, which has the stamp of its call."""
    found: dict[tuple[str, str, int], Asked] = {}
    for wall, message in recording.messages.get(PERSON, []):
        key = (message.link, message.service, nanoseconds(message.header.stamp))
        at = recording.seconds(wall)
        if message.answered:
            finish = i.Finish(0, message.success, message.accepted, message.message)
            # The recording may have begun between the two.
            asked = Asked(at - message.after, message.service, message.request, link=message.link)
            found.setdefault(key, asked).answer = (message.after, finish)
        else:
            found[key] = Asked(at, message.service, message.request, link=message.link)
    return sorted(found.values(), key=lambda one: one.at)


def _report(decided: Decided, at: float, report: i.ActionReport) -> None:
    known = {(one.link, one.outcome, one.detail) for _, one in decided.reports}
    if (report.link, report.outcome, report.detail) not in known:
        decided.reports.append((at - decided.at, report))


def _words(name: str) -> str:
    """ "DeployRequest" -> "deploy"."""
    return name.removesuffix("Request").lower()
