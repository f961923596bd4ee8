"""Motors that are stopped on purpose: by a person, by the ground station, on the bench."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.supervisor.machine import Stage
from sitl.autopilots import ARDUCOPTER, ARDUPLANE, PX4
from sitl.flight import Flight
from sitl.judge import Want
from sitl.stories import Story
from sitl.vehicle import Setup, Vehicle

#: From an operator's call to the release, s.
OPERATOR = 0.3
#: From the ground station's own kill, which only the fall tells of, s; a wing carries for a while.
_SEEN = {ARDUCOPTER: 1.3, ARDUPLANE: 2.0, PX4: 1.3}
_HEIGHT = 40.0


def _person(flight: Flight, ask: Callable[[Vehicle], tuple[float, Any]]) -> None:
    flight.go_up(_HEIGHT)
    since, answer = ask(flight.vehicle)
    flight.expect(Want.RELEASE, since, OPERATOR, "call")
    flight.see_it_out(6.0, 0.0)
    _note_answer(flight, answer)


def _person_kill(flight: Flight) -> None:
    _person(flight, Vehicle.ask_kill)


def _person_deploy(flight: Flight) -> None:
    _person(flight, Vehicle.ask_deploy)


def _person_kill_only(flight: Flight) -> None:
    flight.go_up(_HEIGHT)
    since, answer = flight.vehicle.ask_kill(kill_only=True)
    flight.expect(Want.KILL, since, cause="call")
    flight.vehicle.rest(1.0)
    _note_answer(flight, answer)


def _on_the_bench(flight: Flight) -> None:
    vehicle = flight.vehicle
    flight.get_ready()
    if flight.kind == PX4:
        flight.vehicle.set("COM_DISARM_PRFLT", 60.0)
    flight.change_mode("POSCTL" if flight.kind == PX4 else "GUIDED")
    if flight.kind == PX4:
        flight.pilot.sticks(0.0, 0.0, -1.0, 0.0)
    flight.arm()
    vehicle.rest(2.0)
    since, answer = vehicle.ask_kill()
    flight.expect(Want.KILL, since, cause="call")
    vehicle.rest(4.0)
    _note_answer(flight, answer)
    flight.pilot.let_go()


def _station(order: str) -> Callable[[Flight], None]:
    def fly(flight: Flight) -> None:
        flight.go_up(_HEIGHT)
        pilot = flight.pilot
        if order == "termination":
            number, since = dialect.MAV_CMD_DO_FLIGHTTERMINATION, pilot.terminate()
        else:
            number = dialect.MAV_CMD_COMPONENT_ARM_DISARM
            since = pilot.disarm(force=True)
        flight.vehicle.must("an answer", 3.0, lambda: number in flight.station.results)
        if not flight.station.accepted(number):
            flight.expect(Want.NOTHING, since)
            flight.verdict.happened.append("the autopilot refused it")
            flight.vehicle.rest(3.0)
            flight.come_down()
            return
        flight.expect(Want.RELEASE, since, _SEEN[flight.kind], "order")
        flight.see_it_out(6.0, 0.0)

    return fly


def _low(flight: Flight) -> None:
    flight.go_up(5.0)
    since, answer = flight.vehicle.ask_kill()
    flight.expect(Want.KILL, since, cause="call")
    flight.see_it_out(4.0)
    _note_answer(flight, answer)


def _note_answer(flight: Flight, answer: Any) -> None:
    flight.vehicle.until(6.0, answer.done)
    if not answer.done():
        flight.verdict.wrong.append("error: the call was not answered within 6 s")
        return
    told = answer.result()
    flight.verdict.happened.append(f"answered: {'success' if told.success else told.message}")
    if flight.vehicle.stage(Stage.FAULT):
        flight.verdict.wrong.append(f"error: {flight.vehicle.watch.safety.state_text}")


def _no_kill(flight: Flight) -> None:
    """ArduPlane refuses a termination without AFS: said before flight, with the setting's name."""
    flight.expect_block(20.0, "AFS_ENABLE", "though no kill is possible")


def _with(method: str, **settings: float) -> Setup:
    return Setup(node={"kill_method": method}, settings=settings)


STORIES = (
    Story("kill-bench", "safety/kill, armed on the ground", _on_the_bench),
    Story("kill-person", "safety/kill at 40 m", _person_kill),
    Story("kill-only", "safety/kill with kill_only at 40 m", _person_kill_only),
    Story("kill-low", "safety/kill at 5 m", _low),
    Story("deploy-person", "safety/deploy at 40 m", _person_deploy),
    Story("station-disarm", "the ground station disarms by force at 40 m", _station("disarm")),
    Story("station-terminate", "the ground station terminates at 40 m", _station("termination")),
    Story("kill-termination", "safety/kill at 40 m, kill_method flight_termination", _person_kill,
          _with("flight_termination"), (ARDUCOPTER, PX4)),
    Story("bench-termination", "safety/kill on the ground, kill_method flight_termination",
          _on_the_bench, _with("flight_termination"), (ARDUCOPTER, PX4)),
    Story("no-termination", "kill_method flight_termination, AFS_ENABLE 0", _no_kill,
          _with("flight_termination"), (ARDUPLANE,)),
    Story("kill-termination-afs",
          "safety/kill at 40 m, kill_method flight_termination, AFS_ENABLE 1, AFS_TERM_ACTION 42",
          _person_kill, _with("flight_termination", AFS_ENABLE=1, AFS_TERM_ACTION=42),
          (ARDUPLANE,)),
    Story("kill-disarm", "safety/kill at 40 m, kill_method forced_disarm", _person_kill,
          _with("forced_disarm")),
)  # fmt: skip
