"""Measurements of the vehicle as evidence: each has an age and can be unusable, with the reason.

An old one is absent, not zero. What cannot be (not a number, out of range, a jump beyond physics,
time that ran backwards, a value that does not change any more) is not used. A jump that the
samples after it confirm is believed: the world, or the source, did change.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from chute_ros.errors import ParameterError
from chute_ros.model import VehicleState
from chute_ros.supervisor.quick_replace import replace

#: Samples in a row that must agree before a jump, or a clock that was set back, is believed.
CONFIRMING_SAMPLES = 3
#: Two messages may tell the same sample: what was measured less than this apart is one, s.
_SAME_SAMPLE = 0.005
#: So much may a sample's time lie before that of the one before it: the way is not always as long.
_JITTER = 0.1
_EARTH_RADIUS = 6_371_000.0  # m
DEGREES = 180.0 / math.pi


@dataclass(frozen=True)
class Limits:
    """What a measurement may be: range, unit/s of change and unit that it may jump besides, age
    and how long it may stay the same to the last bit, s (0: for ever)."""

    minimum: float
    maximum: float
    rate: float
    jump: float
    max_age: float
    stuck_after: float

    def __post_init__(self) -> None:
        if not self.minimum < self.maximum:
            raise ParameterError(f"range {self.minimum} to {self.maximum}: need a larger second")
        for name in ("rate", "jump", "stuck_after"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ParameterError(f"{name} is {getattr(self, name)}: need 0 or more")
        if not 0.0 < self.max_age <= 60.0:
            raise ParameterError(f"max_age is {self.max_age}: need above 0, up to 60 s")


#: Every measurement by name, with limits for any vehicle; a profile may set others.
STANDARD_LIMITS: dict[str, Limits] = {
    # m above take-off, up positive
    "height": Limits(-500.0, 50_000.0, 400.0, 10.0, 1.0, 5.0),
    # m/s, up positive
    "vertical_speed": Limits(-400.0, 400.0, 200.0, 5.0, 1.0, 5.0),
    # m in the standard atmosphere, of the static pressure: only its changes are told
    "pressure_altitude": Limits(-2000.0, 80_000.0, 400.0, 10.0, 1.0, 1.0),
    # degrees between the vehicle's axis and the vertical, 0 upright to 180; pi as float32 is more
    "tilt_deg": Limits(0.0, 180.001, 2000.0, 60.0, 0.5, 5.0),
    # degrees between the vehicle's axis and the one that it was commanded
    "attitude_error": Limits(0.0, 180.001, 2000.0, 180.0, 0.5, 0.0),
    # m/s by which it sinks faster than it was commanded; it may change with the command at once
    "sink_beyond_target": Limits(-400.0, 400.0, 200.0, 100.0, 1.0, 0.0),
    # m/s^2, length of the specific force: 9.8 at rest, 0 in free fall
    "acceleration": Limits(0.0, 2000.0, 100_000.0, 200.0, 0.5, 5.0),
    # m over ground from where it took off
    "distance_from_home": Limits(0.0, 20_000_000.0, 400.0, 30.0, 2.0, 0.0),
    # V
    "battery_voltage": Limits(0.0, 1000.0, 100.0, 60.0, 10.0, 0.0),
    # remaining charge, 0 to 1
    "battery_remaining": Limits(0.0, 1.0, 0.5, 0.3, 10.0, 0.0),
}

HEIGHT, VERTICAL_SPEED = "height", "vertical_speed"
#: What tells of a fall whichever way up it is.
FALL_SIGNS = ("vertical_speed", "acceleration")
#: A jump that was believed is doubted for so long, s: as long as a fall may last.
JUMP_DOUBTED = 10.0
#: And so long what follows a sample that was not taken, s: noise leaves some that could be.
REJECTION_DOUBTED = 1.0
#: m/s^2. To the last bit so: an accelerometer that fails. One that falls feels its drag and its
#: noise.
_FAILED_ACCELERATION = 0.0
PRESSURE_ALTITUDE, ACCELERATION, TILT = "pressure_altitude", "acceleration", "tilt_deg"
#: From the barometer's heights of the last second (where it tells none from the estimator's), and
#: from the vertical speeds of the last second, m/s^2. On these conditions can rest as on the
#: measurements that tell them.
CLIMB_RATE, VERTICAL_ACCELERATION = "climb_rate", "vertical_acceleration"
DERIVED: dict[str, tuple[str, ...]] = {
    CLIMB_RATE: (HEIGHT, PRESSURE_ALTITUDE),
    VERTICAL_ACCELERATION: (VERTICAL_SPEED,),
}
#: A commanded height is missed if the vehicle is lower by more than this, m: at half of its climb
#: speed a controller is as far behind.
_MISSES_TARGET = 1.5


#: The unit of each, for people.
UNITS: dict[str, str] = {
    "height": "m above take-off",
    "vertical_speed": "m/s, up positive",
    "pressure_altitude": "m in the standard atmosphere",
    "tilt_deg": "degrees from upright, 0 to 180",
    "attitude_error": "degrees from the commanded attitude, 0 to 180",
    "sink_beyond_target": "m/s by which it sinks faster than commanded",
    "acceleration": "m/s^2, length of the specific force: 9.8 at rest, 0 in free fall",
    "distance_from_home": "m over ground from where it took off",
    "battery_voltage": "V",
    "battery_remaining": "remaining charge, 0 to 1",
}


@dataclass(frozen=True)
class Sample:
    """One measurement as it came. measured_at: monotonic s; NaN: never received."""

    value: float
    measured_at: float


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
            return f"stuck at {self.value:g} for {same:.1f} s (limit {limits.stuck_after:g} s)"
        return ""

    def turns_at(self, limits: Limits, now: float) -> float:
        """When time alone makes it usable, or too old; infinity: it does not."""
        turns = (
            self.measured_at - _JITTER,
            self.measured_at + limits.max_age,
            self.doubted_at + REJECTION_DOUBTED,
            self.jumped_at + JUMP_DOUBTED,
        )
        return min([turn for turn in turns if turn >= now], default=math.inf)

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
            return f"{sample.value} is not a number"
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


def samples_of(
    vehicle: VehicleState,
    received: float,
    home: tuple[float, float] | None,
    home_altitude: float = math.nan,
) -> Mapping[str, Sample]:
    """Every measurement in a VehicleState. received: monotonic s; home: degrees; home_altitude: m
    above mean sea level of what heights are above, wherever home is now; NaN: of home."""
    above = vehicle.altitude - home_altitude
    height = (vehicle.height, vehicle.height_age)
    told = {
        "height": height if math.isnan(above) else (above, vehicle.altitude_age),
        "pressure_altitude": (pressure_altitude(vehicle.pressure), vehicle.pressure_age),
        "vertical_speed": (vehicle.vertical_speed, vehicle.vertical_speed_age),
        "tilt_deg": (vehicle.tilt * DEGREES, vehicle.attitude_age),
        "attitude_error": (vehicle.attitude_error * DEGREES, vehicle.attitude_error_age),
        "sink_beyond_target": _sink_beyond_target(vehicle),
        "acceleration": (vehicle.acceleration, vehicle.acceleration_age),
        "battery_voltage": (vehicle.battery_voltage, vehicle.battery_age),
        "battery_remaining": (vehicle.battery_remaining, vehicle.battery_age),
    }
    if home is not None:
        here = (vehicle.latitude, vehicle.longitude)
        told["distance_from_home"] = (distance_between(home, here), vehicle.position_age)
    return {name: Sample(value, received - age) for name, (value, age) in told.items()}


def _sink_beyond_target(vehicle: VehicleState) -> tuple[float, float]:
    """m/s, and how old it is, s. Of one that is lower than it was commanded no sink was. A height
    below it commands none: ArduCopter tells 0 m in a hover, after a take-off in GUIDED."""
    value = vehicle.target_vertical_speed - vehicle.vertical_speed
    if math.isnan(vehicle.target_vertical_speed):
        missed = vehicle.below_target > _MISSES_TARGET
        value = -vehicle.vertical_speed if missed else math.nan
    return value, max(vehicle.target_age, vehicle.vertical_speed_age)


def pressure_altitude(pressure: float) -> float:
    """Height at which the standard atmosphere has this pressure (Pa), m (ICAO Doc 7488, below
    11 km); NaN: it is no pressure."""
    if not 1000.0 <= pressure <= 120_000.0:
        return math.nan
    return 44_330.77 * (1.0 - math.pow(pressure / 101_325.0, 0.190263))


def distance_between(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Way over ground between two (latitude, longitude) in degrees, m (haversine formula); NaN:
    one is no place on earth."""
    if not (on_earth(*one) and on_earth(*other)):
        return math.nan
    latitude_1, longitude_1, latitude_2, longitude_2 = (
        math.radians(angle) for angle in (*one, *other)
    )
    half = (
        math.sin((latitude_2 - latitude_1) / 2) ** 2
        + math.cos(latitude_1)
        * math.cos(latitude_2)
        * math.sin((longitude_2 - longitude_1) / 2) ** 2
    )
    # Rounding must not leave the domain of asin.
    return 2.0 * _EARTH_RADIUS * math.asin(min(1.0, math.sqrt(half)))


def on_earth(latitude: float, longitude: float) -> bool:
    """Is it a place? Degrees."""
    return abs(latitude) <= 90.0 and abs(longitude) <= 360.0  # NaN is not
