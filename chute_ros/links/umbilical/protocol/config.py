"""The settings of an umbilical link."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from chute_ros.errors import ParameterError
from chute_ros.links.umbilical.protocol.scheduler import SchedulerLimits
from chute_ros.protocol.effect import EffectLimits
from chute_ros.protocol.liveness import LivenessLimits


class DeployStage(enum.Enum):
    """What a deploy fires."""

    DROGUE = "drogue"
    MAIN = "main"
    NEXT = "next"


class HeartbeatInFlight(enum.Enum):
    """Whether <H> is sent from Ascent until the landing."""

    #: As the layout says.
    AUTO = "auto"
    YES = "true"
    NO = "false"


@dataclass(frozen=True)
class MemoryLimits:
    """Seconds: to the first sign of a dump or wipe; of silence in a dump, and in a wipe, after
    which it is given up; after the last line of the FRAM, which has no end mark."""

    answer_within: float = 5.0
    dump_silence: float = 3.0
    wipe_silence: float = 60.0
    fram_quiet: float = 1.0

    def __post_init__(self) -> None:
        for name in ("answer_within", "dump_silence", "wipe_silence", "fram_quiet"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ParameterError(f"{name} is {value}: need a time above 0 s")


@dataclass(frozen=True)
class UmbilicalConfig:
    """layout: name of the only one, empty: recognised. settle_time: what comes within it after the
    opening is of before, s. safe_opens_sv: of the firmware's <V>. decided_deploy_forces: a deploy
    that the supervisor decided is sent in every flight mode."""

    layout: str = ""
    telemetry: LivenessLimits = LivenessLimits(3.0, 15.0)
    scheduler: SchedulerLimits = SchedulerLimits()
    #: Nothing is acknowledged: that a command was lost is known only by its missing effect, which
    #: telemetry (10 lines a second) shows soon after the receiver's 0.1 s. A rocket falls 90 m in
    #: 1.5 s.
    effect: EffectLimits = EffectLimits(0.5, 0.25, 5.0)
    memory: MemoryLimits = MemoryLimits()
    settle_time: float = 0.2
    deploy: DeployStage = DeployStage.DROGUE
    safe_opens_sv: bool = False
    heartbeat_in_flight: HeartbeatInFlight = HeartbeatInFlight.AUTO
    decided_deploy_forces: bool = True
