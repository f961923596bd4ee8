"""The steps from which the exploration of the supervisor's core builds every story."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from chute_ros.model import (
    Action,
    Armed,
    LandedState,
    LinkState,
    Outcome,
    ParachuteState,
    ParachuteStatus,
    VehicleState,
)
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.pending import Pending
from chute_ros.supervisor.profile_reader import read_profile
from chute_ros.supervisor.state import State

FIRST, SECOND = LINKS = ("mavlink_parachute", "upf_can")
LADDER = (FIRST, SECOND, f"{SECOND}:trigger")
#: s between two updates of a step, and of one that goes on.
TICK, TICK_OF_MANY = 0.1, 0.2
#: s: just over the longest hold of a rule and of a landing; just over the longest limit of all.
HELD, SILENCE = 1.2, 8.2
#: A measurement changes by so much a second, as of a sensor that is not stuck.
_NOISE = 1e-7

Make = Callable[[State, float, int], tuple[i.Input, ...] | None]


@dataclass(frozen=True)
class Step:
    """make: what comes at each update from (state, now, number of the next request); None: the
    step is not possible in this state. lasts: s; one update if that is TICK."""

    name: str
    make: Make
    lasts: float = TICK
    #: The vehicle does not speak in it.
    silent: bool = False


def configuration(root: Path) -> SupervisorConfig:
    """Two links that each kill and deploy, and the triggers of the second as the last resort."""
    text = (root / "config" / "profiles" / "multirotor.yaml").read_text(encoding="utf-8")
    return SupervisorConfig(
        required_links=LINKS,
        kill_links=LINKS,
        deploy_links=LINKS,
        deploy_ladder=tuple(Rung.parse(text) for text in LADDER),
        profile=read_profile(text, "multirotor", LINKS),
    )


def steps() -> list[Step]:
    """The alphabet."""
    found = [Step(name, _told(vehicle)) for name, vehicle in VEHICLES.items()]
    found += [
        Step(f"{name}, for {HELD:g} s", _told(vehicle), HELD)
        for name, vehicle in VEHICLES.items()
        if name not in _BRIEF
    ]
    found += [
        Step("nothing comes", lambda *_: (), silent=True),
        Step(f"nothing comes for {SILENCE:g} s", lambda *_: (), SILENCE, silent=True),
        Step(f"only heartbeats for {HELD:g} s", _beats(), HELD, silent=True),
    ]
    for link in LINKS:
        found += [
            Step(f"{link} unhealthy", _beats({link: {"device_healthy": False}})),
            Step(f"{link} LOST", _beats({link: {"link_state": LinkState.LOST}}), silent=True),
            Step(f"{link} restarted", _beats({link: {"seq": -1}})),
            Step(f"{link} deployed", _parachute(link, True)),
            Step(f"{link} not deployed", _parachute(link, False)),
        ]
        found += [
            Step(f"kill {outcome.name} by {link}", _report("kill", outcome, link))
            for outcome in (Outcome.ACCEPTED, Outcome.CONFIRMED, Outcome.FAILED)
        ]
    found += [
        Step(f"deploy {outcome.name}", _report("deploy", outcome))
        for outcome in Outcome
        if outcome is not Outcome.NONE
    ]
    found.append(Step("a node has seen a newer epoch", _report("kill", Outcome.FAILED, FIRST, 1)))
    found += [
        Step("deploy asked for", _asked(lambda n: i.DeployRequest(n, False, f"request {n}"))),
        Step("deploy forced", _asked(lambda n: i.DeployRequest(n, True, f"request {n}"))),
        Step("kill asked for", _asked(lambda n: i.KillRequest(n, "operator", f"request {n}"))),
        Step("reset asked for", _asked(i.ResetRequest)),
        Step("armed", _asked(lambda n: i.ArmDone(n, True, True, "done"))),
        Step("disarmed", _asked(lambda n: i.ArmDone(n, False, True, "done"))),
        Step("a device asks for a kill", lambda *_: (i.KillRequest(0, f"{SECOND} 33", "why"),)),
        Step("a device blocks flight", lambda *_: (i.BlockRequest(SECOND, "33", True, "why"),)),
    ]
    found += [Step(f"mode {mode.name}", _asked(_to(mode))) for mode in i.Mode]
    return found


def _to(mode: i.Mode) -> Callable[[int], i.Input]:
    return lambda number: i.ModeRequest(number, mode, True)


_LEVEL = VehicleState(
    link_state=LinkState.OK,
    armed=Armed.ARMED,
    armed_age=0.0,
    landed_state=LandedState.IN_AIR,
    landed_state_age=0.0,
    height=50.0,
    height_age=0.0,
    vertical_speed_age=0.0,
    attitude_age=0.0,
    acceleration=9.8,
    acceleration_age=0.0,
    latitude=48.0,
    longitude=11.0,
    position_age=0.0,
    battery_remaining=0.8,
    battery_age=0.0,
    system_status=4,
)


def _vehicle(
    tilt: float = 5.0, sink: float = 0.0, restarts: int = 0, **other: Any
) -> VehicleState:
    """Degrees, m/s downwards, and what is other than in level flight."""
    return replace(
        _LEVEL,
        tilt=math.radians(tilt),
        vertical_speed=-sink,
        reboot_count=restarts,
        rebooted_in_flight=restarts > 0,
        **other,
    )


_OFF = {"armed": Armed.DISARMED}
_DOWN = {"landed_state": LandedState.ON_GROUND}
#: What the vehicle can say; each number just over the limit of a rule of the profile.
VEHICLES = {
    "flies level": _vehicle(),
    "stands disarmed": _vehicle(**_OFF, **_DOWN, height=0.1),
    "stands armed": _vehicle(**_DOWN, height=0.1),
    "lies on its side disarmed": _vehicle(61.0, **_OFF, **_DOWN, height=0.1),
    "lies on its side armed": _vehicle(61.0, **_DOWN, height=0.1),
    "tips over": _vehicle(tilt=61.0, sink=3.1),
    "tips over below the minimum height": _vehicle(tilt=61.0, sink=3.1, height=9.9),
    "tips over at the ground": _vehicle(tilt=61.0, height=0.5),
    "on its side disarmed in an emergency": _vehicle(61.0, **_OFF, system_status=6),
    "sinks": _vehicle(sink=12.1),
    "falls freely": _vehicle(sink=3.0, acceleration=1.9),
    "falls and says landed": _vehicle(sink=12.1, **_DOWN),
    "falls and says disarmed": _vehicle(
        sink=3.0, **_OFF, landed_state=LandedState.UNKNOWN, acceleration=1.9
    ),
    "sinks after a restart": _vehicle(sink=5.1, restarts=1),
    "flies level after a restart": _vehicle(restarts=1),
    "sinks in an emergency": _vehicle(sink=6.1, system_status=6),
    "autopilot LOST, level": _vehicle(link_state=LinkState.LOST),
    "autopilot LOST, sinks": _vehicle(link_state=LinkState.LOST, sink=6.1),
}
#: A step lasts HELD as well with all but these.
_BRIEF = ("falls freely", "flies level after a restart")


def _beats(differs: dict[str, dict[str, Any]] | None = None) -> Make:
    def make(state: State, _now: float, _number: int) -> tuple[i.Input, ...]:
        made = []
        for link in LINKS:
            seq = state.evidence(link).seq + 1
            beat = i.LinkHeartbeat(link, LinkState.OK, True, seq)
            made.append(replace(beat, **(differs or {}).get(link, {})))
        return tuple(made)

    return make


def _told(vehicle: VehicleState) -> Make:
    beats = _beats()

    def make(state: State, now: float, number: int) -> tuple[i.Input, ...]:
        told = dict(vars(vehicle))
        for name in ("height", "vertical_speed", "tilt", "acceleration"):
            told[name] += _NOISE * (now % 1000.0)
        return (*(beats(state, now, number) or ()), i.VehicleReport(VehicleState(**told)))

    return make


def _parachute(link: str, deployed: bool) -> Make:
    working = ParachuteState.LAUNCHED if deployed else ParachuteState.READY
    status = ParachuteStatus("1", LinkState.OK, working, deployed=deployed)
    return lambda *_: (i.ParachuteReport(link, status),)


def _report(what: str, outcome: Outcome, link: str = "", newer: int = 0) -> Make:
    def make(state: State, _now: float, _number: int) -> tuple[i.Input, ...] | None:
        pending: Pending | None = state.killing.kill if what == "kill" else state.deploy
        # Of what was only said nobody reports anything.
        if pending is None or pending.decision.action is Action.NONE:
            return None
        decision, who = pending.decision, link or pending.targets[0]
        epoch = decision.epoch + newer
        return (i.ActionReport(*pending.number, who, outcome, "told", newest_epoch=epoch),)

    return make


def _asked(request: Callable[[int], i.Input]) -> Make:
    return lambda _state, _now, number: (request(number),)
