"""What the stories are made of: get ready, go up, and say what must come of it."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from chute_ros.model import FIRES, Action
from chute_ros.protocol.mavlink.dialect import dialect
from chute_ros.supervisor.machine import Stage
from sitl.autopilots import ARDUPLANE, PX4
from sitl.judge import NUMBERS, Expectation, Verdict, Want, events_of, held_up, judge
from sitl.record import Seen, read
from sitl.truth import GROUND, truth_of
from sitl.vehicle import StoryError, Vehicle

_READY_WITHIN = 90.0
#: Processes that start take the machine for themselves, s.
_SETTLES = 12.0
#: From one heartbeat of the nodes to the next, s.
_BEAT = 0.1
_CLIMB_RATE = 1.5  # m/s, no slower
_STILL = 0.3  # m/s, a hover


class Flight:
    """One run of a story on a vehicle that stands there."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        vehicle.watch.longest_gap = 0.0
        self.kind = vehicle.autopilot.kind
        self.began = time.monotonic()
        #: Looks at the record, once it is whole; what is wrong goes into the verdict.
        self.afterwards: list[Callable[[Sequence[Seen]], None]] = []
        self.expected = Expectation()
        self.verdict = Verdict()
        self.pilot, self.station = self.vehicle.pilot, self.vehicle.station

    # -- on the ground --------------------------------------------------------------------------

    def get_ready(self) -> None:
        """The supervisor says READY, and the parachute is armed, or will be."""
        vehicle = self.vehicle
        vehicle.must("READY", _READY_WITHIN, lambda: vehicle.stage(Stage.READY))
        if not vehicle.setup.dronecan:  # such a one arms itself
            vehicle.arm_parachute()

    def wait_for_position(self) -> None:
        """Until it could be armed, as far as the autopilot is concerned."""
        bit = dialect.MAV_SYS_STATUS_PREARM_CHECK
        station = self.station

        def could() -> bool:
            if self.kind == PX4:
                health = station.get("SYS_STATUS", "onboard_control_sensors_health", 0)
                return bool(int(health) & bit)
            return any("is using GPS" in text for _, text in station.said)

        self.vehicle.must("the autopilot would arm", 90.0, could)
        self.vehicle.rest(3.0)

    def expect_block(self, seconds: float, word: str, otherwise: str) -> None:
        """So long after its start it is BLOCKED, for a reason with this word in it."""
        self.vehicle.rest(seconds)
        why = [one for one in self.vehicle.watch.safety.block_reasons if word in one]
        if not self.vehicle.stage(Stage.BLOCKED) or not why:
            self.verdict.wrong.append(f"missed: not BLOCKED, {otherwise}")
        self.verdict.happened += [f"BLOCKED: {one[:120]}" for one in why[:1]]

    def change_mode(self, name: str, seconds: float = 20.0) -> None:
        """The autopilot is in this mode."""
        self.vehicle.again(
            f"mode {name}",
            seconds,
            lambda: self.pilot.mode(name),
            lambda: self.pilot.in_mode(name),
        )

    def arm(self) -> None:
        """The motors are armed, as soon as the autopilot can."""
        self.vehicle.again("armed", 60.0, self.pilot.arm, self.station.armed)

    def upload_mission(self, height: float) -> None:
        """The autopilot has the pilot's mission."""
        self.vehicle.again(
            "the mission is uploaded",
            15.0,
            lambda: self.pilot.upload(height),
            lambda: self.station.mission_ack == 0,
            4.0,
        )

    def released(self) -> bool:
        """The parachute is out."""
        return any(one.deployed for one in self.vehicle.watch.parachutes.values())

    # -- up and down ----------------------------------------------------------------------------

    def go_up(self, height: float) -> None:
        """Ready, armed, in the air at this height, and the supervisor knows it."""
        self.get_ready()
        if self.kind == PX4:
            self.vehicle.set("MIS_TAKEOFF_ALT", height)
        else:
            # On a busy machine it may be armed before its estimator has a position.
            self.wait_for_position()
        self.change_mode(self.pilot.ready_to_climb())
        self.arm()
        self.climb(height)
        self.vehicle.must("IN_FLIGHT", 10.0, lambda: self.vehicle.stage(Stage.IN_FLIGHT))
        # What still climbs must fall longer until its fall shows.
        self.vehicle.until(10.0, lambda: abs(self.vehicle.truth.now.climb) < _STILL)
        self.vehicle.rest(1.0)

    def climb(self, height: float) -> None:
        """An armed one goes up."""
        vehicle = self.vehicle
        if self.kind != PX4:
            vehicle.again(
                "it takes off",
                20.0,
                lambda: self._take_off(height),
                lambda: vehicle.height() > 1.0,
                3.0,
            )
        near = min(0.9 * height, height - 1.0)
        seconds = 20.0 + height / _CLIMB_RATE
        vehicle.must(f"it climbs to {height:g} m", seconds, lambda: vehicle.height() > near)

    def _take_off(self, height: float) -> None:
        """Of ArduPilot, which leaves a mode that it could not fly in when it was asked for."""
        mode = self.pilot.ready_to_climb()
        if not self.pilot.in_mode(mode):
            self.pilot.mode(mode)
        self.pilot.take_off(height)

    def come_down(self) -> None:
        """Land, disarmed by itself, and the supervisor says so."""
        vehicle = self.vehicle
        mode = {ARDUPLANE: "QLAND"}.get(self.kind, "LAND")
        self.change_mode(mode)
        vehicle.must("it lands", 120.0, lambda: vehicle.height() < GROUND)
        vehicle.must("it disarms", 30.0, lambda: not self.station.armed())
        vehicle.rest(3.0)

    # -- what must come of it -------------------------------------------------------------------

    def expect(self, want: Want, since: float = math.nan, within: float = math.nan,
               cause: str = "failure") -> None:  # fmt: skip
        """From since on."""
        self.expected = Expectation(want, since, within, cause)
        self.vehicle.watch.longest_gap = 0.0

    def fail_motors(self, mask: int, thrust: float = 0.0) -> float:
        """They have this share of their thrust from now on; when. In PX4 a share is of all of
        them, and its SIH looks at its parameters once a second."""
        if self.kind == PX4 and thrust:
            assert mask == 0b1111
            return self.vehicle.set("SIH_T_MAX", thrust * self.vehicle.get("SIH_T_MAX"))
        if self.kind == PX4:
            number = 420
            sent = self.pilot.fail_motors(mask)
            self.vehicle.must("the failure is injected", 3.0,
                              lambda: self.vehicle.bench.accepted(number))  # fmt: skip
            return sent
        self.vehicle.set("SIM_ENGINE_MUL", thrust)
        return self.vehicle.set("SIM_ENGINE_FAIL", mask << (4 if self.kind == ARDUPLANE else 0))

    def see_it_out(self, seconds: float, after: float = 2.0) -> None:
        """Until it is on the ground, or for so long; and a little more."""
        since = time.monotonic()
        vehicle = self.vehicle
        vehicle.until(seconds, lambda: vehicle.height() < GROUND and time.monotonic() > since + 1)
        vehicle.rest(after)

    # -- the end --------------------------------------------------------------------------------

    def end(self, notes: Path) -> Verdict:
        """What came of it. notes: where the words of all go."""
        vehicle = self.vehicle
        findings = vehicle.keeper.findings
        self.verdict.wrong += [f"error: {one}" for one in findings]
        findings.clear()
        record = list(read(vehicle.record, self.began, NUMBERS))
        ports = vehicle.truth_ports()
        events = events_of(record, ports)
        judge(self.expected, events, truth_of(record, ports), self.verdict)
        self.verdict.load = os.getloadavg()[0]
        since = self.began + _SETTLES
        if not self.verdict.wrong and not math.isnan(self.expected.since):
            since = self.expected.since - 2.0
        self.verdict.held_up = max(
            held_up([one for one in record if one.at >= since]), vehicle.watch.longest_gap - _BEAT
        )
        for look in self.afterwards:
            look(record)
        self.verdict.happened += self._decided()
        said = [(at, f"{who}: {text}") for at, who, text in events.said]
        lines = sorted([*said, *(one for one in vehicle.stages if one[0] >= self.began)])
        last = [f"expected: {self.expected}", f"verdict: {self.verdict}"]
        last += vehicle.watch.safety.alarms
        lines += [(at, f"decision {Action(one.action).name} {one.rule}: {'; '.join(one.reasons)}")
                  for at, one in vehicle.watch.decisions.values() if at >= self.began]  # fmt: skip
        lines.sort()
        notes.write_text("\n".join([*(f"{at:.3f} {text}" for at, text in lines), *last]))
        return self.verdict

    def _decided(self) -> list[str]:
        """The rules that killed and deployed."""
        every = self.vehicle.watch.decisions.values()
        rules = {one.rule: None for at, one in every
                 if at >= self.began and one.action in FIRES}  # fmt: skip
        return [f"by {', '.join(rules)}"] if rules else []


__all__ = ["Flight", "StoryError"]
