"""A flight decided by the real core and recorded by the real black box, as fast as it goes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from chute_msgs.msg import PersonRequest, SafetyState

from chute_ros.model import Action, Armed, LandedState, LinkState, Outcome, VehicleState
from chute_ros.ros.black_box import BlackBox
from chute_ros.ros.box_folder import BoxFolder
from chute_ros.ros.messages import stamp_of
from chute_ros.ros.recorded_topics import recorded_topics
from chute_ros.ros.supervisor_parameters import PARAMETERS, config_from
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import update
from chute_ros.supervisor.state import State

LINK = "mavlink_parachute"
NAMESPACE = "/drone1"
#: Monotonic s and Unix ns at the start.
START, WALL = 1000.0, 1_780_000_000 * 10**9
#: What the core is told ten times a second.
STEP = 0.1
FALLS_AT, DEPLOY_AT, END = 6.0, 7.0, 12.0


def plain_config() -> SupervisorConfig:
    """As the node has it without any settings, but nothing fires by itself."""
    values = {one.name: one.default for one in PARAMETERS}
    return config_from({**values, "profile": "by_hand"})


class Namespace:
    """What the black box asks of a node."""

    def __init__(self, namespace: str) -> None:
        self._namespace = namespace

    def resolve_topic_name(self, name: str) -> str:
        return name if name.startswith("/") else f"{self._namespace}/{name}"


class Flight:
    """On the ground from 0 s, in the air from 2 s; it falls from 6 s, a person deploys at 7 s."""

    def __init__(self, folder: Path, config: SupervisorConfig | None = None, **box: Any) -> None:
        self.folder = folder
        self.t = 0.0
        self.config = config or plain_config()
        #: Unix ns at its start.
        self.wall = box.pop("wall", WALL)
        self.state = State(epoch=box.pop("epoch", 7), started_at=START)
        self.reason = "it falls"
        namespace, node = box.pop("namespace", NAMESPACE), box.pop("node", "safety_supervisor")
        limit, most = box.pop("limit", 64_000_000), box.pop("most_files", 32)
        self.box = BlackBox(
            BoxFolder(str(folder), f"{namespace}/{node}", most),
            recorded_topics(Namespace(namespace)),
            limit,
            wall=lambda: self.wall + round(self.t * 1e9),
        )
        self.outputs: list[i.Output] = []
        self._seq = 0
        self._due: list[tuple[float, i.ActionReport]] = []

    def turn(self, *inputs: i.Input) -> None:
        """One update of the core, recorded."""
        before = self.state
        self.state, outputs = update(self.config, before, inputs, START + self.t)
        self.box.turn(START + self.t, inputs, outputs, before, self.state, self.config)
        self.outputs += outputs
        for output in outputs:
            if isinstance(output, i.Decide) and not output.again:
                self._answer(output)

    def fly(self, until: float = END) -> Flight:
        """Go on to this moment, s from the start."""
        while self.t < until - 1e-9:
            inputs: list[i.Input] = [self._heartbeat(), i.VehicleReport(self._vehicle())]
            inputs += [report for due, report in self._due if due <= self.t]
            self._due = [one for one in self._due if one[0] > self.t]
            if abs(self.t - DEPLOY_AT) < STEP / 2:
                inputs.append(i.DeployRequest(1, False, self.reason))
            self.turn(*inputs)
            self._publish_state()
            self.t = round(self.t + STEP, 6)
        return self

    def call(self, service: str, request: str, at: float, **answer: Any) -> None:
        """A call of a service of LINK at this moment (s from the start), or its answer."""
        message = PersonRequest(link=LINK, service=service, request=request, after=math.nan)
        message.header.stamp = stamp_of(self.wall + round(at * 1e9))
        for name, value in answer.items():
            setattr(message, name, value)
        message.answered = bool(answer)
        self.box.message("safety/person", message)

    def land(self) -> Path:
        """End the recording; the newest file."""
        self.box.close()
        return self.files()[-1]

    def files(self) -> list[Path]:
        return sorted(self.folder.glob("*.mcap"))

    def decided(self) -> list[Action]:
        """What was decided, each once, in this order."""
        decides = (one for one in self.outputs if isinstance(one, i.Decide) and not one.again)
        return [one.decision.action for one in decides]

    def _heartbeat(self) -> i.LinkHeartbeat:
        self._seq += 1
        return i.LinkHeartbeat(LINK, LinkState.OK, True, self._seq)

    def _vehicle(self) -> VehicleState:
        flying = 2.0 <= self.t < 10.0
        height = min(40.0, (self.t - 2.0) * 10.0)
        speed = 10.0 if height < 40.0 else 0.0
        if self.t >= FALLS_AT:
            height, speed = max(0.0, 40.0 - (self.t - FALLS_AT) * 12.0), -12.0
        return VehicleState(
            source="1/1",
            link_state=LinkState.OK,
            armed=Armed.ARMED if flying else Armed.DISARMED,
            armed_age=0.0,
            landed_state=LandedState.IN_AIR if flying else LandedState.ON_GROUND,
            landed_state_age=0.0,
            height=height if flying else 0.0,
            height_age=0.0,
            vertical_speed=speed if flying else 0.0,
            vertical_speed_age=0.0,
        )

    def _answer(self, output: i.Decide) -> None:
        """The device carries out what was decided, step by step."""
        decision = output.decision
        for number, outcome in enumerate((Outcome.SENT, Outcome.ACCEPTED, Outcome.CONFIRMED)):
            report = i.ActionReport(
                decision.epoch, decision.id, LINK, outcome, f"step {number}", decision.epoch
            )
            self._due.append((self.t + 0.05 + 0.1 * number, report))

    def _publish_state(self) -> None:
        message = SafetyState(epoch=7, state=int(self.state.stage), links=[LINK])
        message.link_states, message.devices_healthy = [int(LinkState.OK)], [True]
        message.link_ages = [0.0]
        self.box.message("safety/state", message)


def run(main: Any, monkeypatch: Any, *arguments: object) -> Any:
    """Call the main function of a tool as from the command line; its exit code, or what it says
    with code 1."""
    monkeypatch.setattr("sys.argv", ["tool", *map(str, arguments)])
    try:
        main()
    except SystemExit as end:
        return end.code or 0
    return 0
