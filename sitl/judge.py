"""What happened in a run, by the record and the simulator's truth, and what of it is wrong."""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from chute_ros.protocol.mavlink.dialect import dialect
from sitl.pilot import FORCE
from sitl.record import Seen
from sitl.truth import Truth

#: A heartbeat comes once a second: motors that are off are told of so much later at most, s.
_TOLD_WITHIN = 1.5
#: Below it a parachute helps nobody: nothing may be released there (minimum_height of the profile
#: is 10 m; what falls while it is decided comes off), m.
TOO_LOW = 6.0
_NODE = 191
#: The messages of a record that are looked at.
NUMBERS = frozenset(
    getattr(dialect, f"MAVLINK_MSG_ID_{name}")
    for name in ("HEARTBEAT", "COMMAND_LONG", "COMMAND_ACK", "PARACHUTE_STATUS", "STATUSTEXT",
                 "SIM_STATE", "HIL_STATE_QUATERNION")
)  # fmt: skip
_ARMED = dialect.MAV_MODE_FLAG_SAFETY_ARMED


class Want(enum.Enum):
    """What a story must come to."""

    #: Neither killed nor released.
    NOTHING = "nothing killed, nothing released"
    #: Released, in time, once.
    RELEASE = "released"
    #: The motors off, and nothing released.
    KILL = "killed, nothing released"
    #: Not released; whether the motors are stopped is left open.
    NO_RELEASE = "nothing released"
    #: What the simulator's truth shows: released if the vehicle was lost and high enough.
    BY_TRUTH = "released if it was lost"


@dataclass
class Expectation:
    """want, counted from since (monotonic); within: the longest time to the release, s."""

    want: Want = Want.NOTHING
    since: float = math.nan
    within: float = math.nan
    #: What since is, in the words of the page.
    cause: str = "failure"


@dataclass
class Verdict:
    """Of a run: what happened, in words; times, s; what was false, missed or late."""

    happened: list[str] = field(default_factory=list)
    times: dict[str, float] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)
    #: The longest time that this machine kept the node or the simulator from running, s.
    held_up: float = 0.0
    #: Of the machine, in the last minute of the run.
    load: float = 0.0


@dataclass(frozen=True)
class Events:
    """What matters of a record, each with its time."""

    #: Releases that somebody ordered: (when, component).
    releases: list[tuple[float, int]]
    #: When the parachute said that it is out; NaN: never.
    out: float
    #: Kills that the node ordered: (when, command).
    kills: list[tuple[float, str]]
    #: Heartbeats of the autopilot: (when, armed and not terminated).
    armed: list[tuple[float, bool]]
    #: STATUSTEXT: (when, component, text).
    said: list[tuple[float, int, str]]

    def disarmed_after(self, since: float) -> float:
        """When the autopilot's heartbeat first said so; NaN: it did not."""
        return next((at for at, armed in self.armed if at >= since and not armed), math.nan)


def events_of(record: Sequence[Seen], truth_ports: Sequence[int]) -> Events:
    """From a record. truth_ports: the bench's, which the vehicle does not hear."""
    releases, kills, armed, said = [], [], [], []
    out = math.nan
    for seen in record:
        if seen.port in truth_ports:
            continue
        message = seen.message
        if seen.name == "COMMAND_LONG":
            if message.command == dialect.MAV_CMD_DO_PARACHUTE and message.param1 == 2.0:
                releases.append((seen.at, seen.component))
            elif seen.component == _NODE and (method := _kill_of(message)):
                kills.append((seen.at, method))
        elif seen.name == "PARACHUTE_STATUS":
            if message.deployment_status and math.isnan(out):
                out = seen.at
        elif seen.name == "HEARTBEAT" and seen.component == 1:
            terminated = message.system_status == dialect.MAV_STATE_FLIGHT_TERMINATION
            armed.append((seen.at, bool(message.base_mode & _ARMED) and not terminated))
        elif seen.name == "STATUSTEXT":
            said.append((seen.at, seen.component, message.text))
    return Events(releases, out, kills, armed, said)


def _kill_of(message: Any) -> str:
    if message.command == dialect.MAV_CMD_DO_FLIGHTTERMINATION:
        return "termination"
    forced = message.param1 == 0.0 and message.param2 == FORCE
    if message.command == dialect.MAV_CMD_COMPONENT_ARM_DISARM and forced:
        return "forced disarm"
    return ""


