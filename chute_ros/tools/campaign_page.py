"""The results of a campaign as a page, and what more flights would take."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from chute_ros.campaign.campaign import Tally
from chute_ros.campaign.judge import WRONG, Count
from chute_ros.campaign.rare import OfEach
from chute_ros.campaign.scenario import MOST_FAULTS
from chute_ros.protocol.vehicle_merge import FRESH
from chute_ros.tools.campaign_picture import groups_of
from chute_ros.tools.pages import summary, table

#: For which a line of the plan tells.
_CORES = (1, 4, 16, 64, 256, 1024)
#: So many wrong flights are named, and so many causes.
_MOST_NAMED = 50
_INTRODUCTION = f"""\
Each flight is a world in virtual time: the real core, the nodes' runtime around it (`runtime/`:
the gate, requests, reports, the lease, the saved state), the real protocols (MAVLink, UPF on
DroneCAN, the umbilical), the simulated devices on a network, a CAN bus or a cable, one supervisor
or two.
Frames and messages are lost, doubled, delayed, overtaken, damaged; cables flap; processes hang,
stall, or die and start again; devices lose their power; wall clocks are set; sensors stick, drift,
jump, are noisy or silent: up to {MOST_FAULTS} of these at a time, most of them around the failure.
Some vehicles are armed by a person, some are killed or deployed by one; if that person wants the
kill alone, no deploy may follow.
Three of ten aircraft have an IMU, odometry or both besides their autopilot (`vehicle_sources`): on
power of its own, in a process and over a way of its own, and sometimes with one more fault there.
The autopilots answer, refuse, terminate and report their commands like PX4, ArduCopter, ArduPlane
or none of them (PX4 orders a release itself when it terminates the flight). Home is reset or
drifts in flight, and moves with a vehicle that is disarmed in the air. The ground differs from the
take-off: beside a roof, in a valley, on a hill. An estimator is wrong but consistent,
in height, speed and attitude together. Flips, dives, throws, fast descents, landings (soft and
hard, on a slope, with a bounce) and transitions from rotors to wings and back are flown on
purpose, with one sensor wrong or none. Some take off from a deck that moves, some fly for the
second time without a reset, some autopilots restart again and again. Some vehicles lose a part of
their thrust and sink upright; aeroplanes glide, stall, spin and dive. Some canopies open late, or
tangle and do not carry.

The truth comes from the flight models: the moment from which only a parachute helps (a rocket:
from which it comes down and no drogue will come by itself), and the last moment at which a release
still lands it softly. These flights are named with their cause:

- The time left was shorter than the chain takes: 2 s, and {FRESH:g} s more if the last report of
  an autopilot without power, that it does not sink, must get old first; for a vehicle that sinks
  upright, spins or dives, until it is faster than a soft landing; a rocket 6.5 s.
- No such time in a row was free of cuts, stops, second wrong sensors and (rocket) of seconds
  without a whole line of telemetry.
- The autopilot lost its power and no other source reported.
- The only parachute refused in time, for example because a wrong height told it that it stood.
- The flight was ended while two sensors were wrong: every rule rests on two signs, and no more can
  be known than they report. One wrong sensor must neither end a flight nor hide a fall. A sensor
  counts if the supervisor may use it: its source is the preferred one of those with this
  measurement, or a preferred one falls silent.
- The autopilot has no power and only an IMU is left, once drag carries half of the weight and the
  IMU's attitude is wrong, or was wrong in the last 10 s: a vehicle that flies well, with a hung
  autopilot and only a wrong attitude, would look the same.
- A level sink while the estimator and the barometer differ: nothing else reports it.
- The time in which a vehicle falls past the height of its take-off high above other ground, which
  cannot be known.

