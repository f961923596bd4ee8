"""The parameters of safety_supervisor and what they become."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any

from chute_ros.errors import ParameterError
from chute_ros.links.registered import links
from chute_ros.protocol.vehicle_merge import MAVROS, VEHICLE_STATE
from chute_ros.ros.black_box_parameters import BlackBoxSettings
from chute_ros.ros.profile_files import load_profile
from chute_ros.ros.vehicle_sources import VehicleSettings
from chute_ros.settings import Settings, nested, parameter, parameters_of, settings_from
from chute_ros.supervisor.config import Rung, SupervisorConfig
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.lease import LeaseConfig
from chute_ros.supervisor.link_evidence import LinkLimits
from chute_ros.supervisor.rules import Profile


@dataclass(frozen=True)
class SupervisorParameters(Settings):
    """All parameters of the node; first those that config_from makes settings of the core of."""

    mode: Mode = parameter(
        Mode.ACTIVE,
        "mode at the start; SHADOW decides and reports but sends nothing; INHIBITED does nothing",
    )
    profile: str = parameter(
        "multirotor",
        "rules of the vehicle: multirotor, fixed_wing, rocket, by_hand, or a file "
        "(docs/reference/rules.md)",
    )
    deploy_ladder: tuple[str, ...] = parameter(
        ("",),
        "steps of a deploy, first to last, each LINK or LINK:DEVICE (upf_can:trigger fires a UPF "
        "parachute past its controller); empty: the deploy_links in their order",
    )
    unmonitored_links: tuple[str, ...] = parameter(
        ("",),
        "links whose devices never report anything, and with which flight is allowed all the same "
        "(node names); they are the last steps of a deploy unless deploy_ladder says otherwise",
    )
    link_limits: tuple[str, ...] = parameter(
        ("",),
        "limits of single links, each LINK NAME=VALUE ... with stale_after, lost_after, "
        "regain_after, startup_grace in s (umbilical stale_after=1.0 lost_after=3.0)",
    )
    limits: LinkLimits = nested(LinkLimits(), "heartbeat", startup_grace={"name": "startup_grace"})
    config: SupervisorConfig = nested(SupervisorConfig())
    lease: LeaseConfig = nested(LeaseConfig())
    vehicle: VehicleSettings = nested(VehicleSettings())
    resume_within: float = parameter(
        30.0,
        "a supervisor that restarts in flight resumes from its saved state if that is younger "
        "than this; 0: never",
        0.0,
        600.0,
        "s",
    )
    black_box: BlackBoxSettings = nested(BlackBoxSettings())


PARAMETERS = parameters_of(SupervisorParameters)


def config_from(values: Mapping[str, Any]) -> SupervisorConfig:
    """The settings of the core; ParameterError where two parameters contradict each other,
    ProfileError with every mistake of the profile."""
    given = settings_from(SupervisorParameters, values)
    _check_kill_links(given.config.kill_links)
    profile = load_profile(given.profile, given.config.links)
    config = replace(
        given.config,
        profile=profile,
        blind_rules=_blind_rules(profile, given.vehicle.vehicle_sources),
        unmonitored_links=tuple(_given(given.unmonitored_links)),
        deploy_ladder=tuple(Rung.parse(text) for text in _given(given.deploy_ladder)),
        rank=given.lease.rank,
        standby=given.lease.standby,
    )
    return replace(
        config,
        link_limits=MappingProxyType(
            dict.fromkeys(config.links, given.limits)
            | _link_limits(_given(given.link_limits), config.links, given.limits)
        ),
    )


def _blind_rules(profile: Profile, sources: Sequence[str]) -> tuple[str, ...]:
    """They rest on measurements while the autopilot is silent."""
    if set(sources) - {VEHICLE_STATE, MAVROS}:
        return ()
    return tuple(
        rule.name
        for rule in profile.rules
        if rule.misses_the_autopilot
        and sum(one.weight for one in rule.conditions if one.is_silence) < rule.needed
    )


def lease_from(values: Mapping[str, Any], config: SupervisorConfig, name: str) -> LeaseConfig:
    """Which part this supervisor has among several. name: of its node."""
    deaf_after = max(config.limits(link).lost_after for link in config.links)
    return replace(settings_from(LeaseConfig, values), name=name, deaf_after=deaf_after)


def _check_kill_links(names: Sequence[str]) -> None:
    # One that is not registered may stop them, and is known only when it is heard.
    for name in names:
        if name in links() and not links()[name].stops_motors:
            able = ", ".join(one for one, kind in links().items() if kind.stops_motors)
            raise ParameterError(
                f"parameter kill_links is {list(names)}: {name} stops no motors; need links that "
                f"do ({able})"
            )


def _given(texts: Sequence[str]) -> list[str]:
    """Without the empty text that stands for an empty list, which ROS has no type for."""
    return [text for text in texts if text]


def _link_limits(
    texts: Sequence[str], links: Sequence[str], standard: LinkLimits
) -> dict[str, LinkLimits]:
    names = [field.name for field in fields(LinkLimits)]
    told: dict[str, LinkLimits] = {}
    for text in texts:
        link, *settings = text.split()
        if link not in links:
            raise ParameterError(
                f"parameter link_limits names {link!r}: need one of {', '.join(links)}"
            )
        limits = {}
        for setting in settings:
            name, _, value = setting.partition("=")
            try:
                limits[name] = float(value)
            except ValueError:
                name = ""
            if name not in names:
                raise ParameterError(
                    f"parameter link_limits has {setting!r} for {link}: need NAME=SECONDS with "
                    f"{', '.join(names)}"
                )
        try:
            told[link] = replace(standard, **limits)
        except ParameterError as error:
            said = str(error).removeprefix("parameter ")
            raise ParameterError(f"parameter link_limits for {link}: {said}") from None
    return told
