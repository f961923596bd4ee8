"""What a measurement claims of a fall, held against what others tell: physics, not thresholds.

Height, vertical speed and attitude of an autopilot are one estimator: when it goes wrong, it is
wrong with itself. The barometer and the accelerometer are origins of their own. A claim that they
contradict is denied, with the reason:

- a sink of the estimator, where the barometer reports none, or has not come down by what it takes
  to speed up so much since it was last received; without a barometer, where no force was missing
  while it is said to have speeded up. An accelerometer that feels the fall does not speak
  for it: where motors shake it, it tells too little, and the estimator that flies on it sinks;
- a force as in a fall, where no speed follows from it (what is not carried by a force f speeds up
  downwards by 9.8 - f at least);
- a tilt, where it is carried in full and does not speed up, or in full as it leans and does not
  sink; and one that leapt while it came down, carried in full, as before.

Only an origin that lives denies: a sensor that is stuck has no noise, one that fails has much of
it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from statistics import fmean
from typing import NamedTuple

from chute_ros.supervisor.measurements import ACCELERATION, CLIMB_RATE, TILT, VERTICAL_SPEED

GRAVITY = 9.81  # m/s^2
#: (monotonic s, vertical speed m/s, specific force m/s^2, cosine of the tilt); NaN: not known.
Moment = tuple[float, float, float, float]
#: Moments are kept for so long, and this far apart at least, s.
KEPT_FOR, _APART = 3.0, 0.05
#: Between the least and the most of a sensor that lives, m/s^2 and m/s; and the usual step of a
#: speed that is no noise, m/s.
_FORCE_LIVES, _SPEED_LIVES, _SPEED_STEADY = 0.02, 0.003, 3.0
#: Moments further apart say nothing of what lay between, s.
_GAP = 0.35
#: A sink is denied if it differs by so much, m/s, and this part of itself, from the barometer's.
_SINK_DIFFERS, _OF_SINK = 2.0, 0.5
#: Two heights of a barometer that lives differ by no more than this from what they are, m.
_BAROMETER_ERRS = 2.5
#: Heights above the take-off differ by so much, m, and this part of them: a standard atmosphere is
#: wrong by 4 % each 10 degrees, and the weather moves by some metres in a flight.
_HEIGHTS_DIFFER, _OF_HEIGHT = 20.0, 0.3
#: Speeded up by so much more than was felt, m/s, in this time at least, s.
_NOT_FELT, _FELT_OVER = 4.0, 1.0
#: Below this a force is that of a fall, m/s^2: half of what a body at rest feels.
FREE_FALL = 4.9
#: It must have been that for so long, s, and the speed be higher by so much, m/s. Shorter than a
#: rule counts: at 12.5 to 50 Hz there is a moment in between.
_FALLS_FOR, _NO_SPEED = 0.23, 2.0
#: An attitude follows its command if it is nearer than this, degrees (ArduPilot: AP_Parachute and
#: crash_check take 30 for lost); a sink does that is faster by less than this, m/s.
_FOLLOWS, _SINKS_AS_TOLD = 30.0, 3.0
#: As fast as commanded: nearer than this, m/s. So nearly the last command of an autopilot that is
#: silent counts, by its speed, and by the heights.
_SINKS_ON, _SINKS_ON_BY_HEIGHTS = 1.0, 2.0
#: In place of a measurement: that a wing sinks as its commanded attitude makes it. That leans by
#: this at least, degrees: of what falls flat it does not.
DIVE, _DIVES = "dive", 10.0
#: Carried in full: on the average between these, m/s^2, for so long, s, each so near to gravity,
#: m/s^2, as motors shake.
_CARRIED, _CARRIED_FOR, _SHAKES = (7.8, 11.8), 0.5, 4.0
#: Faster than that it may have reached the last speed of its fall, m/s (7 are flown down, and told
#: with noise); and one that lies on its side while it is carried along its axis speeds up by more
#: than this in that time, m/s.
_FLOWN_SINK, _SPEEDS_UP = 7.5, 2.0
#: One that lies on its side sinks by its barometer's last second with this at least, m/s: half a
#: second of free fall, and what gusts of an ordinary flight do not reach.
_LIES_AND_SINKS = 2.5
#: One that feels its weight to this, m/s^2, is upright while its barometer tells no faster sink
#: than before it was said to lean, nor than one comes down by hand with, m/s (PILOT_SPEED_DN of
#: ArduPilot, at most 5): what lies on its side and falls soon feels its drag besides. Not so where
#: the cosine of its tilt changes by more than this meanwhile: no estimator leans over so fast.
_ITS_WEIGHT, _BY_HAND, _TUMBLES = 0.7, 5.0, 0.6
#: An estimator that tells more than this share of a fall that is felt does not hide it.
_TOLD_AS_WELL = 0.5
#: Of so many moments a mean can be told; cosine of 70 degrees: no wing carries what leans more.
_FEW, _ON_ITS_SIDE = 4, 0.342
#: Cosine of 45 degrees: a vehicle that leans less claims no fall.
_LEANS = 0.7071
#: An attitude leaps that changes by more than this, degrees, and faster, degrees/s: flips are
#: flown with 400. What tips over is pulled downwards by what carried it, and soon sinks faster;
#: what sank with this before, m/s, may have reached the last speed of its fall.
_LEAP, _LEAPS, _LEAPT_AT_LAST_SPEED = 60.0, 500.0, -8.0
_LEAPT = "the attitude leapt, and neither its force nor its sink changed since"


class Rise(NamedTuple):
    """The barometer's height rose by so much each second, m/s, between these, monotonic s; NaN: it
    tells nothing."""

    rate: float
    since: float
    until: float


class Drop(NamedTuple):
    """The barometer tells so much less than before its last silence, m, so long ago, s; NaN: it
    was not silent lately, or tells nothing."""

    by: float
    passed: float


NOT_TOLD = Rise(math.nan, math.nan, math.nan)
NO_DROP = Drop(math.nan, math.nan)


def noted(motion: tuple[Moment, ...], moment: Moment) -> tuple[Moment, ...]:
    """With one more, if it is far enough from the last."""
    now = moment[0]
    if motion and now - motion[-1][0] < _APART:
        return motion
    return (*(one for one in motion if now - one[0] <= KEPT_FOR), moment)


def denials(
    motion: tuple[Moment, ...],
    barometer: Rise,
    drop: Drop,
    before: Mapping[str, str],
    jumped: bool,
) -> Mapping[str, str]:
    """Measurement -> why what it claims is not so. barometer: of the last second; before: what was
    denied until now; jumped: the tilt is in doubt as it jumped."""
    denied = {}
    sink = _sink_denied(motion, barometer, drop)
    if why := sink or _still_denied(motion, barometer, before):
        denied[VERTICAL_SPEED] = why
    if why := _fall_denied(motion, barometer):
        denied[ACCELERATION] = why
    if why := _tilt_denied(motion, barometer) or _leapt(motion, barometer, before, jumped):
        denied[TILT] = why
    return denied


def commanded(
    tilt: float,
    attitude_error: float,
    target: float,
    sink_beyond_target: float,
    climb_beyond_target: float,
) -> Mapping[str, str]:
    """Measurement (or DIVE) -> in words that what it claims was commanded: no accident. Degrees
    from upright and from the commanded attitude, the commanded vertical speed, m/s, and m/s of
    sink beyond it, by the estimator and by what tells CLIMB_RATE; NaN: not known."""
    told = {}
    if attitude_error <= _FOLLOWS:
        told[TILT] = f"it was commanded (to {attitude_error:.0f} degrees, limit {_FOLLOWS:g})"
        if tilt - attitude_error >= _DIVES:
            told[DIVE] = f"it dives as commanded ({tilt:.0f} degrees, to {attitude_error:.0f})"
    if sink_beyond_target <= _SINKS_AS_TOLD:
        beyond = f"{sink_beyond_target:+.1f} m/s beyond that, limit {_SINKS_AS_TOLD:g}"
        told[VERTICAL_SPEED] = f"it was commanded ({beyond})"
        # So is the force that is missing while it does so, of one that lies as it shall, or whose
        # attitude alone is wrong: it comes down just as fast as it shall. Not where another origin
        # tells of a sink that nobody commanded.
        as_fast = target <= -_SINKS_ON and sink_beyond_target <= _SINKS_ON
        lies_well = not attitude_error > _FOLLOWS
        if (lies_well or as_fast) and not climb_beyond_target > _SINKS_AS_TOLD:
            told[ACCELERATION] = told[VERTICAL_SPEED]
    if climb_beyond_target <= _SINKS_AS_TOLD:
        told[CLIMB_RATE] = f"it was commanded ({climb_beyond_target:+.1f} m/s beyond that)"
    return told


def commanded_last(target: float, speed: float, rate: float) -> Mapping[str, str]:
    """The same of a vehicle whose autopilot is silent: it sinks on as it was commanded last, which
    what falls does not for long. target, speed: vertical, m/s; rate: CLIMB_RATE; NaN: not known.
    A force that is missing is none of it."""
    as_fast = {
        VERTICAL_SPEED: target - speed <= _SINKS_ON,
        CLIMB_RATE: target - rate <= _SINKS_ON_BY_HEIGHTS,
    }
    told = f"it was commanded ({target:+.1f} m/s, when last heard)"
    return {name: told for name, so in as_fast.items() if so}


def _last(motion: tuple[Moment, ...], seconds: float) -> list[Moment]:
    return [one for one in motion if motion[-1][0] - one[0] <= seconds + _APART / 2.0]


def _newest(motion: tuple[Moment, ...]) -> list[Moment]:
    """Of the time over which it must be carried; at 5 Hz a few take longer."""
    newest = _last(motion, _CARRIED_FOR) if motion else []
    if len(newest) >= _FEW:
        return newest
    few = motion[-_FEW:]
    alike = all(after[0] - before[0] <= _GAP for before, after in pairwise(few))
    return list(few) if alike else newest


def _told_meanwhile(motion: tuple[Moment, ...], barometer: Rise) -> float:
    """The vertical speed over the barometer's time: in a fall that speeds up the newest is twice
    as much. NaN: none was told, or the barometer reports nothing."""
    begin, end = barometer.since - _APART, barometer.until + _APART
    speeds = [one[1] for one in motion if begin <= one[0] <= end and not math.isnan(one[1])]
    return fmean(speeds) if speeds else math.nan


def _sink_denied(motion: tuple[Moment, ...], barometer: Rise, drop: Drop) -> str:
    if not motion or not motion[-1][1] < -1.0:
        return ""
    told = _told_meanwhile(motion, barometer)
    if math.isnan(told):
        return _not_fallen(motion, drop) or _not_felt(motion)
    if barometer.rate - told <= max(_SINK_DIFFERS, _OF_SINK * abs(told)):
        return ""
    return f"the barometer reports {barometer.rate:+.1f} m/s where it reports {told:+.1f}"


def felt_drop(motion: tuple[Moment, ...]) -> float:
    """The vertical speed that a fall has given it lately, as its accelerometer felt it, m/s: 0, or
    negative; over a silence by how much more its speed is lower after it than the forces around it
    make it; NaN: no speed was told there. Whichever way up it is: no attitude is asked."""
    return _felt(motion) + sum(
        min(_unfelt_change(before, after), 0.0)
        for before, after in pairwise(motion)
        if after[0] - before[0] > _GAP
    )


def _unfelt_change(before: Moment, after: Moment) -> float:
    """Of the vertical speed from one moment to another one, m/s: all of it beside a force as in a
    fall; otherwise what the least force explains is no fall."""
    change, force = after[1] - before[1], min(before[2], after[2])
    if not FREE_FALL <= force <= GRAVITY:
        return change
    return change + (GRAVITY - force) * (after[0] - before[0])


def _felt(motion: tuple[Moment, ...]) -> float:
    return sum((after[2] - GRAVITY) * passed for _, after, passed in _drops(motion))


def felt_fall(motion: tuple[Moment, ...]) -> float:
    """The same of a fall that its estimator hides: one that it told as well is none, as what
    became of it since, it tells, too. An accelerometer that is stuck feels none."""
    fell = [one[2] for one in motion if one[2] < FREE_FALL]
    if len(fell) < 3 or not _lives(fell):
        return 0.0
    felt = _felt(motion)
    changes = [after[1] - before[1] for before, after, _ in _drops(motion)]
    told = sum(change for change in changes if not math.isnan(change))
    return 0.0 if told < _TOLD_AS_WELL * felt else felt


def _drops(motion: tuple[Moment, ...]) -> Iterator[tuple[Moment, Moment, float]]:
    """Two moments and the time between them, s, over which less than half of its weight carried
    it."""
    for before, after in pairwise(motion):
        passed = after[0] - before[0]
        if after[2] < FREE_FALL and passed <= _GAP:
            yield before, after, passed


def speed_error(motion: tuple[Moment, ...], newest: float, barometer: Rise) -> float:
    """By how much the estimator's vertical speed and the barometer's differ, whichever is the
    higher, m/s; NaN: not known. newest: the estimator's, where all of that time is in doubt."""
    told = _told_meanwhile(motion, barometer)
    return abs(barometer.rate - (newest if math.isnan(told) else told))


