"""What is known of one measurement: each sample of it is evidence, with an age.

An old one is absent, not zero. What cannot be (not a number, out of range, a jump beyond physics,
time that ran backwards, a value that does not change any more) is not used. A jump that the
samples after it confirm is believed: the world, or the source, did change.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from chute_ros.supervisor.measurements import Limits
from chute_ros.supervisor.quick_replace import replace

#: Samples in a row that must agree before a jump, or a clock that was set back, is believed.
CONFIRMING_SAMPLES = 3
#: Two messages may tell the same sample: what was measured less than this apart is one, s.
_SAME_SAMPLE = 0.005
#: So much may a sample's time lie before that of the one before it: the way is not always as long.
_JITTER = 0.1
#: A jump that was believed is doubted for so long, s: as long as a fall may last.
JUMP_DOUBTED = 10.0
#: And so long what follows a sample that was not taken, s: noise leaves some that could be.
REJECTION_DOUBTED = 1.0
#: m/s^2. To the last bit so: an accelerometer that fails. One that falls feels its drag and its
#: noise.
_FAILED_ACCELERATION = 0.0


@dataclass(frozen=True)
class Sample:
    """One measurement as it came. measured_at: monotonic s; NaN: never received."""

    value: float
    measured_at: float


NO_SAMPLE = Sample(math.nan, math.nan)


@dataclass(frozen=True)
class Doubts:
    """What a source, which tells a measurement no more, has put in doubt; see Measured."""

    source: str
    doubted_at: float
    jumped_at: float
    before_jump: float


@dataclass(frozen=True)
class Measured:
    """What is known of one measurement. measured_at: monotonic s of the newest that was taken."""

    value: float = math.nan
    measured_at: float = math.nan
    #: Monotonic s since which the value has been the same to the last bit.
    same_since: float = math.nan
    #: Samples taken so far; a rule counts the distinct ones.
    count: int = 0
    #: Why the newest sample was not taken; empty: it was.
    rejected: str = ""
    #: When one was last doubted, and when a jump was last believed, monotonic s.
    doubted_at: float = math.nan
    jumped_at: float = math.nan
    #: What it was before that jump.
    before_jump: float = math.nan
    #: The newest that was not taken, and how many like it came in a row.
    candidate: float = math.nan
    candidate_at: float = math.nan
    candidates: int = 0
    #: Which of several sources tells it, empty: the first; and what others have put in doubt.
    source: str = ""
    others: tuple[Doubts, ...] = ()

    def told_by(self, source: str) -> Measured:
        """The same, told by this source from now on: what one that lied has put in doubt says
        nothing of the words of another, and counts again when it comes back."""
        if source == self.source:
            return self
        mine = Doubts(self.source, self.doubted_at, self.jumped_at, self.before_jump)
        known = {one.source: one for one in (*self.others, mine)}
        theirs = known.pop(source, Doubts(source, math.nan, math.nan, math.nan))
        return replace(
            self,
            doubted_at=theirs.doubted_at,
            jumped_at=theirs.jumped_at,
            # Who tells what the one before told before it jumped has not jumped.
            before_jump=self.before_jump if math.isnan(theirs.jumped_at) else theirs.before_jump,
            source=source,
            others=tuple(known.values()),
        )

    def unusable(self, limits: Limits, now: float) -> str:
        """Why it cannot be used now; empty: it can."""
        if math.isnan(self.measured_at):
            return self.rejected or "never received"
        age = now - self.measured_at
        if age < -_JITTER:
            return f"its time lies {-age:.2f} s in the future"
        if age > limits.max_age:
            return self.rejected or f"old: {age:.2f} s (limit {limits.max_age:g} s)"
        if self.rejected:
            return self.rejected
        same = self.measured_at - self.same_since
        if 0.0 < limits.stuck_after <= same:
            return (
                f"stuck at {self.value + 0.0:g} for {same:.1f} s (limit {limits.stuck_after:g} s)"
            )
        return ""

    def turns_at(self, limits: Limits, now: float) -> float:
        """When time alone makes it usable, or too old; infinity: it does not."""
        soonest = math.inf
        for turn in (
            self.measured_at - _JITTER,
            self.measured_at + limits.max_age,
            self.doubted_at + REJECTION_DOUBTED,
            self.jumped_at + JUMP_DOUBTED,
        ):
            if now <= turn < soonest:
                soonest = turn
        return soonest

    def has_jumped(self, now: float) -> bool:
        """A moment ago it was another, and which of the two is right nobody knows."""
        return now < self.jumped_at + JUMP_DOUBTED

    def doubt(self, name: str, now: float) -> str:
        """Why one that can be used is a weaker sign than another; empty: it is not."""
        if self.has_jumped(now):
            return f"it jumped {now - self.jumped_at:.1f} s ago"
        if now < self.doubted_at + REJECTION_DOUBTED:
            return f"another was not taken {now - self.doubted_at:.1f} s ago"
        if name == "acceleration" and self.value == _FAILED_ACCELERATION:
            return "exactly 0 is what an accelerometer that fails reads"
        return ""

    def usable(self, limits: Limits, now: float) -> float:
        """The value, or NaN where it cannot be used."""
        return math.nan if self.unusable(limits, now) else self.value

    def with_sample(self, sample: Sample, limits: Limits) -> Measured:
        """After one sample; the same one told again changes nothing."""
        if not math.isfinite(sample.measured_at):
            return self
        for value, at in (
            (self.value, self.measured_at),
            (self.candidate, self.candidate_at),
        ):
            # Told again by another message, its date varies as the way does; its value does not.
            same_for = _JITTER if sample.value == value else _SAME_SAMPLE
            if abs(sample.measured_at - at) < same_for:
                return self
        wrong = self._impossible(sample, limits)
        if wrong:
            return replace(
                self,
                rejected=wrong,
                # One that is not a number is one that was not told.
                doubted_at=sample.measured_at if math.isfinite(sample.value) else self.doubted_at,
                candidate=math.nan,
                candidate_at=math.nan,
                candidates=0,
            )
        doubtful = self._doubtful(sample, limits)
        # A date that went back puts the value in no doubt.
        leaps = bool(doubtful) and _jumps(self.value, self.measured_at, sample, limits)
        if doubtful:
            agrees = not _jumps(self.candidate, self.candidate_at, sample, limits)
            candidates = self.candidates + 1 if agrees else 1
            if candidates < CONFIRMING_SAMPLES:
                return replace(
                    self,
                    rejected=doubtful,
                    doubted_at=sample.measured_at if leaps else self.doubted_at,
                    candidate=sample.value,
                    candidate_at=sample.measured_at,
                    candidates=candidates,
                )
        if not doubtful and sample.measured_at < self.measured_at:
            return self  # overtaken on its way by the one that is known
        same = sample.value == self.value and not doubtful
        # With the time since the last that was taken, a jump may come to be one that can be.
        nearer = abs(sample.value - self.candidate) < abs(sample.value - self.value)
        jumped_at, before_jump = self.jumped_at, self.before_jump
        candidate = Sample(self.candidate, self.candidate_at)
        if leaps or (nearer and _jumps(self.value, self.measured_at, candidate, limits)):
            # A jump back to what it was before ends what the first one has put in doubt.
            back = abs(sample.value - before_jump) <= limits.jump
            jumped_at, before_jump = (
                (math.nan, math.nan) if back else (sample.measured_at, self.value)
            )
        elif math.isnan(jumped_at):
            before_jump = math.nan
        return Measured(
            value=sample.value,
            measured_at=sample.measured_at,
            same_since=self.same_since if same else sample.measured_at,
            count=self.count + 1,
            doubted_at=self.doubted_at,
            jumped_at=jumped_at,
            before_jump=before_jump,
            source=self.source,
            others=self.others,
        )

    def _impossible(self, sample: Sample, limits: Limits) -> str:
        if not math.isfinite(sample.value):
            told = "reported without a value"
            return told if math.isnan(sample.value) else f"{sample.value} is not a number"
        if not limits.minimum <= sample.value <= limits.maximum:
            return f"{sample.value:g} is out of {limits.minimum:g} to {limits.maximum:g}"
        return ""

    def _doubtful(self, sample: Sample, limits: Limits) -> str:
        if math.isnan(self.measured_at):
            return ""
        if sample.measured_at < self.measured_at - _JITTER:
            return f"time ran backwards by {self.measured_at - sample.measured_at:.2f} s"
        # After a silence nobody knows what lay between: only what follows closely can jump.
        if sample.measured_at - self.measured_at > limits.max_age:
            return ""
        if _jumps(self.value, self.measured_at, sample, limits):
            step = sample.value - self.value
            return f"jumped by {step:+g} in {sample.measured_at - self.measured_at:.3f} s"
        return ""


def _jumps(value: float, at: float, sample: Sample, limits: Limits) -> bool:
    passed, step = sample.measured_at - at, sample.value - value
    return abs(step) > limits.jump + limits.rate * abs(passed)
