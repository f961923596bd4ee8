"""The results of flights on tapes as a page."""

from __future__ import annotations

from collections import Counter

from chute_ros.campaign.campaign import Tally
from chute_ros.campaign.judge import WRONG, Count
from chute_ros.campaign.tapes import Tapes
from chute_ros.campaign.truth import SOFT
from chute_ros.tools.pages import table

#: So many wrong flights are named.
_MOST_NAMED = 100
_INTRODUCTION = f"""\
The campaign's own bodies are small models. Here physics that others wrote flies the vehicle:
`make tapes` flies multirotors in RotorPy and aeroplanes in JSBSim, lets something fail, and
records what they do until they are on the ground (`chute_ros/sim/tape.py`). A flight of the
campaign plays such a tape: height, vertical speed, attitude, specific force, and what the
controller commanded, as the autopilot reports it in ATTITUDE_TARGET, POSITION_TARGET_LOCAL_NED or
NAV_CONTROLLER_OUTPUT. On top come the errors of real sensors (ours: vibration, bias, the port
error of a barometer, an estimator that follows late and wanders).

**The tape ends when our side acts.** Once the kill has stopped the motors or the parachute is
out, the small model (`sim/flight.py`) takes over from the height, the vertical speed and the tilt
of that moment, with the body's own speed of fall: nobody recorded a killed vehicle or a canopy.
So these flights show whether and when the supervisor decides, and no more about what follows than
the others do.

The truth is the tape's:

- A vehicle is lost from its failure on if it ever sinks faster than {SOFT} m/s or lies more than
  60 degrees over without a command to do so.
- If it then touches the ground faster than {SOFT} m/s, or more than 60 degrees over, it must be
  released. The last moment is found by putting the small model's canopy onto each row of the
  tape; the time that is needed counts from the first such sink, or the first such tilt with a
  sink of 3 m/s: attitude alone is one sign, and ends no flight.
- If it is lost and comes down softly by chance, or is in the air when the tape ends, neither a
  release nor none is wrong.
- All others fly: every kill or release there is false.


"""
_LIMITS = (
    (
        """\
RotorPy: Hummingbird and PX4's SIH quadrotor with its own parameters; a quadrotor of 4 kg, a
hexarotor of 7 kg and an octorotor of 15 kg, scaled by us""",
        """\
rigid body, rotor lag, drag of rotors and frame, inflow, translational lift; a dead or weak rotor,
tumbling, the yaw of a quadrotor with three rotors""",
        """\
the drag that damps a tumble without rotors (it has none); vortex ring, ground effect, blades that
break. Mixer, controller and wind are ours (its Dryden wind needs torch), and its derivatives are
integrated by us (its own step knows four rotors)""",
    ),
    (
        "JSBSim: c172x, c172p, J3Cub and minisgs, as they come with it",
        """\
coefficients over angle of attack and sideslip with a stall, propeller and piston engine, Milspec
turbulence; stall, spin, spiral, phugoid, glide""",
        """\
a spin as it would be: beyond the stall the tables are their authors' guess. Three of the four
weigh 400 to 1100 kg; the only unmanned size is a glider of 5 kg. No ground, no structure that
breaks; the controller is ours""",
    ),
)


def page_of_bodies(tally: Tally, tapes: Tapes, seeds: str, how: str) -> str:
    """As Markdown. seeds: as given to make campaign; how: what the speed depends on, in words."""
    flights = f"{tally.by_body.total()} flights on {len(tapes.labels)} tapes of `make tapes`"
    flown = f"{flights}, {tally.took:.0f} s, {how}"
    limits = [tuple(" ".join(cell.split()) for cell in row) for row in _LIMITS]
    lines = [
        *("# Bodies made by others", ""),
        f"Written by `make campaign TAPES=FILE {seeds}`: {flown}.",
        *("", _INTRODUCTION, table(("body", "shows", "does not show"), limits), ""),
        *("## Tapes", "", _tapes(tapes), ""),
    ]
    for heading, faulty in (("Nothing else goes wrong", False), ("With other faults", True)):
        lines += [f"## {heading}", "", _counts(tally, faulty), ""]
    wrong = [line for line in tally.wrong if line.body]
    lines += ["## Wrong", "", f"{len(wrong)} flights."]
    if wrong:
        rows = [
            (str(one.seed), f"{one.vehicle}, {one.failure}", f"{one.count.name}: {one.why}")
            for one in wrong[:_MOST_NAMED]
        ]
        lines += ["", table(("seed", "vehicle, tape", "counted as"), rows)]
    return "\n".join(lines) + "\n"


def _tapes(tapes: Tapes) -> str:
    counts: Counter[tuple[str, str, str]] = Counter()
    for label in tapes.labels:
        counts[label.body, label.failed, label.end] += 1
    ends = sorted({end for *_, end in counts})
    rows = [
        (body, failed, *(str(counts[body, failed, end]) for end in ends))
        for body, failed in sorted({(body, failed) for body, failed, _ in counts})
    ]
    return table(("body", "what fails", *ends), rows)


def _counts(tally: Tally, faulty: bool) -> str:
    every = {count for _, with_faults, count in tally.by_body if with_faults is faulty}
    counts = [one for one in Count if one in every or one in WRONG[:3]]
    bodies = sorted({body for body, with_faults, _ in tally.by_body if with_faults is faulty})
    rows = [(body, *(str(tally.by_body[body, faulty, one]) for one in counts)) for body in bodies]
    totals = [sum(int(row[at + 1]) for row in rows) for at in range(len(counts))]
    names = [one.value.partition(":")[0] for one in counts]
    return table(("body: what fails", *names), [*rows, ("all", *map(str, totals))])
