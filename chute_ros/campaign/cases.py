"""What fails on a described vehicle, and in which flight: the flights of each such case."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace

from chute_ros.campaign.described import DescribedVehicle
from chute_ros.campaign.draw import fault_around
from chute_ros.campaign.draw_world import ENDS, end_of_control, with_body
from chute_ros.campaign.manoeuvre import Manoeuvre
from chute_ros.campaign.scenario import Autopilot, Canopy, Failure, Scenario
from chute_ros.sim.autopilot_device import GUSTS_OF_WIND
from chute_ros.sim.autopilot_kinds import ARDUPLANE, PX4
from chute_ros.sim.flight import Descent
from chute_ros.sim.home import Homing

#: When it fails, s after it is up; a descent begins then, and is steady so much later.
FLOWN_BEFORE = 1.0
_FAILS, _DESCENT_BEGINS, _STEADY = (FLOWN_BEFORE, 1.6), 0.2, 1.0
#: A descent takes half a second's way less than it would at full speed from the start (Manoeuvre).
_SLOWER_FOR = 0.5
_DESCENT_LASTS = 10.0
#: What home does as a vehicle is disarmed in the air (home.py); another autopilot's stays.
_HOMING = {PX4.name: Homing.FOLLOWS, ARDUPLANE.name: Homing.ZEROED}


@dataclass(frozen=True)
class Case:
    """name: what fails, in short; about: what becomes of the vehicle. end: name of the Descent of
    an aeroplane out of control; empty: as the failure has it. descends: it fails in a descent;
    otherwise in level flight. faults: one to so many of the campaign's faults come around it."""

    name: str
    about: str
    failure: Failure
    end: str = ""
    descends: bool = False
    faults: int = 0

    @property
    def flown(self) -> str:
        """In which flight it fails, in a word."""
        return "descent" if self.descends else "level"


_FALLS = "it falls and tumbles"
_UNHELD = "nothing holds the vehicle: a multirotor tumbles, an aeroplane ends in a spiral dive"
_OF_BOTH = (
    Case("autopilot restarts", f"its motors stop with it; {_UNHELD}", Failure.REBOOT),
    Case(
        "power lost",
        "motors and autopilot stop, and the autopilot is silent: only another source of "
        f"`vehicle_sources` can still tell of the fall; {_UNHELD}",
        Failure.POWER,
    ),
)
_CASES = {
    "multirotor": (
        Case("motor lost", f"the other motors do not carry it; {_FALLS}", Failure.MOTOR),
        Case(
            "thrust partly lost",
            "it stays upright, and sinks faster and faster: 7 to 12 m/s in the end, if the "
            "description says nothing else",
            Failure.SINK,
        ),
        *_OF_BOTH,
    ),
    "fixed_wing": (
        Case("breaks", f"no wing carries it any more; {_FALLS}", Failure.MOTOR),
        *_OF_BOTH,
        *(
            Case(
                name,
                f"out of control: about {sink:g} m/s in the end, if the description says nothing "
                f"else, {tilt:g} degrees from upright; it settles with a time constant of about "
                f"{settles:g} s",
                Failure.STALL,
                name,
            )
            for name, (sink, settles, tilt, _) in ENDS.items()
        ),
    ),
}


def cases(vehicle: DescribedVehicle, faults: int = 0) -> list[Case]:
    """Every failure of the world that only a parachute helps, level and then in a descent."""
    level = [replace(one, faults=faults) for one in _CASES[vehicle.kind]]
    descents = [replace(one, descends=True) for one in level] if vehicle.descent_speed else []
    return [*level, *descents]


def flight_of(vehicle: DescribedVehicle, case: Case, seed: int, height: float = 0.0) -> Scenario:
    """The same for the same seed. height: at which it fails, m; 0: one that it is flown at."""
    chance = random.Random(f"{seed} {case.name} {case.flown} {case.faults}")
    flown_at = vehicle.heights.draw(chance)
    fails = chance.uniform(*_FAILS)
    autopilot = Autopilot(_HOMING.get(vehicle.autopilot, Homing.STAYS), kind=vehicle.autopilot)
    drawn = Scenario(
        seed,
        vehicle.parachute,
        vehicle.kind,
        height or flown_at,
        GUSTS_OF_WIND * chance.uniform(0.0, vehicle.wind),
        vehicle.draw_fall_speed(chance),
        0.0,
        case.failure,
        fails,
        aps=vehicle.self_release,
        vehicle_sources=vehicle.vehicle_sources,
        canopy=Canopy(vehicle.descent_rate, vehicle.opening_time.draw(chance)),
        autopilot=autopilot,
    )
    drawn = _with_descents(chance, vehicle, case, drawn)
    if case.descends:
        drawn = _in_a_descent(vehicle.descent_speed, drawn)
    if case.faults:
        number = chance.randint(1, case.faults)
        around = (fault_around(chance, drawn.vehicle, fails, False) for _ in range(number))
        drawn = replace(drawn, faults=tuple(around))
    return drawn


def _with_descents(
    chance: random.Random, vehicle: DescribedVehicle, case: Case, drawn: Scenario
) -> Scenario:
    drawn = with_body(chance, drawn)
    if case.end:
        end = end_of_control(chance, case.end)
        drawn = replace(drawn, descent=end, unheld=end)
    share = chance.random()
    return replace(
        drawn,
        descent=_as_described(drawn.descent, vehicle, share),
        unheld=_as_described(drawn.unheld, vehicle, share),
    )


def _as_described(one: Descent | None, vehicle: DescribedVehicle, share: float) -> Descent | None:
    """With the sink that the description gives, so far between its least and most (0 to 1)."""
    sinks = dict(vehicle.sinks)
    if one is None or one.name not in sinks:
        return one
    least, most = sinks[one.name]
    return replace(one, sink=least + share * (most - least))


def _in_a_descent(speed: float, drawn: Scenario) -> Scenario:
    """It fails as late in it as it would in level flight, and at the same height."""
    fails = drawn.failure_at + _DESCENT_BEGINS + _STEADY
    descent = Manoeuvre("descent", speed, _DESCENT_BEGINS, _DESCENT_LASTS)
    sunk = speed * (fails - _DESCENT_BEGINS - _SLOWER_FOR)
    return replace(drawn, manoeuvre=descent, failure_at=fails, height=drawn.height + sunk)
