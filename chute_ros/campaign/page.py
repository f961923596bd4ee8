"""The results of a campaign as a page."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Mapping

from chute_ros.campaign.campaign import Tally
from chute_ros.campaign.judge import WRONG, Count
from chute_ros.campaign.picture import groups_of
from chute_ros.campaign.rare import OfEach
from chute_ros.campaign.scenario import MOST_FAULTS
from chute_ros.protocol.vehicle_merge import FRESH

#: So many wrong flights are named, and so many causes.
_MOST_NAMED = 50
_INTRODUCTION = f"""\
Each flight is a world in virtual time: the real core, what the nodes do around it (`runtime/`:
the gate, requests, reports, the lease, what is kept), the real protocols (MAVLink, UPF on
DroneCAN, the umbilical), the simulated devices on a network, a CAN bus or a cable, one supervisor
or two.
Frames and messages are lost, doubled, delayed, overtaken, damaged; cables flap; processes hang,
stall, or die and start again; devices lose their power; wall clocks are set; sensors stick, drift,
jump, are noisy or silent: up to {MOST_FAULTS} of these at a time, most of them around the failure.
Some vehicles are armed by a person, some are killed or deployed by one; where that one wants the
kill alone, no deploy may follow.
Three of ten aircraft have an IMU, odometry or both besides their autopilot (`vehicle_sources`): on
power of its own, in a process and over a way of its own, and sometimes with one more fault there.
The autopilots answer, refuse, terminate and tell what they command as PX4, ArduCopter, ArduPlane
or none of them (PX4 orders a release itself when it terminates the flight). Home is set anew or
drifts in flight, and moves with a vehicle that is disarmed in the air. The ground is elsewhere
than where it took off: beside a roof, in a valley, on a hill. An estimator is wrong with itself,
in height, speed and attitude together. Flips, dives, throws and fast descents are flown on
purpose, with one sensor wrong or none. Some lose a part of their thrust and sink upright;
aeroplanes glide, stall, spin and dive. Some canopies open late, or tangle and do not carry.

