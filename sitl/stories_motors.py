"""Motors that fail: one, several, all, in part; at several heights."""

from __future__ import annotations

from collections.abc import Callable

from sitl.autopilots import ARDUCOPTER, ARDUPLANE, PX4
from sitl.flight import Flight
from sitl.judge import Want
from sitl.stories import Story
from sitl.vehicle import Setup

#: One motor dead: so soon it must be out, s.
ONE_DEAD = 1.0
#: All dead: it falls upright, which shows later; and later still in PX4's SIH, whose air carries
#: half of the weight after 0.7 s, as the wing of the quadplane does from the beginning.
ALL_DEAD = {ARDUCOPTER: 1.3, ARDUPLANE: 2.0, PX4: 3.0}
_ARDUPILOT = (ARDUCOPTER, ARDUPLANE)


def _dead(height: float, mask: int, within: float = ONE_DEAD) -> Callable[[Flight], None]:
    def fly(flight: Flight) -> None:
        flight.go_up(height)
        flight.expect(Want.RELEASE, flight.fail_motors(mask), within)
        flight.see_it_out(6.0, 0.0)

    return fly


def _all_dead(height: float) -> Callable[[Flight], None]:
    def fly(flight: Flight) -> None:
        flight.go_up(height)
        flight.expect(Want.RELEASE, flight.fail_motors(0b1111), ALL_DEAD[flight.kind])
        flight.see_it_out(6.0, 0.0)

    return fly


def _low(flight: Flight) -> None:
    flight.go_up(5.0)
    flight.expect(Want.NO_RELEASE, flight.fail_motors(0b0001))
    flight.see_it_out(8.0)


def _partial(height: float, mask: int, thrust: float) -> Callable[[Flight], None]:
    def fly(flight: Flight) -> None:
        flight.go_up(height)
        flight.expect(Want.BY_TRUTH, flight.fail_motors(mask, thrust))
        flight.see_it_out(20.0)

    return fly


def _moving(flight: Flight) -> None:
    flight.go_up(40.0)
    flight.pilot.fly(10.0, 0.0, 0.0)
    if flight.kind == PX4:
        flight.change_mode("OFFBOARD")
    flight.vehicle.rest(5.0)
    flight.expect(Want.RELEASE, flight.fail_motors(0b0001), ONE_DEAD)
    flight.see_it_out(6.0, 0.0)


STORIES = (
    Story("motor-14", "one motor dead at 14 m", _dead(14.0, 0b0001)),
    Story("motor-30", "one motor dead at 30 m", _dead(30.0, 0b0001)),
    Story("motor-60", "one motor dead at 60 m", _dead(60.0, 0b0010)),
    Story("motor-moving", "one motor dead at 10 m/s and 40 m", _moving),
    Story("motor-5", "one motor dead at 5 m: too low for a parachute", _low),
    Story("motors-two-20", "two motors side by side dead at 20 m", _dead(20.0, 0b0101)),
    Story("motors-two", "two motors side by side dead at 40 m", _dead(40.0, 0b0101)),
    Story("motors-opposite", "two opposite motors dead at 40 m", _partial(40.0, 0b0011, 0.0)),
    Story("motors-opposite-70", "two opposite motors dead at 70 m", _partial(70.0, 0b0011, 0.0)),
    Story("motors-all", "all motors dead at 40 m", _all_dead(40.0)),
    Story("motors-all-70", "all motors dead at 70 m", _all_dead(70.0)),
    Story(
        "motor-hexa",
        "one of six motors dead at 30 m",
        _partial(30.0, 0b000001, 0.0),
        Setup(hexa=True),
        (ARDUCOPTER, PX4),
    ),
    Story(
        "thrust-one", "one motor has half of its thrust at 40 m", _partial(40.0, 1, 0.5),
        kinds=_ARDUPILOT,
    ),
    Story(
        "thrust-one-70", "one motor has half of its thrust at 70 m", _partial(70.0, 1, 0.5),
        kinds=_ARDUPILOT,
    ),
    Story(
        "thrust-all-70", "all motors have 70 % of their thrust at 60 m",
        _partial(60.0, 0b1111, 0.7),
    ),
    Story(
        "thrust-all-50", "all motors have half of their thrust at 60 m",
        _partial(60.0, 0b1111, 0.5), kinds=_ARDUPILOT,
    ),
    Story(
        "thrust-all-35", "all motors have 35 % of their thrust at 60 m",
        _partial(60.0, 0b1111, 0.35), kinds=_ARDUPILOT,
    ),
    Story(
        "thrust-all-35-30", "all motors have 35 % of their thrust at 30 m",
        _partial(30.0, 0b1111, 0.35), kinds=_ARDUPILOT,
    ),
    # In the air of PX4's SIH it sinks with 7 m/s then, and with 35 % no faster than it may land.
    Story(
        "thrust-all-15", "all motors have 15 % of their thrust at 60 m",
        _partial(60.0, 0b1111, 0.15), kinds=(PX4,),
    ),
)  # fmt: skip