def force_error(motion: tuple[Moment, ...]) -> float:
    """By how much the force differs from what would hold the vehicle in the attitude of the last
    second, and speed it up as its estimator tells, if it tells, m/s^2: near 0 in a turn, in a
    climb, and as a dive is caught. Of what leans by more than 70 degrees, so much as if it leant
    by 70. NaN: not known."""
    newest = _last(motion, 1.0) if motion else []
    known = [one for one in newest if not math.isnan(one[2]) and not math.isnan(one[3])]
    if len(known) < _FEW or known[-1] is not motion[-1]:
        return math.nan
    speeds_up = (known[-1][1] - known[0][1]) / (known[-1][0] - known[0][0])
    speeds_up = 0.0 if math.isnan(speeds_up) else speeds_up
    needed = (GRAVITY + speeds_up) / max(fmean([one[3] for one in known]), _ON_ITS_SIDE)
    return abs(fmean([one[2] for one in known]) - needed)


def height_denied(height: float, by_pressure: float) -> str:
    """Why a height above the take-off, m, is not so, by the barometer's; empty: nothing denies it.
    Which of the two is wrong nobody can tell."""
    if not abs(height - by_pressure) > max(_HEIGHTS_DIFFER, _OF_HEIGHT * abs(height)):
        return ""
    return (
        f"the barometer reports {by_pressure:.0f} m above the take-off where it reports "
        f"{height:.0f}"
    )


