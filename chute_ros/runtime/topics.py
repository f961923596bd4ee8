"""Messages from one runtime to another over ROS. The carrier puts the stamp on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from chute_ros.model import Action, Decision, LinkState
from chute_ros.protocol.events import SafetyAsk
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.inputs import ActionReport, ParachuteReport, VehicleReport
from chute_ros.supervisor.lease import Claim
from chute_ros.supervisor.preflight import block_reasons
from chute_ros.supervisor.state import State
from chute_ros.supervisor.state_text import alarms


@dataclass(frozen=True)
class DeviceBeat:
    """A device node's heartbeat (safety/heartbeat); fields as of chute_msgs/LinkHeartbeat."""

    link: str
    link_state: LinkState
    device_healthy: bool
    seq: int
    #: Since the device was heard, s.
    age: float
    reasons: tuple[str, ...]
    #: For how long what came may have waited, s.
    behind: float


@dataclass(frozen=True)
class ParachuteTold:
    """A device node's picture of a parachute (parachute/status). received: when the newest data of
    the device was, monotonic s; NaN: never."""

    report: ParachuteReport
    received: float


@dataclass(frozen=True)
class VehicleTold:
    """A device node's picture of the vehicle (vehicle/state). at: when its ages were counted,
    monotonic s."""

    report: VehicleReport
    at: float


@dataclass(frozen=True)
class PastDecision:
    """A kill or a deploy that was decided, for whoever comes late (safety/history). Nobody acts on
    it."""

    decision: Decision
    #: Monotonic s.
    decided_at: float


@dataclass(frozen=True)
class SupervisorBeat:
    """A supervisor's heartbeat (safety/heartbeat)."""

    name: str
    leading: bool


@dataclass(frozen=True)
class SafetyTold:
    """A supervisor's picture, as it is published on safety/state."""

    supervisor: str
    state: State
    #: The stamp of the newest heartbeat of each link, ns.
    stamps: Mapping[str, int]
    #: Monotonic s.
    now: float
    #: Against a take-off; what warns as long as it holds.
    reasons: tuple[str, ...]
    alarms: tuple[str, ...]
    #: Id of the newest PastDecision that was published; 0: none was.
    fired: int = 0


def safety_told(
    config: SupervisorConfig,
    supervisor: str,
    state: State,
    stamps: Mapping[str, int],
    now: float,
    fired: int = 0,
) -> SafetyTold:
    """The picture of this state, s monotonic."""
    reasons, warns = block_reasons(config, state, now), alarms(config, state, now)
    return SafetyTold(supervisor, state, stamps, now, reasons, warns, fired)


@dataclass(frozen=True)
class LeaseClaim:
    """Claim of a supervisor for the others (safety/lease)."""

    claim: Claim
    #: Tells it from another of its name; empty: it is not from a supervisor.
    instance: str
    #: For how long it runs, s.
    running: float
    #: Whom it follows; empty: nobody yet, or it leads.
    leader: str
    #: The leader's, for those that follow it; empty: none follows.
    state: str


@dataclass(frozen=True)
class SafetyPicture:
    """Of safety/state what device nodes look at."""

    blocked: bool
    device_blocks: tuple[str, ...]
    #: Whose it is, and the stamp of the newest heartbeat of each link, ns.
    supervisor: str
    stamps: Mapping[str, int]
    alarms: tuple[str, ...] = ()
    #: Why flight is blocked, as far as it is.
    block_reasons: tuple[str, ...] = ()
    #: A parachute is out, by whomever.
    released: bool = False


@dataclass(frozen=True)
class ActionTold:
    """Progress of a device node with a decision of this action (safety/action)."""

    action: Action
    report: ActionReport


@dataclass(frozen=True)
class DeviceRequest:
    """Request of a device to the supervisor (safety/request)."""

    link: str
    device: str
    ask: SafetyAsk
    reason: str