def judge(expected: Expectation, events: Events, truth: Truth, verdict: Verdict) -> None:
    """Add to verdict what happened, and what of it must not be."""
    since, out = expected.since, events.out
    kills = [one for one in events.kills if not one[0] < since]
    if kills:
        verdict.times[f"{expected.cause} to kill"] = kills[0][0] - since
        verdict.happened.append(f"killed ({_ways(kills)})")
    if not math.isnan(out):
        there = truth.when(out)
        verdict.times[f"{expected.cause} to release"] = out - since
        verdict.happened.append(
            f"released at {there.height:.0f} m, {there.climb:+.0f} m/s, {there.tilt:.0f} deg"
        )
        if there.height < TOO_LOW:
            verdict.wrong.append(f"false: released at {there.height:.1f} m")
        if out < since:
            verdict.wrong.append(
                f"false: released {since - out:.2f} s before the {expected.cause}"
            )
    before = [one for one in events.kills if one[0] < since]
    if before and expected.want is not Want.NOTHING:
        verdict.wrong.append(f"false: killed {since - before[0][0]:.2f} s before it was needed")
    _JUDGES[expected.want](expected, events, truth, verdict)
    # Of a story in which nothing is to happen no time runs.
    verdict.times = {what: took for what, took in verdict.times.items() if not math.isnan(took)}


def _ways(kills: list[tuple[float, str]]) -> str:
    return ", ".join(dict.fromkeys(way for _, way in kills))


def _nothing(_: Expectation, events: Events, truth: Truth, verdict: Verdict) -> None:
    if events.kills:
        there = truth.when(events.kills[0][0])
        verdict.wrong.append(f"false: killed at {there.height:.1f} m")
    _no_release(_, events, truth, verdict)
    if not verdict.wrong:
        verdict.happened.append("nothing killed, nothing released")


def _no_release(_: Expectation, events: Events, truth: Truth, verdict: Verdict) -> None:
    if not math.isnan(events.out):
        verdict.wrong.append(f"false: released at {truth.when(events.out).height:.1f} m")
    elif events.releases:
        who = events.releases[0][1]
        verdict.wrong.append(f"false: component {who} ordered a release")


def _kill(expected: Expectation, events: Events, truth: Truth, verdict: Verdict) -> None:
    _no_release(expected, events, truth, verdict)
    off = events.disarmed_after(expected.since)
    if math.isnan(off):
        verdict.wrong.append("missed: the motors were not stopped")
    else:
        verdict.times[f"{expected.cause} to motors off (by heartbeat)"] = off - expected.since


def _release(expected: Expectation, events: Events, truth: Truth, verdict: Verdict) -> None:
    took = events.out - expected.since
    if math.isnan(took):
        crash = truth.crashed(expected.since)
        ended = f"hit the ground with {-crash.climb:.0f} m/s" if crash else "still in the air"
        fell = truth.when(expected.since).height
        verdict.wrong.append(f"missed: not released; {expected.cause} at {fell:.0f} m, {ended}")
    elif took > expected.within:
        verdict.wrong.append(f"late: released after {took:.2f} s, need {expected.within:g} s")
    if any(armed for at, armed in events.armed if at > events.out + _TOLD_WITHIN):
        verdict.wrong.append("false: released over motors that were not stopped")


def _by_truth(expected: Expectation, events: Events, truth: Truth, verdict: Verdict) -> None:
    end = events.kills[0][0] if events.kills else math.inf
    lost = truth.lost(expected.since, end)
    crash = truth.crashed(expected.since)
    if math.isnan(events.out):
        if crash is not None:
            fast = -min(one.climb for one in truth.between(crash.at - 1.0, crash.at))
            verdict.wrong.append(f"missed: not released; hit the ground with {fast:.0f} m/s")
        elif not events.kills:
            verdict.happened.append("it flew on")
    elif not lost:
        there = truth.when(end)
        verdict.wrong.append(
            f"false: it was not lost: {there.height:.0f} m, {there.climb:+.1f} m/s, "
            f"{there.tilt:.0f} deg"
        )


_JUDGES = {
    Want.NOTHING: _nothing,
    Want.RELEASE: _release,
    Want.KILL: _kill,
    Want.NO_RELEASE: _no_release,
    Want.BY_TRUTH: _by_truth,
}


def held_up(record: Sequence[Seen]) -> float:
    """The longest pause of what comes evenly, over its interval, s: the simulator's truth, 25
    times a second, and the node's heartbeat, each second."""
    worst = 0.0
    truth = [one.at for one in record if one.name in ("SIM_STATE", "HIL_STATE_QUATERNION")]
    beats = [one.at for one in record if one.name == "HEARTBEAT" and one.component == _NODE]
    for times, interval in ((truth, 0.04), (beats, 1.0)):
        gaps = [after - before for before, after in pairwise(times)]
        worst = max([worst, *(gap - interval for gap in gaps)])
    return worst