def least_drop(sink: float, passed: float) -> float:
    """How far what sinks with this, m/s, has come down at least from the highest that it was in
    the last seconds, m: nothing speeds up downwards by more than gravity does."""
    sped_up = min(passed, sink / GRAVITY)
    return sink * sped_up - GRAVITY * sped_up**2 / 2.0


def _not_fallen(motion: tuple[Moment, ...], drop: Drop) -> str:
    """It sinks so fast that it must have come down further since its barometer was last heard, as
    long as that tells no rate again: who climbs and falls within one silence is believed then."""
    if math.isnan(drop.by):
        return ""
    least = least_drop(-motion[-1][1], drop.passed)
    if drop.by + _BAROMETER_ERRS >= _OF_SINK * least:
        return ""
    return (
        f"it reports {motion[-1][1]:+.1f} m/s, for which it came down by {least:.1f} m at least "
        f"in {drop.passed:.1f} s, and the barometer reports {drop.by:.1f} m"
    )


def _not_felt(motion: tuple[Moment, ...]) -> str:
    """It speeded up downwards, and no force was missing."""
    known = [one for one in motion if not any(map(math.isnan, one))]
    if not _carries(motion):
        return ""
    felt, best, over = 0.0, 0.0, 0.0
    for after, before in _backwards(known):
        if after[0] - before[0] > _GAP:
            break  # nobody knows what was felt meanwhile
        # A force to the side carries nothing, so that upwards it counts as none.
        felt += min(after[2] * after[3] - GRAVITY, 0.0) * (after[0] - before[0])
        passed = known[-1][0] - before[0]
        more = felt - (known[-1][1] - before[1])
        if passed >= _FELT_OVER and more > best:
            best, over = more, passed
    if best <= _NOT_FELT:
        return ""
    return (
        f"it sinks {best:.1f} m/s faster than {over:.1f} s before, of which no force is reported"
    )