The truth comes from the flight models: since when only a parachute helps (a rocket: since when it
comes down and no drogue will come by itself), and until when its release still lands it softly.
Flights that left less time than the chain takes (2 s, and {FRESH:g} s more where the last word of
an autopilot without power, that it does not sink, must get old first; until what sinks upright,
spins or dives is faster than a soft landing; a rocket 6.5 s), or in which
no such time in a row was free of cuts, stops, second wrong sensors and (rocket) of seconds without
a whole line of telemetry, are named with the cause. So are those whose autopilot lost its power
and that nobody else told of, those whose only parachute refused in time, as by the wrong height
that it was told it stood, and those that were ended while two sensors told what was not so: every
rule rests on two signs, and no more can be known than they tell; one sensor that is wrong must
neither end a flight nor hide a fall. A sensor counts where the supervisor may go by it: its source
is the preferred one of those that know this, or a preferred one falls silent.
Where the autopilot has no power and an IMU is all that is left, no more can be known once drag
carries half of the weight and its attitude is wrong, or lied in the last 10 s: just so it would
tell of one that flies well, whose autopilot hangs and whose attitude alone is wrong. Those are
named as well. So are level sinks while the estimator tells one thing and the barometer another, as
nothing else tells them; and the time in which something falls past the height of its take-off high
above other ground, which cannot be known. A canopy that is out and does not carry must be told of,
or followed by the next parachute, within 3 s; a kill alone must open no parachute within 10 m of
the height of the take-off."""

#: Seeds that were looked at, flights, how many of each kind.
_OF_EACH = """\
Of {} seeds these are {} flights: the first {} of each kind, and no more. A kind is what fails on
which vehicle with which sources, with which kinds of faults around it and which person; or with
which sensors wrong, and how. So the rare are flown as often as the common, and the numbers below
say nothing of how often anything happens."""


def page(
    tally: Tally,
    seed: int,
    how: str,
    pictures: Mapping[str, str],
    of_each: OfEach | None = None,
) -> str:
    """As Markdown. how: what the speed depends on, in words; pictures: the names of the files of
    "delays" and "heights"; of_each: how the flights were chosen; None: each seed was flown."""
    flown = f"{tally.took:.0f} s, {tally.a_minute:.0f} flights a minute, {how}"
    seeds, chosen = f"FLIGHTS={tally.flights} SEED={seed}", []
    if of_each is not None:
        looked_at, each = of_each
        seeds = f"FLIGHTS={looked_at} SEED={seed} EACH={each}"
        chosen = [_OF_EACH.format(looked_at, tally.flights, each), ""]
    lines = [
        *("# Fault campaign", ""),
        *(f"Written by `make campaign {seeds}`: {flown}.", ""),
        *chosen,
        *(_INTRODUCTION, ""),
        *_counts(tally),
        *_wrong(tally),
        *_not_told(tally),
        *_powerless(tally),
        *("", "## Faults", "", "| fault | drawn |", "|---|---|"),
        *(f"| {kind} | {number} |" for kind, number in sorted(tally.faults.items())),
        *("", "## From the failure to the release", ""),
        *(f"![delays]({pictures['delays']})", "", f"![heights]({pictures['heights']})", ""),
        *_delays(tally),
    ]
    return "\n".join(lines) + "\n"


def _counts(tally: Tally) -> list[str]:
    columns = sorted({(profile, vehicle) for vehicle, profile, _ in tally.by_vehicle})
    names = [v if v == p else f"{v}, {p}" for p, v in columns]
    lines = [f"| counted as | {' | '.join(names)} | all |", "|---" * (len(names) + 2) + "|"]
    for count in Count:
        numbers = [str(tally.by_vehicle[v, p, count]) for p, v in columns]
        lines.append(f"| {count.value} | {' | '.join(numbers)} | {tally.counts[count]} |")
    return [*lines, "", f"{sum(tally.counts[one] for one in WRONG)} of them are wrong."]


def _wrong(tally: Tally) -> list[str]:
    if not tally.wrong:
        return []
    lines = ["", "| seed | vehicle | what failed | counted as |", "|---|---|---|---|"]
    for line in tally.wrong[:_MOST_NAMED]:
        who, what = f"{line.vehicle}, {line.profile}", f"{line.count.name}: {line.why}"
        lines.append(f"| {line.seed} | {who} | {line.failure} | {what} |")
    return lines


def _not_told(tally: Tally) -> list[str]:
    if not tally.reasons:
        return []
    # In the order of their numbers, and then of the alphabet: the same for the same seed.
    causes = sorted(tally.reasons.items(), key=lambda one: (-one[1], one[0]))
    rest = Counter(dict(causes[_MOST_NAMED:])).total()
    lines = ["", "## Not told", "", "| why | flights |", "|---|---|"]
    lines += [f"| {why} | {number} |" for why, number in causes[:_MOST_NAMED]]
    return [*lines, *([f"| other sets of the same causes | {rest} |"] if rest else [])]


def _powerless(tally: Tally) -> list[str]:
    """What becomes of those whose autopilot lost its power, by who tells of them besides it."""
    if not tally.powerless:
        return []
    counts = [one for one in Count if any(key[1] is one for key in tally.powerless)]
    names = [one.value.partition(":")[0] for one in counts]
    lines = ["", "## Autopilot without power", ""]
    lines += [f"| besides it | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    for second in sorted({key[0] for key in tally.powerless}):
        numbers = [str(tally.powerless[second, one]) for one in counts]
        lines.append(f"| {second or 'nothing'} | {' | '.join(numbers)} |")
    return lines


def _delays(tally: Tally) -> list[str]:
    lines = [
        "| vehicle | flights | median | 99th percentile | largest | height lost: median | most |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, some in groups_of(tally.lines).items():
        delays = sorted(line.release_delay for line in some)
        lost = sorted(line.height_lost for line in some)
        high = delays[math.ceil(0.99 * len(delays)) - 1]
        lines.append(
            f"| {name} | {len(some)} | {statistics.median(delays):.2f} s | {high:.2f} s | "
            f"{delays[-1]:.2f} s | {statistics.median(lost):.1f} m | {lost[-1]:.1f} m |"
        )
    return lines
