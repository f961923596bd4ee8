"""What the node mavlink_parachute does between its protocol and ROS, with the same gate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count

from chute_ros.campaign.bus import Bus, Plug
from chute_ros.model import Action, Decision, LinkState, Outcome
from chute_ros.protocol.events import ParachuteChanged, RequestReport, VehicleChanged
from chute_ros.protocol.mavlink.link import MavlinkLink
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.decision_gate import DecisionGate, Verdict

NAME = "mavlink_parachute"
HEARTBEAT_INTERVAL = 0.1  # s
MAX_DECISION_AGE = 0.5  # s
#: Our own MAVLink heartbeat stops when the node has not beaten for so long, s.
_OWNER_SILENCE = 1.0


@dataclass(frozen=True)
class Acted:
    """A decision that the gate let through."""

    at: float
    decision: Decision


def _is_release(data: bytes) -> bool:
    """A MAVLink 2 frame with COMMAND_LONG (76) of MAV_CMD_DO_PARACHUTE (208)."""
    payload = data[10:]
    return data[7:10] == b"\x4c\0\0" and int.from_bytes(payload[28:30], "little") == 208


class DeviceNode(Plug):
    """tell: gives the supervisor an input, over ROS."""

    def __init__(self, bus: Bus, link: MavlinkLink, tell: Callable[[i.Input], None]) -> None:
        super().__init__(bus, link)
        self.mavlink, self._tell = link, tell
        self._gate = DecisionGate(NAME, MAX_DECISION_AGE)
        self._seq = count()
        self._tokens = count(1)
        self._decisions: dict[int, Decision] = {}
        self._reports: dict[tuple[int, int], i.ActionReport] = {}
        self._beat_at = 0.0
        self.acted: list[Acted] = []
        #: It has heard that the parachute is out; how often it ordered that all the same.
        self._knows_release = False
        self.ordered_again = 0

    def update(self, now: float) -> None:
        """The protocol's time, and the heartbeat."""
        super().update(now)
        if now >= max(self._beat_at, self.dead_until):
            self._beat_at = now + HEARTBEAT_INTERVAL
            self._beat(now)

    def next_deadline(self) -> float:
        """Of both."""
        return max(min(self.link.next_deadline(), self._beat_at), self.dead_until)

    def flush(self) -> None:
        """Send frames, and publish what happened."""
        for data in self.link.take_output():
            self.ordered_again += self._knows_release and _is_release(data)
            self.outward.send(data, self.arrived_at_the_bus)
        for event in self.mavlink.take_events():
            if isinstance(event, ParachuteChanged):
                self._knows_release |= event.status.deployed
                self._tell(i.ParachuteReport(NAME, event.status))
            elif isinstance(event, VehicleChanged):
                self._tell(i.VehicleReport(event.state))
            elif isinstance(event, RequestReport):
                report = event.report
                self._report(self._decisions[report.token], report.outcome, report.detail)

    def decide(self, decision: Decision, age: float, now: float) -> None:
        """A decision came that was made age s ago."""
        if now < self.dead_until:
            return
        verdict = self._gate.judge(decision, age)
        if verdict is Verdict.ACT:
            self.acted.append(Acted(now, decision))
            self._carry_out(decision, now)
            self.flush()
        elif verdict is Verdict.REPEATED:
            report = self._reports.get((decision.epoch, decision.id))
            if report is not None:
                self._tell(report)
        elif verdict is Verdict.OLDER:
            self._report(decision, Outcome.FAILED, verdict.value)

    def _carry_out(self, decision: Decision, now: float) -> None:
        token = next(self._tokens)
        if decision.action is Action.KILL:
            self._decisions[token] = decision
            self.mavlink.kill(token, now)
        elif decision.action is Action.DEPLOY:
            self._decisions[token] = decision
            self.mavlink.deploy(token, False, now, decision.device)
        else:
            blocks = decision.action is Action.FLIGHT_BLOCK
            self.mavlink.flight_block("; ".join(decision.reasons) if blocks else "", now)
            self._report(decision, Outcome.CONFIRMED, "told")

    def _report(self, decision: Decision, outcome: Outcome, detail: str) -> None:
        gate = self._gate
        report = i.ActionReport(
            decision.epoch, decision.id, NAME, outcome, detail, gate.newest_epoch, gate.newest_id
        )
        self._reports[decision.epoch, decision.id] = report
        self._tell(report)

    def _beat(self, now: float) -> None:
        self.mavlink.owner_alive(now + _OWNER_SILENCE)
        chosen = self.mavlink.chosen_parachute()
        state, healthy = LinkState.NEVER_SEEN, False
        if chosen is not None:
            state, healthy = chosen.liveness.state, chosen.status(now).healthy
        self._tell(i.LinkHeartbeat(NAME, state, healthy, next(self._seq)))
        self.flush()