A canopy that is out and does not carry must be reported, or followed by the next parachute, within
3 s, also where a person deployed it from a good flight. Above one that carries no other may be
ordered: vehicles with two are followed for 12 s from the release. A kill alone must open no
parachute within 10 m of the height of the take-off."""

#: Seeds that were looked at, flights, how many of each kind.
_OF_EACH = """\
Of {} seeds these are {} flights: the first {} of each kind, and no more. A kind is a failure on
a vehicle with its sources, the kinds of faults around it and the person; or the
wrong sensors, and how they are wrong. So rare kinds are flown as often as common ones, and the
numbers below do not show how often anything happens."""


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
        *("", "## Faults", ""),
        table(("fault", "drawn"), [(kind, str(n)) for kind, n in sorted(tally.faults.items())]),
        *("", "## From the failure to the release", ""),
        *(f"![delays]({pictures['delays']})", "", f"![heights]({pictures['heights']})", ""),
        _delays(tally),
    ]
    return "\n".join(lines) + "\n"


def _counts(tally: Tally) -> list[str]:
    columns = sorted({(profile, vehicle) for vehicle, profile, _ in tally.by_vehicle})
    names = [v if v == p else f"{v}, {p}" for p, v in columns]
    rows = []
    for count in Count:
        numbers = [str(tally.by_vehicle[v, p, count]) for p, v in columns]
        rows.append((count.value, *numbers, str(tally.counts[count])))
    wrong = sum(tally.counts[one] for one in WRONG)
    return [table(("counted as", *names, "all"), rows), "", f"{wrong} of them are wrong."]


def _wrong(tally: Tally) -> list[str]:
    if not tally.wrong:
        return []
    rows = []
    for line in tally.wrong[:_MOST_NAMED]:
        who, what = f"{line.vehicle}, {line.profile}", f"{line.count.name}: {line.why}"
        rows.append((str(line.seed), who, line.failure, what))
    return ["", table(("seed", "vehicle", "what failed", "counted as"), rows)]


def _not_told(tally: Tally) -> list[str]:
    if not tally.reasons:
        return []
    # In the order of their numbers, and then of the alphabet: the same for the same seed.
    causes = sorted(tally.reasons.items(), key=lambda one: (-one[1], one[0]))
    rest = Counter(dict(causes[_MOST_NAMED:])).total()
    named = [*causes[:_MOST_NAMED], *([("other sets of the same causes", rest)] if rest else [])]
    rows = [(why, str(number)) for why, number in named]
    return ["", "## Not told", "", table(("why", "flights"), rows)]


def _powerless(tally: Tally) -> list[str]:
    """What becomes of those whose autopilot lost its power, by who tells of them besides it."""
    if not tally.powerless:
        return []
    counts = [one for one in Count if any(key[1] is one for key in tally.powerless)]
    names = [one.value.partition(":")[0] for one in counts]
    rows = [
        (second or "nothing", *(str(tally.powerless[second, one]) for one in counts))
        for second in sorted({key[0] for key in tally.powerless})
    ]
    return ["", "## Autopilot without power", "", table(("besides it", *names), rows)]


def _delays(tally: Tally) -> str:
    head = ("vehicle", "flights", "median", "99th percentile", "largest")
    rows = []
    for name, some in groups_of(tally.lines).items():
        times = summary([line.release_delay for line in some])
        middle, _, most = summary([line.height_lost for line in some])
        told = (*(f"{one:.2f} s" for one in times), f"{middle:.1f} m", f"{most:.1f} m")
        rows.append((name, str(len(some)), *told))
    return table((*head, "height lost: median", "most"), rows)


def plan(flights: int, rate: float, measured: int, price: float | None) -> str:
    """As a table. rate: flights a second of one core, in the mean of so many measured; price: of a
    core for an hour, in any currency; None: unknown, and so are the costs."""
    core_hours = flights / rate / 3600.0
    head = ["workers, one a core", "hours", "core hours"]
    if price is not None:
        head.append(f"cost at {price:g} a core hour")
    rows = []
    for cores in _CORES:
        row = [str(cores), f"{core_hours / cores:.1f}", f"{core_hours:.0f}"]
        if price is not None:
            row.append(f"{core_hours * price:.2f}")
        rows.append(row)
    return (
        f"{flights} flights, if each core flies {rate * 60.0:.0f} a minute, as in the {measured} "
        f"flights of this run:\n\n{table(head, rows)}"
    )