def _still_denied(motion: tuple[Moment, ...], barometer: Rise, before: Mapping[str, str]) -> str:
    """A sink of which no force told as it began: an error that grows no more is no truth. It is
    over once the estimator is back, a force is missing, or a barometer tells of it."""
    sinks = bool(motion) and motion[-1][1] < -1.0
    if not sinks or not math.isnan(barometer.rate) or not _carries(motion):
        return ""
    return before.get(VERTICAL_SPEED, "")


def _fall_denied(motion: tuple[Moment, ...], barometer: Rise) -> str:
    """No speed follows from a force as in a fall."""
    fell: list[Moment] = []
    for one in reversed(motion):
        if not one[2] < FREE_FALL:
            break
        fell.insert(0, one)
    if len(fell) < 3 or math.isnan(fell[-1][1]) or not _speed_lives(motion):
        return ""
    if barometer.rate < _told_meanwhile(motion, barometer) - _SINK_DIFFERS:
        return ""  # the barometer does tell of a fall
    due = 0.0
    for after, before in _backwards(fell):
        due += (after[2] - GRAVITY) * (after[0] - before[0])
        passed = fell[-1][0] - before[0]
        change = fell[-1][1] - before[1]
        if passed >= _FALLS_FOR and change - due > _NO_SPEED + 0.1 * abs(due):
            return (
                f"in {passed:.1f} s the vertical speed changed by {change:+.1f} m/s, "
                f"where such a force makes it {due:.1f}"
            )
    return ""


