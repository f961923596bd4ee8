"""What the supervisor can be told to do differently. Times in s."""

from __future__ import annotations

from dataclasses import dataclass, field

from chute_ros.errors import ParameterError
from chute_ros.protocol.liveness import LivenessLimits


@dataclass(frozen=True)
class SupervisorConfig:
    """Settings of the supervisor's core."""

    #: Links whose health flight depends on.
    required_links: tuple[str, ...] = ("mavlink_parachute",)
    #: Links that stop the motors.
    kill_links: tuple[str, ...] = ("mavlink_parachute",)
    #: Links that release a parachute.
    deploy_links: tuple[str, ...] = ("mavlink_parachute",)
    #: Silence of a node's heartbeat (ten a second) after which its link is stale, and lost.
    heartbeat: LivenessLimits = field(default=LivenessLimits(0.5, 1.0))
    #: How long links may take to come up before that counts as a fault.
    startup_grace: float = 10.0
    #: The parachute is released this long after the kill, confirmed or not (as ArduPilot does).
    kill_to_deploy_delay: float = 0.5
    #: How long a deploy may take until its confirmation.
    deploy_timeout: float = 8.0
    #: A kill without confirmation is given up, as seen by its caller, after this.
    kill_timeout: float = 6.0
    #: A parachute that says released is believed at once; its node's report is awaited this long,
    #: only to tell the caller how it went.
    report_wait: float = 0.5
    #: A decision that nobody has reported on is sent again after this.
    resend_interval: float = 0.1
    #: vehicle/state counts only while its parts are younger than this.
    vehicle_state_age: float = 2.5
    #: Without vehicle/state flight is blocked: nobody could tell flight from ground.
    require_vehicle_state: bool = True
    #: Without a landed state, armed and higher than this (m) is in the air.
    takeoff_height: float = 2.0

    def __post_init__(self) -> None:
        for name in ("startup_grace", "kill_to_deploy_delay"):
            if not 0.0 <= getattr(self, name) <= 60.0:
                raise ParameterError(f"{name} is {getattr(self, name)}: need 0 to 60 s")
        for name in ("deploy_timeout", "kill_timeout", "resend_interval", "vehicle_state_age"):
            if not 0.0 < getattr(self, name) <= 60.0:
                raise ParameterError(f"{name} is {getattr(self, name)}: need above 0, up to 60 s")
        for name in ("required_links", "kill_links", "deploy_links"):
            links = getattr(self, name)
            if not links or not all(links):
                raise ParameterError(f"{name} is {list(links)}: need at least one link's name")

    @property
    def links(self) -> tuple[str, ...]:
        """Every link that is followed, each once, the required ones first."""
        return tuple(dict.fromkeys(self.required_links + self.kill_links + self.deploy_links))
