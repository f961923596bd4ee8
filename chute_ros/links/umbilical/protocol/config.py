"""The settings of an umbilical link."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from chute_ros.links.umbilical.protocol.scheduler import SchedulerLimits
from chute_ros.protocol.goal import Commanded, EffectLimits
from chute_ros.protocol.liveness import LivenessLimits
from chute_ros.settings import Settings, nested, parameter


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
class MemoryLimits(Settings):
    """How long a dump or a wipe may be silent."""

    answer_within: float = parameter(
        5.0,
        "wait for the first sign of a dump or wipe after its request",
        0.1,
        60.0,
        "s",
        name="memory_answer_within",
    )
    dump_silence: float = parameter(
        3.0, "a flash dump is given up after this silence", 0.1, 600.0, "s"
    )
    wipe_silence: float = parameter(
        60.0, "a wipe is given up after this silence", 0.1, 3600.0, "s"
    )
    fram_quiet: float = parameter(
        1.0, "a FRAM dump, which has no end mark, ends after this silence", 0.1, 60.0, "s"
    )


@dataclass(frozen=True)
class UmbilicalConfig(Commanded, Settings):
    """Settings of an UmbilicalLink."""

    layout: str = parameter(
        "", "name of the $TELEM layout; empty: recognised from the received lines"
    )
    telemetry: LivenessLimits = nested(
        LivenessLimits(3.0, 15.0), "telemetry", stale_after={"maximum": 30.0}
    )
    settle_time: float = parameter(
        0.2,
        "data received within this time after the port was opened is discarded as stale",
        0.0,
        10.0,
        "s",
    )
    scheduler: SchedulerLimits = nested(SchedulerLimits())
    heartbeat_in_flight: HeartbeatInFlight = parameter(
        HeartbeatInFlight.AUTO,
        "send <H> from Ascent until the landing: some firmware takes a connected umbilical in "
        "flight for a fault; auto: as the layout says, which is false for the shipped layouts",
    )
    #: Nothing is acknowledged: that a command was lost is known only by its missing effect, which
    #: telemetry (10 lines a second) shows soon after the receiver's 0.1 s. A rocket falls 90 m in
    #: 1.5 s.
    effect: EffectLimits = nested(
        EffectLimits(0.5, 0.25, 5.0),
        effect_timeout={
            "meaning": "wait for the effect of a command after it was written; a command that may "
            "be repeated is then sent again"
        },
        retry_interval={"meaning": "interval before retrying when the command queue is full"},
        give_up_after={"maximum": 10.0},
    )
    deploy: DeployStage = parameter(
        DeployStage.DROGUE,
        "what ~/deploy and a decided deploy fire; next: the drogue, or the main if the drogue has "
        "been out, or was fired from here, for 3 s",
        name="deploy_stage",
    )
    decided_deploy_forces: bool = parameter(
        True, "send a deploy that the supervisor decided in every flight mode"
    )
    safe_opens_sv: bool = parameter(
        False, "the firmware's <V> opens the SV to vent; by the reference <V> closes it"
    )
    memory: MemoryLimits = nested(MemoryLimits())
