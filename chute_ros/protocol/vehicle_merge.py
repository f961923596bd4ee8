"""One picture of the vehicle from several sources, each part with its own source and age.

For each part of the picture (readings.PARTS) the newest word of every source is kept, with the
time of its receipt; a source that says that it does not know a part any more takes its earlier
word back. Of the sources that give a part, the first in the user's order counts as long as its
word is fresh; when that is old, the first other one with a fresh word; when all are old, the
newest. Old words keep their true age: the supervisor decides how old is too old.

Two sources that tell otherwise of the same part at the same time dispute it: one of them lies, and
mostly nobody knows which. Where one of them leapt as nothing that flies well does, and the other
lives and did not, the doubt is the first one's alone. One that jumps as nothing at all does
disputes its own word. So it stays for a while, also where only one of them is left. Where a
barometer sides with one of two speeds, the other source's estimate is not used (speed_vote.py).
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from chute_ros.model import Armed, LinkState, VehicleState
from chute_ros.protocol import vehicle_readings as readings
from chute_ros.protocol.speed_vote import APART, SpeedVote
from chute_ros.protocol.stream_rate import SAID_AFTER, StreamRate

#: The source with chute_msgs/VehicleState, and the one with MAVROS's topics. Both know the
#: autopilot itself, the other sources do not.
VEHICLE_STATE, MAVROS = "vehicle/state", "mavros"
AUTOPILOTS = (VEHICLE_STATE, MAVROS)
ODOMETRY, IMU = "odometry", "imu"
#: How old a word may be, s, before another source's word on the same part counts instead: less
#: than the supervisor believes one (max_age of the measurements), so that it sees no gap, and
#: what jumps from one source to the other as the jump that it is.
FRESH = 0.8
_FRESH_SOONER = {"attitude": 0.4, "acceleration": 0.4}
#: Sensors may send hundreds of messages a second: the picture is told no more often than this, s.
TELL_INTERVAL = 0.02

#: By how much two sources differ that cannot both be right: part -> place of its value, and m/s,
#: rad (that of one that tumbles may be a tenth of a second older), m/s^2 (motors shake).
_DISPUTES = {
    "vertical_speed": (0, APART),
    "attitude": (3, math.pi / 2.0),
    "acceleration": (0, 6.0),
}
#: By so much more a word may differ from the one before of its own source, each second: six
#: times the gravity, m/s, and three turns, rad. A force is another at once, when the motors stop.
_CHANGES = {"vertical_speed": 60.0, "attitude": 6.0 * math.pi, "acceleration": 1e6}
#: By how much two sources differ at most while the vehicle stands: part -> place of its value,
#: that much, the factor of its unit, the unit. Mounts are some degrees off.
_AT_REST = {
    "attitude": (3, 20.0, 180.0 / math.pi, "degrees from upright"),
    "vertical_speed": (0, 2.5, 1.0, "m/s"),
    "acceleration": (0, 3.0, 1.0, "m/s^2"),
}
#: What the rules measure with, and so is judged by how often it comes. Of vehicle/state the link
#: judges what it is made of.
_JUDGED = ("height", "vertical_speed", "attitude", "acceleration")
#: What is told with its source: what was doubted of one source says nothing of another.
_WITH_SOURCE = ("height", *_DISPUTES)
#: A source leaps that differs by more from its own word before, and so much more each second: m/s
#: and m/s^2 (three times the gravity), rad and rad/s (240 degrees). What flies well does not; what
#: falls may, and so one that leaps without another that tells otherwise is in no doubt.
_LEAPS = {"vertical_speed": (2.0, 30.0), "attitude": (math.pi / 6.0, 4.0 / 3.0 * math.pi)}
#: One that leapt so shortly before they began to differ, or after it, s, is the one that lies:
#: noise is near the truth now and then. A leap of later says nothing of how it began.
_LEAPT_THEN = 1.0
#: Two words are of the same time if they are at most so far apart, s.
_SAME_TIME = 0.1
#: And must differ for so long, s: the last word of one that dies with the motors proves nothing.
_DIFFER_FOR = 0.2
#: Without two words to compare for so long, s, nobody knows whether they still do.
_DIFFERENCE_PAUSES = 0.5
#: Of one estimate: wrong together.
_ESTIMATED = ("vertical_speed", "attitude", "attitude_error")
#: So long it is remembered, s: as long as a fall may last.
DISPUTED = 10.0

#: A link in order of preference: who hears the autopilot knows more of it than who lost it.
_PREFERENCE = (
    LinkState.OK,
    LinkState.STALE,
    LinkState.LOST,
    LinkState.NEVER_SEEN,
    LinkState.UNMONITORED,
)


@dataclass(frozen=True)
class _Word:
    """What a source said of a part, and the monotonic time (s) of its receipt."""

    values: readings.Values
    received: float


@dataclass
class _Course:
    """When a source last leapt, and last told another value of a part, monotonic s; how long that
    was after the value before it, s."""

    leapt: float = -math.inf
    changed: float = -math.inf
    pause: float = math.inf


@dataclass(frozen=True)
class _Difference:
    """Two sources differ since begun, and did when the newest of their words came, monotonic s."""

    begun: float
    newest: float


def _continued(before: _Difference | None, word: _Word) -> _Difference:
    """They differ by this word, too; after a pause that is another time."""
    if before is None or abs(word.received - before.newest) > _DIFFERENCE_PAUSES:
        return _Difference(word.received, word.received)
    return _Difference(before.begun, word.received)


class VehicleMerge:
    """The newest words of some sources, and the picture that they make together.

    sources: names, the preferred ones first. lost_after: a source that has not heard its autopilot
    for longer (s), or is silent itself, has lost it. needed_rate: of each part that the rules
    measure with, Hz; 0: any will do. Times are monotonic seconds.
    """

    def __init__(
        self, sources: Sequence[str], lost_after: float, needed_rate: float = 0.0
    ) -> None:
        self._sources = tuple(sources)
        self._lost_after, self._needed_rate = lost_after, needed_rate
        #: Each source that was received -> part -> how often it comes.
        self._rates: dict[str, dict[str, StreamRate]] = {}
        #: When the first of them was.
        self._begun = math.inf
        self._words: dict[str, dict[str, _Word]] = {source: {} for source in sources}
        #: Source -> why its newest message could not be used, and when it came.
        self._refused: dict[str, tuple[str, float]] = {}
        self._vehicle = VehicleState()
        #: (Part, source) -> when another source last told otherwise.
        self._disputed: dict[tuple[str, str], float] = {}
        #: (Part, source) -> how its words went on.
        self._courses: dict[tuple[str, str], _Course] = {}
        self._vote = SpeedVote()
        #: (Part, two sources) -> since when they differ.
        self._differ: dict[tuple[str, frozenset[str]], _Difference] = {}
        #: Who told a height as the autopilot was seen to have started anew: it has not.
        self._heights_outlive: set[str] = set()

    def recall(self, link_state: LinkState, now: float) -> None:
        """How the autopilot was heard before a restart: one that was, and is silent from now
        (monotonic s) on, is lost; without this it would be one that was never seen."""
        if link_state is not LinkState.NEVER_SEEN:
            for source in self._sources:
                if source in AUTOPILOTS:
                    self._words[source][readings.AUTOPILOT] = _Word((link_state, 0), now)

    def hear(self, source: str, parts: readings.Parts, now: float) -> None:
        """A message of source came now and says this."""
        rates = self._rates_of(source, now)
        for part, values in parts.items():
            self._store(source, part, values, now)
            if part in _JUDGED and values is not None:
                rates.setdefault(part, StreamRate(self._needed_rate)).heard(now)

    def hear_state(self, state: VehicleState, now: float) -> None:
        """A message on vehicle/state came now; its parts are as old as it says."""
        if state.reboot_count > self._vehicle.reboot_count:
            known = {one for one, words in self._words.items() if "height" in words}
            self._heights_outlive = known.difference(AUTOPILOTS)
        self._vehicle = state
        self._rates_of(VEHICLE_STATE, now)
        for part, values in readings.vehicle_state(state).items():
            age = getattr(state, f"{part}_age", 0.0)
            # A part from the future would look fresh for longer than it is.
            self._store(VEHICLE_STATE, part, values, now - max(0.0, age))

    def state(self, now: float) -> VehicleState:
        """The picture at now. source names those who gave a part of it."""
        fields: dict[str, Any] = {}
        givers = set()
        for part, names in readings.PARTS.items():
            source = self._source(part, now)
            if source is None:
                continue
            # What tells how far a home has moved is of the source whose home it is.
            if part == "altitude" and self._source("height", now) not in (None, source):
                continue
            givers.add(source)
            word = self._words[source][part]
            # Of one accelerometer nobody tells by how much another differs.
            fields.update(zip(names, word.values, strict=False))
            fields[f"{part}_age"] = now - word.received
        link_state, system_status = self._autopilot(now)
        return VehicleState(
            source=", ".join(source for source in self._sources if source in givers),
            link_state=link_state,
            system_status=system_status,
            vehicle_type=self._vehicle.vehicle_type,
            # Only vehicle/state tells its kind and follows its clock; a restart once seen stays
            # seen.
            uptime=self._vehicle.uptime,
            reboot_count=self._vehicle.reboot_count,
            rebooted_in_flight=self._vehicle.rebooted_in_flight,
            height_holds=self._vehicle.height_holds
            or self._source("height", now) in self._heights_outlive,
            faults=self._faults(now),
            **fields,
        )

    def disputed(self, now: float) -> frozenset[str]:
        """The parts that are told by a source that another one has lately contradicted."""
        return frozenset(
            part
            for part in _DISPUTES
            if (source := self._source(part, now)) is not None
            and now - self._disputed.get((part, source), -math.inf) < DISPUTED
            and not (part == "vertical_speed" and source in self._vote.confirmed)
        )

    def told_by(self, now: float) -> Mapping[str, str]:
        """Part of _WITH_SOURCE -> source, where that is another than the first of the list."""
        told = {}
        for part in _WITH_SOURCE if len(self._sources) > 1 else ():  # most vehicles have one
            source = self._source(part, now)
            if source is not None and source != self._sources[0]:
                told[part] = source
        return MappingProxyType(told)

    def _rates_of(self, source: str, now: float) -> dict[str, StreamRate]:
        self._begun = min(self._begun, now)
        return self._rates.setdefault(source, {})

    def _store(
        self, source: str, part: str, values: readings.Values | None, received: float
    ) -> None:
        if values is None:
            self._words[source].pop(part, None)
            return
        before = self._words[source].get(part)
        if part == readings.AUTOPILOT and values[0] is not LinkState.OK and before is not None:
            # Who says that he does not hear it has no new word of it.
            received = before.received
        word = _Word(values, received)
        if part in _DISPUTES:
            if before is not None and part in _LEAPS:
                self._follow(part, source, before, word)
            self._compare(part, source, word)
        self._words[source][part] = word
        if part == "vertical_speed":
            self._vote.hear_speed(source, values[0], received)
        elif part == "pressure":
            self._vote.hear_pressure(values[0], received)

    def _follow(self, part: str, source: str, before: _Word, word: _Word) -> None:
        """From one word of a source to its next."""
        place, _ = _DISPUTES[part]
        difference = abs(word.values[place] - before.values[place])
        if not difference > 0.0:
            return
        course = self._courses.setdefault((part, source), _Course())
        pause = abs(word.received - course.changed)
        most, each_second = _LEAPS[part]
        # What follows a pause closely was held up with it, and how old it is nobody knows.
        if difference > most + each_second * max(pause, course.pause):
            course.leapt = word.received
        course.changed, course.pause = word.received, pause

    def _compare(self, part: str, source: str, word: _Word) -> None:
        """With the newest words of all sources, of this one as well."""
        place, most = _DISPUTES[part]
        for other, words in self._words.items():
            theirs = words.get(part)
            if theirs is None or abs(word.received - theirs.received) > _SAME_TIME:
                continue
            difference = abs(word.values[place] - theirs.values[place])
            if other == source:
                if difference > most + _CHANGES[part] * abs(word.received - theirs.received):
                    self._disputed[part, source] = word.received
                continue
            both = part, frozenset((source, other))
            if difference <= most:
                self._differ.pop(both, None)
            elif difference > most:  # one that is not a number says nothing
                since = self._differ[both] = _continued(self._differ.get(both), word)
                if since.newest - since.begun >= _DIFFER_FOR:
                    for one in self._in_doubt(part, (source, other), since):
                        self._disputed[part, one] = word.received

    def _in_doubt(self, part: str, both: tuple[str, str], since: _Difference) -> Sequence[str]:
        """Which of two sources that differ since then: the one that leapt, or both."""
        courses = {one: self._courses.get((part, one), _Course()) for one in both}
        leapt = [one for one in both if abs(courses[one].leapt - since.begun) <= _LEAPT_THEN]
        # One whose value does not change goes on without a leap, and tells nothing.
        lives = all(courses[one].changed > since.begun for one in both if one not in leapt)
        return leapt if len(leapt) == 1 and lives else both

    def _source(self, part: str, now: float) -> str | None:
        """Whose word on this part counts; None: nobody knows."""
        givers = [source for source in self._sources if part in self._words[source]]
        if part in _ESTIMATED and self._vote.outvoted:
            givers = self._not_outvoted(part, givers)
        for source in givers:
            if now - self._words[source][part].received <= _FRESH_SOONER.get(part, FRESH):
                return source
        return max(givers, key=lambda one: self._words[one][part].received, default=None)

    def _not_outvoted(self, part: str, givers: list[str]) -> list[str]:
        """Those that count beside an estimate that is wrong; an attitude that nobody else tells
        stays, and its error, which only that estimate tells, does not."""
        sound = [one for one in givers if one not in self._vote.outvoted]
        return givers if part == "attitude" and not sound else sound

    def _autopilot(self, now: float) -> tuple[LinkState, int]:
        """State of the link to the autopilot by the source that hears it best, and its MAV_STATE.

        Where no source knows the autopilot: OK, for the picture is told when a source was heard.
        """
        told = [self._link(source, now) for source in self._sources if source in AUTOPILOTS]
        return min(told, key=lambda one: _PREFERENCE.index(one[0]), default=(LinkState.OK, 0))

    def _faults(self, now: float) -> tuple[str, ...]:
        """As vehicle/state tells them; of one that is lost that is the reason. And which of the
        other sources are missing, or tell too seldom."""
        told = VEHICLE_STATE in self._sources
        lost = told and self._link(VEHICLE_STATE, now)[0] is LinkState.LOST
        faults = () if lost else self._vehicle.faults
        wrong = self._vote.outvoted.values()
        refused = {one: why for one, (why, at) in self._refused.items() if now - at <= SAID_AFTER}
        others = [f"{one}: {why}" for one, why in refused.items()]
        others += self._missing(refused, now) + self._slow(refused, now)
        return (*faults, *others, *wrong, *self._apart(now))

    def refuse(self, source: str, why: str, now: float) -> None:
        """A message of this source could not be used."""
        self._refused[source] = (why, now)

    def _apart(self, now: float) -> list[str]:
        """Sources of a vehicle with its motors off that differ as no two sound ones do: in flight
        one of them alone may be left."""
        off = self._source("armed", now)
        if off is None or self._words[off]["armed"].values[0] is not Armed.DISARMED:
            return []
        told = []
        for part, (place, most, factor, unit) in _AT_REST.items():
            words = {
                one: self._words[one][part].values[place] * factor
                for one in self._sources
                if part in self._words[one]
                and now - self._words[one][part].received <= _FRESH_SOONER.get(part, FRESH)
            }
            if words and max(words.values()) - min(words.values()) > most:
                each = ", ".join(f"{one} {value:.1f}" for one, value in words.items())
                told.append(
                    f"{part.replace('_', ' ')} differs with the motors reported off: {each} "
                    f"{unit} (at most {most:g} apart): turn or calibrate one, or take it out of "
                    "vehicle_sources"
                )
        return told

    def _missing(self, but: Container[str], now: float) -> list[str]:
        """Sources of which nothing was ever received, once others had the time to begin. but: of
        these it is known why."""
        if not self._needed_rate or now - self._begun < SAID_AFTER:
            return []
        silent = [one for one in self._sources if one not in self._rates and one not in but]
        return [f"{one} was never received" for one in silent]

    def _slow(self, but: Container[str], now: float) -> list[str]:
        told = []
        for source, rates in self._rates.items():
            if source in but:
                continue
            slow = [part for part in _JUDGED if part in rates and rates[part].too_slow(now)]
            if slow:
                each = ", ".join(
                    f"{part.replace('_', ' ')} {rates[part].rate(now):.1f} Hz" for part in slow
                )
                told.append(
                    f"{source} comes too seldom: {each} (need {self._needed_rate:g} Hz): raise "
                    "its rate, or take it out of vehicle_sources"
                )
        return told

    def _link(self, source: str, now: float) -> tuple[LinkState, int]:
        word = self._words[source].get(readings.AUTOPILOT)
        if word is None:
            return LinkState.NEVER_SEEN, 0
        if now - word.received > self._lost_after:
            return LinkState.LOST, 0
        link_state, system_status = word.values
        return link_state, system_status
