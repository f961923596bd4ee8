"""Who guards a flight: this product, or a peer; each also with its limits scaled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from chute_ros.campaign.peer_rig import MakePeer
from chute_ros.campaign.peers.arducopter import ArduCopter
from chute_ros.campaign.peers.arduplane import ArduPlane
from chute_ros.campaign.peers.px4 import Px4
from chute_ros.campaign.peers.threshold import Threshold
from chute_ros.campaign.shipped import Shipped
from chute_ros.supervisor.config import SupervisorConfig

#: m/s, and m: what is off as delivered is switched on with these. 9 m/s: ArduPilot's own test
#: (Tools/autotest/arducopter.py, ParachuteSinkRate). 10 m: ours, as PX4 names none.
CRITICAL_SINK, ALTITUDE_LOSS = 9.0, 10.0

#: Makes the peer of a vehicle with this profile, with its limits scaled.
PeerOf = Callable[[str, float], MakePeer]


@dataclass(frozen=True)
class Guard:
    """about: with what settings, and what is scaled. peer: None: this product."""

    name: str
    about: str
    peer: PeerOf | None = None


def _ardupilot(critical_sink: float, profile: str, scale: float) -> MakePeer:
    kind = ArduPlane if profile == "fixed_wing" else ArduCopter
    return partial(kind, critical_sink, scale)


def _px4(altitude_loss: float, profile: str, scale: float) -> MakePeer:
    # Its check of the altitude is for rotary wings.
    return partial(Px4, 0.0 if profile == "fixed_wing" else altitude_loss, scale)


def _threshold(profile: str, scale: float) -> MakePeer:
    return partial(Threshold, profile == "fixed_wing", scale)


OURS = Guard("chute_ros", "the profile as shipped; scaled: `for` of every rule")
GUARDS = (
    OURS,
    Guard(
        "ArduPilot",
        "CHUTE_ENABLED 1, all else as delivered; an aeroplane flies ArduPlane, which decides "
        "nothing without CHUTE_CRT_SINK; scaled: the attitude error of 30 degrees and its 1 s",
        partial(_ardupilot, 0.0),
    ),
    Guard(
        f"ArduPilot, sink {CRITICAL_SINK:g}",
        f"the same with CHUTE_CRT_SINK {CRITICAL_SINK:g} m/s, the value of ArduPilot's own test; "
        "scaled: also the sink and its 1 s",
        partial(_ardupilot, CRITICAL_SINK),
    ),
    Guard(
        "PX4",
        "CBRK_FLIGHTTERM 0, all else as delivered; scaled: FD_FAIL_R and FD_FAIL_P of 60 degrees, "
        "and their 0.3 s",
        partial(_px4, 0.0),
    ),
    Guard(
        f"PX4, loss {ALTITUDE_LOSS:g}",
        f"the same with FD_ALT_LOSS {ALTITUDE_LOSS:g} m, which a multirotor alone has (PX4 "
        "recommends no value; this one is ours); scaled: also the loss and its 1 s",
        partial(_px4, ALTITUDE_LOSS),
    ),
    Guard(
        "threshold",
        "tilt beyond 60 degrees (an aeroplane's 80) or a sink of more than 10 m/s for 0.5 s; "
        "scaled: all three",
        _threshold,
    ),
)


class ScaledShipped(Shipped):
    """The shipped settings with the hold time of every rule scaled by a factor."""

    def __init__(self, folder: Path, factor: float) -> None:
        super().__init__(folder)
        self._factor = factor
        self._scaled: dict[tuple[str, str, bool, int], SupervisorConfig] = {}

    def config(self, vehicle: str, profile: str, standby: bool, rank: int) -> SupervisorConfig:
        key = (vehicle, profile, standby, rank)
        if key not in self._scaled:
            shipped = super().config(*key)
            rules = (replace(r, hold=r.hold * self._factor) for r in shipped.profile.rules)
            scaled = replace(shipped.profile, rules=tuple(rules))
            self._scaled[key] = replace(shipped, profile=scaled)
        return self._scaled[key]
