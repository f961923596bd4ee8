"""Tells timed stories to the supervisor's core: at t+..., this comes; then, this is decided."""

from __future__ import annotations

from dataclasses import dataclass, field

from chute_ros.model import (
    Action,
    Armed,
    Decision,
    LandedState,
    LinkState,
    Outcome,
    ParachuteState,
    ParachuteStatus,
    VehicleState,
)
from chute_ros.supervisor import inputs as i
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.core import next_deadline, update
from chute_ros.supervisor.machine import Stage
from chute_ros.supervisor.state import State

LINK = "mavlink_parachute"
START = 1000.0
FLYING = VehicleState(
    armed=Armed.ARMED, armed_age=0.0, landed_state=LandedState.IN_AIR, landed_state_age=0.0
)
STANDING = VehicleState(
    armed=Armed.DISARMED, armed_age=0.0, landed_state=LandedState.ON_GROUND, landed_state_age=0.0
)
#: On the ground, the motors still turn.
IDLING = VehicleState(
    armed=Armed.ARMED, armed_age=0.0, landed_state=LandedState.ON_GROUND, landed_state_age=0.0
)


def parachute(
    link: str = LINK,
    device: str = "1/161",
    deployed: bool = False,
    faults: tuple[str, ...] = (),
    alive: bool = True,
) -> i.ParachuteReport:
    """A parachute tells its picture; one that is not alive is told of by its node."""
    state = ParachuteState.LAUNCHED if deployed else ParachuteState.READY
    link_state = LinkState.OK if alive else LinkState.LOST
    status = ParachuteStatus(device, link_state, state, deployed=deployed, faults=faults)
    return i.ParachuteReport(link, status)


@dataclass
class Story:
    """One supervisor from its start; t is seconds since then."""

    config: SupervisorConfig = field(default_factory=SupervisorConfig)
    mode: i.Mode = i.Mode.ACTIVE

    def __post_init__(self) -> None:
        self.t = 0.0
        self.seq = 0
        self.state = State(epoch=7, started_at=START, mode=self.mode)
        self.outputs: list[tuple[float, i.Output]] = []

    def at(self, t: float, *inputs: i.Input) -> list[i.Output]:
        """Go to t, waking at every deadline on the way as the node does, then take in inputs."""
        assert t >= self.t
        while True:
            wake = next_deadline(self.config, self.state, START + self.t) - START
            if wake >= t:
                break
            self._update((), wake)
        return self._update(inputs, t)

    def _update(self, inputs: tuple[i.Input, ...], t: float) -> list[i.Output]:
        self.t = t
        self.state, outputs = update(self.config, self.state, inputs, START + t)
        self.outputs += [(t, output) for output in outputs]
        return list(outputs)

    # -- what comes ------------------------------------------------------------------------------

    def heartbeat(
        self, link: str = LINK, healthy: bool = True, state: LinkState = LinkState.OK
    ) -> i.LinkHeartbeat:
        """A heartbeat of a device node."""
        self.seq += 1
        return i.LinkHeartbeat(link, state, healthy, self.seq)

    def alive(self, until: float, *links: str) -> None:
        """Healthy heartbeats ten times a second from now to until."""
        while self.t + 0.1 <= until + 1e-9:
            self.at(self.t + 0.1, *[self.heartbeat(link) for link in links or (LINK,)])

    def ready(self) -> Story:
        """Links healthy, standing on the ground."""
        self.at(self.t, self.heartbeat(), i.VehicleReport(STANDING))
        assert self.state.stage is Stage.READY
        return self

    def flying(self) -> Story:
        """In the air with healthy links."""
        self.ready()
        self.at(self.t, i.VehicleReport(FLYING))
        assert self.state.stage is Stage.IN_FLIGHT
        return self

    def report(
        self, action: Action, outcome: Outcome, link: str = LINK, detail: str = "told"
    ) -> i.ActionReport:
        """A device node reports on the newest decision of this action."""
        decision = self.newest(action)
        return i.ActionReport(
            decision.epoch, decision.id, link, outcome, detail, newest_epoch=decision.epoch
        )

    # -- what was decided ------------------------------------------------------------------------

    def decisions(self, action: Action | None = None) -> list[Decision]:
        """Decisions in their order, each once."""
        return [
            output.decision
            for _, output in self.outputs
            if isinstance(output, i.Decide)
            and not output.again
            and action in (None, output.decision.action)
        ]

    def newest(self, action: Action) -> Decision:
        """The newest decision of this action."""
        return self.decisions(action)[-1]

    def when(self, action: Action) -> float:
        """When this action was first decided, t."""
        return next(
            t
            for t, output in self.outputs
            if isinstance(output, i.Decide) and output.decision.action is action
        )

    def answers(self, token: int) -> list[i.Finish]:
        """The answers to a request."""
        return [o for _, o in self.outputs if isinstance(o, i.Finish) and o.token == token]

    def answer(self, token: int) -> i.Finish:
        """The one answer to a request."""
        (answer,) = self.answers(token)
        return answer

    def alarms(self) -> list[str]:
        """What was said as an alarm."""
        return [o.text for _, o in self.outputs if isinstance(o, i.Say) and o.alarm]
