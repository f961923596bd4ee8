"""The settings of the supervisor's core."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

from chute_ros.errors import ParameterError
from chute_ros.settings import Settings, nested, parameter
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
class PreflightLimits(Settings):
    """What a device must be for arming. Where it does not say, nothing is held against it."""

    max_pack_age: int = parameter(
        365, "arming needs a canopy packed at most this long ago; 0: any", 0, 36500, "days"
    )
    require_pack_date: bool = parameter(False, "arming needs a pack date")
    require_self_arm: bool = parameter(
        False, "arming needs ATS_AUTO_ARM: the parachute arms itself by height"
    )
    forbid_ground_cleared: bool = parameter(
        True,
        "arming needs GROUND_CLEARED not set: a parachute on the ground must not report that it "
        "may deploy",
    )
    min_battery_remaining: float = parameter(
        0.3, "arming needs this remaining charge of the battery", 0.0, 1.0, "of full charge"
    )
    min_battery_voltage: float = parameter(
        0.0, "arming needs this voltage of the battery; 0: any", 0.0, 1000.0, "V"
    )
    min_backup_voltage: float = parameter(
        0.0, "arming needs this voltage of the parachute's own supply; 0: any", 0.0, 1000.0, "V"
    )
    max_clock_difference: float = parameter(
        0.25, "arming needs the hosts' wall clocks to differ by less than this", 0.001, 60.0, "s"
    )


@dataclass(frozen=True)
class SupervisorConfig(Settings):
    """Settings of the supervisor's core."""

    required_links: tuple[str, ...] = parameter(
        ("mavlink_parachute",), "links whose health flight depends on (node names)"
    )
    kill_links: tuple[str, ...] = parameter(
        ("mavlink_parachute",), "links that stop the motors (node names)"
    )
    deploy_links: tuple[str, ...] = parameter(
        ("mavlink_parachute",), "links that release a parachute (node names)"
    )
    #: Links whose devices never report anything, and with which flight is allowed all the same.
    unmonitored_links: tuple[str, ...] = ()
    #: The steps of a deploy, first to last; empty: the deploy_links in their order, the
    #: unmonitored_links last.
    deploy_ladder: tuple[Rung, ...] = ()
    ladder_step_timeout: float = parameter(
        2.0, "wait for the confirmation of a ladder step before the next step", 0.1, 60.0, "s"
    )
    #: Rules of the profile that can never be fulfilled, as the autopilot is the only source.
    blind_rules: tuple[str, ...] = ()
    #: Limits of each link, where they are not the standard ones.
    link_limits: Mapping[str, LinkLimits] = field(default_factory=lambda: _NO_LIMITS)
    #: As ArduPilot does.
    kill_to_deploy_delay: float = parameter(
        0.5, "a deploy waits for the confirmation of the kill at most this long", 0.0, 60.0, "s"
    )
    low_kill_to_deploy_delay: float = parameter(
        0.2,
        "a deploy waits for the confirmation of the kill at most this long in flight below the "
        "low_height of the profile",
        0.0,
        60.0,
        "s",
    )
    deploy_timeout: float = parameter(
        8.0, "a deploy fails if it is not confirmed within this time", 0.1, 60.0, "s"
    )
    kill_timeout: float = parameter(
        6.0, "a kill fails if it is not confirmed within this time", 0.1, 60.0, "s"
    )
    #: A parachute that says released is believed at once; its node's report is awaited this long,
    #: only to tell the caller how it went.
    report_wait: float = 0.5
    resend_interval: float = parameter(
        0.1,
        "interval before an unacknowledged decision is resent (kill and deploy start at 20 ms)",
        0.02,
        60.0,
        "s",
    )
    alarm_interval: float = parameter(
        2.0, "interval before an alarm that lasts is repeated", 0.1, 60.0, "s"
    )
    vehicle_state_age: float = parameter(
        2.5, "parts of vehicle/state older than this are ignored", 0.1, 60.0, "s"
    )
    vehicle_source_rate: float = parameter(
        5.0,
        "take-off is forbidden if another source of vehicle_sources than vehicle/state reports "
        "height, vertical speed, attitude or acceleration at a lower rate, or is never received; "
        "0: not checked",
        0.0,
        100.0,
        "Hz",
    )
    require_vehicle_state: bool = parameter(
        True, "block flight without vehicle/state: flight and ground cannot be told apart"
    )
    takeoff_height: float = parameter(
        2.0,
        "an armed vehicle higher than this is in flight if no landed state is known",
        0.1,
        100.0,
        "m",
    )
    disarm_after_landing: bool = parameter(
        True, "disarm the parachutes that were armed on the ground after landing and disarming"
    )
    late_after: float = parameter(
        0.2,
        "an update of the supervisor is late after this delay; silence during it is not counted",
        0.02,
        60.0,
        "s",
    )
    #: LeaseConfig's: of several supervisors each has another.
    rank: int = 0
    #: Others may run: whom a device refuses as older yields instead of going on above.
    standby: bool = False
    preflight: PreflightLimits = nested(PreflightLimits())
    profile: Profile = field(default=Profile("device requests only", DEVICE_RULES))

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("required_links", "kill_links", "deploy_links"):
            links = getattr(self, name)
            if not links or not all(links):
                raise ParameterError(
                    f"parameter {name} is {list(links)}: need at least one link's name"
                )
        for link in self.unmonitored_links:
            if link not in self.links:
                raise ParameterError(
                    f"parameter unmonitored_links names {link}: need one of "
                    f"{', '.join(self.links)}"
                )
        for rung in self.deploy_ladder:
            if rung.link not in self.deploy_links:
                raise ParameterError(
                    f"parameter deploy_ladder names {rung}: need a link of deploy_links "
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
