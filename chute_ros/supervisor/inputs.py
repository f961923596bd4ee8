"""What goes into the supervisor's core and what comes out; it can be recorded and replayed."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from chute_ros.model import NAN, Decision, LinkState, Outcome, ParachuteStatus, VehicleState


class Mode(enum.IntEnum):
    """Mode of the supervisor; numbers of chute_msgs/SafetyState."""

    ACTIVE = 0
    SHADOW = 1
    INHIBITED = 2


@dataclass(frozen=True)
class LinkHeartbeat:
    """A device node is alive and says this of its device."""

    link: str
    link_state: LinkState
    device_healthy: bool
    seq: int
    #: The wall clock here less the stamp of the heartbeat, s; NaN: not known.
    clock_difference: float = NAN
    #: Why device_healthy is not so, in words.
    reasons: tuple[str, ...] = ()
    #: What it says of its device may be older by so much, s: its computer's processor is short.
    behind: float = 0.0


@dataclass(frozen=True)
class ParachuteReport:
    """A ParachuteStatus came."""

    link: str
    status: ParachuteStatus


@dataclass(frozen=True)
class VehicleReport:
    """A VehicleState came. disputed: its parts (vertical_speed, attitude, acceleration) that
    another source has lately told otherwise. told_by: those parts and height, where another source
    than the first of vehicle_sources tells them, and which."""

    state: VehicleState
    disputed: frozenset[str] = frozenset()
    told_by: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True)
class ActionReport:
    """A device node got this far with a decision."""

    epoch: int
    id: int
    link: str
    outcome: Outcome
    detail: str
    #: The newest decision that this node has seen, whoever made it; id 0: it does not say.
    newest_epoch: int = 0
    newest_id: int = 0


@dataclass(frozen=True)
class ArmRequest:
    """A person wants the parachutes armed or disarmed."""

    token: int
    arm: bool
    triggers: int
    #: Today by the wall clock, days since 1970-01-01; -1: not known.
    day: int = -1


@dataclass(frozen=True)
class ArmDone:
    """What came of ArmDevices."""

    token: int
    arm: bool
    success: bool
    message: str


@dataclass(frozen=True)
class KillRequest:
    """A person (token not 0) or a device (token 0) wants the motors off."""

    token: int
    by: str
    reason: str
    #: A person wants no deploy to follow.
    kill_only: bool = False


@dataclass(frozen=True)
class BlockRequest:
    """A device wants flight blocked for reason, or (block false) does not want it any more."""

    link: str
    device: str
    block: bool
    reason: str


@dataclass(frozen=True)
class DeployRequest:
    """A person wants the parachute out."""

    token: int
    force: bool
    reason: str


@dataclass(frozen=True)
class ResetRequest:
    """A person wants to begin again, after landing or a test."""

    token: int


@dataclass(frozen=True)
class ModeRequest:
    """A person wants another mode."""

    token: int
    mode: Mode
    force: bool
    reason: str = ""


@dataclass(frozen=True)
class TakeOver:
    """Lead from now on, under this epoch."""

    epoch: int


@dataclass(frozen=True)
class StepDown:
    """Only look on from now on; another decides."""

    why: str


Input = (
    LinkHeartbeat
    | ParachuteReport
    | VehicleReport
    | ActionReport
    | ArmRequest
    | ArmDone
    | KillRequest
    | BlockRequest
    | DeployRequest
    | ResetRequest
    | ModeRequest
    | TakeOver
    | StepDown
)


@dataclass(frozen=True)
class Decide:
    """Publish this decision: a new one, or one again that nobody has reported on."""

    decision: Decision
    again: bool = False


@dataclass(frozen=True)
class ArmDevices:
    """Call the arm service of these links and come back with ArmDone."""

    token: int
    arm: bool
    triggers: int
    links: tuple[str, ...]


#: What one that does not decide tells a person: only the one that does offers the services.
CALL_AGAIN = "another supervisor decides, call again"


@dataclass(frozen=True)
class Finish:
    """Answer the request with this token."""

    token: int
    success: bool
    accepted: bool
    message: str


@dataclass(frozen=True)
class LogMessage:
    """One line for the log."""

    text: str
    alarm: bool = False


@dataclass(frozen=True)
class Refused:
    """A device has seen a newer epoch, of another supervisor: somebody else leads."""

    newest_epoch: int


Output = Decide | ArmDevices | Finish | LogMessage | Refused