def _tilt_denied(motion: tuple[Moment, ...], barometer: Rise) -> str:
    """Carried in full, and not sinking: it does not lie on its side. The vertical speed is of the
    estimator that tells the tilt, so that the barometer is asked first."""
    if not motion or not any(one[3] < _LEANS for one in _last(motion, _CARRIED_FOR)):
        return ""
    known = _carried(motion)
    if not known:
        return _carried_leaning(motion)
    force = fmean([one[2] for one in known])
    feels_its_weight = abs(force - GRAVITY) <= _ITS_WEIGHT
    fastest = _sink_by_hand(motion, known) if feels_its_weight else -_LIES_AND_SINKS
    if barometer.rate >= fastest:
        told = f"the barometer reports {barometer.rate:+.1f} m/s"
        return f"a force of {force:.1f} m/s^2 carries it, and {told}"
    if known[-1][1] < -_FLOWN_SINK or known[-1][1] - known[0][1] < -_SPEEDS_UP:
        return ""
    return f"a force of {force:.1f} m/s^2 carries it, and its vertical speed stays"


def _sink_by_hand(motion: tuple[Moment, ...], known: list[Moment]) -> float:
    """The vertical speed with which what feels its weight may come down and be upright, m/s."""
    cosines = [one[3] for one in known]
    if max(cosines) - min(cosines) > _TUMBLES:
        return -_LIES_AND_SINKS
    upright = [one[1] for one in motion if one[3] >= _LEANS and not math.isnan(one[1])]
    before = min(0.0, min(upright, default=-_BY_HAND))
    return max(before - _LIES_AND_SINKS, -_BY_HAND)


