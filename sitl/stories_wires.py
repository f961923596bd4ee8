"""How it is wired: through the autopilot, on a slow line, signed, with a ground station that asks
for other rates; and processes that start anew in flight."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence

from chute_ros.protocol.mavlink.dialect import dialect
from sitl.autopilots import ARDUCOPTER, ARDUPLANE, PX4
from sitl.flight import Flight
from sitl.judge import Want
from sitl.record import Seen, read
from sitl.stories import Story
from sitl.stories_motors import ONE_DEAD
from sitl.vehicle import CAN_NODE, FORWARDS, NODE, SUPERVISOR, Setup

_ARDUPILOT = (ARDUCOPTER, ARDUPLANE)
_HEIGHT = 40.0
#: What the rules live on.
_STREAMS = ("GLOBAL_POSITION_INT", "ATTITUDE", "EXTENDED_SYS_STATE")
#: On a slow line everything is later, s.
_SLOW = 1.5
#: A UPF tells its status ten times a second, s.
_TOLD = 0.1


def _motor(flight: Flight, within: float = ONE_DEAD) -> None:
    flight.expect(Want.RELEASE, flight.fail_motors(0b0001), within)
    flight.see_it_out(6.0, 0.0)


def _plain(flight: Flight) -> None:
    flight.go_up(_HEIGHT)
    _motor(flight)


def _rates(flight: Flight) -> None:
    flight.go_up(_HEIGHT)
    flight.vehicle.rest(8.0)
    _measure(flight, 8.0)
    _motor(flight)


def _slow(flight: Flight) -> None:
    flight.go_up(_HEIGHT)
    flight.vehicle.rest(8.0)
    _measure(flight, 8.0)
    _motor(flight, _SLOW)


def _dronecan(flight: Flight) -> None:
    """The autopilot's node 10 gives out node ids; ours leaves that to it."""
    vehicle = flight.vehicle
    flight.wait_for_position()
    flight.go_up(_HEIGHT)
    ours = [one for one in vehicle.watch.parachutes.values() if one.link == CAN_NODE]
    flight.verdict.happened.append(f"on the bus: {', '.join(one.device for one in ours)}")
    since = flight.fail_motors(0b0001)
    vehicle.until(6.0, flight.released)
    took = time.monotonic() - since
    flight.expect(Want.KILL, since)
    flight.verdict.times["failure to release (by its status)"] = took
    if not flight.released():
        flight.verdict.wrong.append("missed: not released")
    elif took > ONE_DEAD + _TOLD:
        flight.verdict.wrong.append(f"late: released after {took:.2f} s, need {ONE_DEAD:g} s")


def _too_slow(flight: Flight) -> None:
    """What the rules need does not come through: said before flight, with the stream's name."""
    flight.expect_block(25.0, "Hz (need", "though what the rules need comes too seldom")


def _fight(flight: Flight) -> None:
    """A ground station that asks for all streams at 1 Hz, again and again."""
    flight.go_up(_HEIGHT)
    if flight.kind == PX4:
        wanted = [getattr(dialect, f"MAVLINK_MSG_ID_{name}") for name in _STREAMS]

        def ask() -> object:
            wanted.append(wanted.pop(0))
            number = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
            return dialect.MAVLink_command_long_message(
                1, 1, number, 0, wanted[0], 1e6, *[0.0] * 5
            )

        flight.station.stream("fight", 3.0, ask)
    else:
        every = dialect.MAV_DATA_STREAM_ALL
        flight.station.stream(
            "fight",
            1.0,
            lambda: dialect.MAVLink_request_data_stream_message(1, 1, every, 1, 1),
        )
    flight.vehicle.rest(10.0)
    _measure(flight, 10.0)
    _motor(flight, _SLOW)
    flight.station.stop("fight")


def _measure(flight: Flight, seconds: float) -> None:
    """Note the rates of the last seconds on the companion computer's line."""
    until = time.monotonic()
    line = flight.vehicle.ports.line
    numbers = frozenset(getattr(dialect, f"MAVLINK_MSG_ID_{name}") for name in _STREAMS)

    def look(_: Sequence[Seen]) -> None:
        since = until - seconds
        some = read(flight.vehicle.record, since, numbers)
        counts = Counter(one.name for one in some if one.port == line and one.at <= until)
        rates = {name: counts[name] / seconds for name in _STREAMS}
        flight.verdict.happened.append(
            ", ".join(f"{name} {rate:.1f} Hz" for name, rate in rates.items())
        )

    flight.afterwards.append(look)


def _node_anew(name: str) -> Callable[[Flight], None]:
    def fly(flight: Flight) -> None:
        vehicle = flight.vehicle
        flight.go_up(_HEIGHT)
        vehicle.keeper.kill(name)
        vehicle.rest(6.0)
        _motor(flight)

    return fly


def _signed(flight: Flight) -> None:
    vehicle = flight.vehicle
    vehicle.give_key()
    flight.go_up(_HEIGHT)
    _motor(flight)


STORIES = (
    Story("rates", "message rates on a fast line; one motor dead at 40 m", _rates),
    Story("node-anew", "mavlink_parachute is killed in flight; 6 s later one motor dead",
          _node_anew(NODE), restarts=True),
    Story("supervisor-anew", "safety_supervisor is killed in flight; 6 s later one motor dead",
          _node_anew(SUPERVISOR), restarts=True),
    Story("fight", "a ground station asks for other rates all the time; one motor dead", _fight,
          spoils=True),
    Story("slow-57600", "a serial line of 57600 baud; one motor dead", _slow,
          Setup(line_rate=5760), spoils=True),
    Story("slow-2880", "a serial line of 2880 B/s; one motor dead", _slow, Setup(line_rate=2880),
          _ARDUPILOT, spoils=True),
    Story("too-slow", "a serial line of 600 B/s", _too_slow, Setup(line_rate=600),
          _ARDUPILOT, spoils=True),
    Story("too-slow-px4", "a serial line of 2000 B/s", _too_slow, Setup(line_rate=2000), (PX4,),
          spoils=True),
    Story("forwards", "no router: the parachute hangs on the autopilot, which forwards", _plain,
          Setup(wiring=FORWARDS), _ARDUPILOT, spoils=True),
    Story("dronecan", "a UPF parachute without node ids on the autopilot's bus; one motor dead",
          _dronecan,
          Setup(dronecan=True, settings={"CAN_P1_DRIVER": 1, "CAN_D1_PROTOCOL": 1}), _ARDUPILOT,
          spoils=True),
    Story("signed", "MAVLink 2 signing; one motor dead", _signed, Setup(signed=True), spoils=True),
)  # fmt: skip
