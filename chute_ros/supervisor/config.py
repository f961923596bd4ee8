"""What the supervisor can be told to do differently. Times in s."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

from chute_ros.errors import ParameterError
from chute_ros.supervisor.link_evidence import LinkLimits
from chute_ros.supervisor.rules import DEVICE_RULES, Profile

_NO_LIMITS: MappingProxyType[str, LinkLimits] = MappingProxyType({})


#: As the device of a step: the triggers of a UPF parachute, past its controller.
TRIGGER = "trigger"


@dataclass(frozen=True)
class Rung:
    """One step of the deploy ladder. device: "" for the one that the node chooses, "1/162" for a
    certain one, "trigger" for the triggers of a UPF parachute, past its controller."""

    link: str
    device: str = ""

    @classmethod
    def parse(cls, text: str) -> Rung:
        """ "LINK" or "LINK:DEVICE"."""
        link, _, device = text.partition(":")
        if not link or (":" in text and not device):
            raise ParameterError(
                f"parameter deploy_ladder has {text!r}: need LINK or LINK:DEVICE, for example "
                "mavlink_parachute, mavlink_parachute:1/162, upf_can:trigger"
            )
        return cls(link, device)

    def __str__(self) -> str:
        return f"{self.link}:{self.device}" if self.device else self.link


@dataclass(frozen=True)
class PreflightLimits:
    """What a device must be for arming. Where it does not say, nothing is held against it."""

    #: Days since the canopy was packed; 0: not looked at.
    max_pack_age: int = 365
    #: Arming needs a pack date at all.
    require_pack_date: bool = False
    #: Arming needs the parachute's own automatic trigger system to arm itself (ATS_AUTO_ARM).
    require_self_arm: bool = False
    #: On the ground the parachute must not say that it is high enough to deploy (GROUND_CLEARED).
    forbid_ground_cleared: bool = True
    #: Remaining charge of the vehicle's battery, 0 to 1.
    min_battery_remaining: float = 0.3
    #: V; 0: not looked at.
    min_battery_voltage: float = 0.0
    #: Of the parachute's own supply, V; 0: not looked at.
    min_backup_voltage: float = 0.0
    #: Wall clocks of the hosts may differ by this.
    max_clock_difference: float = 0.25


@dataclass(frozen=True)
class SupervisorConfig:
    """Settings of the supervisor's core."""

    #: Links whose health flight depends on.
    required_links: tuple[str, ...] = ("mavlink_parachute",)
    #: Links that stop the motors.
    kill_links: tuple[str, ...] = ("mavlink_parachute",)
    #: Links that release a parachute.
    deploy_links: tuple[str, ...] = ("mavlink_parachute",)
    #: Links whose devices never say how they are, and with which flight is allowed all the same.
    unmonitored_links: tuple[str, ...] = ()
    #: The steps of a deploy, first to last; empty: the deploy_links in their order, those that
    #: nobody monitors last.
    deploy_ladder: tuple[Rung, ...] = ()
    #: A step that has not been confirmed after this is followed by the next.
    ladder_step_timeout: float = 2.0
    #: Limits of each link, where they are not the standard ones.
    link_limits: Mapping[str, LinkLimits] = field(default_factory=lambda: _NO_LIMITS)
    #: The parachute is released this long after the kill, confirmed or not (as ArduPilot does).
    kill_to_deploy_delay: float = 0.5
    #: And not longer than this where the vehicle is low (Profile.low_height).
    low_kill_to_deploy_delay: float = 0.2
    #: How long the last step of a deploy may take until its confirmation.
    deploy_timeout: float = 8.0
    #: A kill without confirmation is given up, as seen by its caller, after this.
    kill_timeout: float = 6.0
    #: A parachute that says released is believed at once; its node's report is awaited this long,
    #: only to tell the caller how it went.
    report_wait: float = 0.5
    #: A decision that nobody has reported on is sent again after this; a kill or a deploy sooner
    #: at first.
    resend_interval: float = 0.1
    #: An alarm that does not stop is said again after this.
    alarm_interval: float = 2.0
    #: vehicle/state counts only while its parts are younger than this.
    vehicle_state_age: float = 2.5
    #: Without vehicle/state flight is blocked: nobody could tell flight from ground.
    require_vehicle_state: bool = True
    #: Without a landed state, armed and higher than this (m) is in the air.
    takeoff_height: float = 2.0
    #: Once it has landed and is disarmed, parachutes that `safety/arm` has armed are disarmed.
    disarm_after_landing: bool = True
    #: An update that comes later than its deadline by more was late: what was not heard meanwhile
    #: is not held against anybody.
    late_after: float = 0.2
    #: Of several supervisors each has another: 0 for the first choice, up to 3.
    rank: int = 0
    #: Others may run: whom a device refuses as older yields instead of going on above.
    standby: bool = False
    preflight: PreflightLimits = field(default=PreflightLimits())
    profile: Profile = field(default=Profile("device requests only", DEVICE_RULES))

    def __post_init__(self) -> None:
        for name in ("kill_to_deploy_delay", "low_kill_to_deploy_delay"):
            if not 0.0 <= getattr(self, name) <= 60.0:
                raise ParameterError(f"{name} is {getattr(self, name)}: need 0 to 60 s")
        for name in (
            "deploy_timeout",
            "kill_timeout",
            "resend_interval",
            "vehicle_state_age",
            "ladder_step_timeout",
            "alarm_interval",
            "late_after",
        ):
            if not 0.0 < getattr(self, name) <= 60.0:
                raise ParameterError(f"{name} is {getattr(self, name)}: need above 0, up to 60 s")
        for name in ("required_links", "kill_links", "deploy_links"):
            links = getattr(self, name)
            if not links or not all(links):
                raise ParameterError(f"{name} is {list(links)}: need at least one link's name")
        for link in self.unmonitored_links:
            if link not in self.links:
                raise ParameterError(
                    f"unmonitored_links names {link}: need one of {', '.join(self.links)}"
                )
        for rung in self.deploy_ladder:
            if rung.link not in self.deploy_links:
                raise ParameterError(
                    f"deploy_ladder names {rung}: need a link of deploy_links "
                    f"({', '.join(self.deploy_links)})"
                )

    @cached_property
    def links(self) -> tuple[str, ...]:
        """Every link that is followed, each once, the required ones first."""
        return tuple(dict.fromkeys(self.required_links + self.kill_links + self.deploy_links))

    @property
    def ladder(self) -> tuple[Rung, ...]:
        """The steps of a deploy, first to last; at least one."""
        hoped_for = self.unmonitored_links
        links = sorted(self.deploy_links, key=lambda link: link in hoped_for)
        return self.deploy_ladder or tuple(map(Rung, links))

    def limits(self, link: str) -> LinkLimits:
        """The limits of this link."""
        return self.link_limits.get(link, _STANDARD)


_STANDARD = LinkLimits()