def _leapt(
    motion: tuple[Moment, ...], barometer: Rise, before: Mapping[str, str], jumped: bool
) -> str:
    """Its attitude alone changed, faster than bodies do; nor has anything changed since."""
    if not motion or motion[-1][3] >= _LEANS:
        return ""
    upright = max((n for n, one in enumerate(motion) if one[3] >= _LEANS), default=-1)
    since = motion[max(upright, 0) :]
    if upright < 0:
        leapt = before.get(TILT) == _LEAPT
    else:
        leans = [one for one in since[1:] if not math.isnan(one[3])]
        leapt = _leaps(since[0], leans[0]) if leans else jumped
    known = [one for one in since if not math.isnan(one[1] + one[2])]
    if not leapt or len(known) < 2 or known[-1] is not motion[-1]:
        return ""
    felt, speeds = [one[2] for one in known], [one[1] for one in known]
    stays = max(speeds) - min(speeds) <= _SPEEDS_UP and min(speeds) >= _LEAPT_AT_LAST_SPEED
    told = barometer.rate < max(fmean(speeds) - _SINK_DIFFERS, _LEAPT_AT_LAST_SPEED)
    return _LEAPT if stays and not told and _lives(felt) and _in_full(felt) else ""


def _leaps(before: Moment, after: Moment) -> bool:
    turned = math.degrees(math.acos(after[3]) - math.acos(before[3]))
    return turned > max(_LEAP, _LEAPS * (after[0] - before[0]))


def _carried_leaning(motion: tuple[Moment, ...]) -> str:
    """It leans as far as one flies level with, and is carried as that takes."""
    known = _carried(motion, leaning=True)
    sped_up = known[-1][1] - known[0][1] if known else -math.inf
    if sped_up < -_SPEEDS_UP or known[-1][1] < -_LIES_AND_SINKS:
        return ""
    force = fmean([one[2] for one in known])
    return f"a force of {force:.1f} m/s^2 carries it as it leans, and it does not sink"


def _carried(motion: tuple[Moment, ...], leaning: bool = False) -> list[Moment]:
    """The newest moments, if an accelerometer that lives tells in all of them that the vehicle is
    carried in full; empty: it does not. leaning: by the part of the force that points upwards, as
    far as it leans less than what lies on its side."""
    known = [one for one in _newest(motion) if not any(map(math.isnan, one))]
    if len(known) < _FEW or known[-1] is not motion[-1]:
        return []
    if leaning and min(one[3] for one in known) < _ON_ITS_SIDE:
        return []
    felt = [one[2] for one in known]
    forces = [one[2] * one[3] for one in known] if leaning else felt
    return known if _lives(felt) and _in_full(forces) else []


def _carries(motion: tuple[Moment, ...]) -> bool:
    """Upright, or as in a bank that is flown level."""
    return bool(_carried(motion) or _carried(motion, leaning=True))


def _in_full(forces: list[float]) -> bool:
    least, most = _CARRIED
    near = all(abs(force - GRAVITY) <= _SHAKES for force in forces)
    return near and least <= fmean(forces) <= most


def _lives(felt: list[float]) -> bool:
    return max(felt) - min(felt) >= _FORCE_LIVES


def _speed_lives(motion: tuple[Moment, ...]) -> bool:
    speeds = [one[1] for one in _last(motion, 1.0)]
    if any(map(math.isnan, speeds)):
        return False
    steps = [abs(after - before) for after, before in zip(speeds[1:], speeds, strict=False)]
    # One that sends noise differs by much from one to the next, and back again.
    return max(speeds) - min(speeds) >= _SPEED_LIVES and fmean(steps) <= _SPEED_STEADY


def _backwards(moments: list[Moment]) -> Iterator[tuple[Moment, Moment]]:
    return zip(moments[:0:-1], moments[-2::-1], strict=True)
