"""The parameters of safety_supervisor and what they become."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Any

from chute_ros.errors import ParameterError
from chute_ros.nodes.black_box_parameters import PARAMETERS as BLACK_BOX_PARAMETERS
from chute_ros.nodes.parameters import Parameter, liveness_from
from chute_ros.nodes.profile_files import load_profile
from chute_ros.nodes.supervisor_memory import MEMORY_PARAMETERS
from chute_ros.nodes.vehicle_sources import VEHICLE_PARAMETERS
from chute_ros.protocol.vehicle_merge import MAVROS, VEHICLE_STATE
from chute_ros.supervisor.config import PreflightLimits, Rung, SupervisorConfig
from chute_ros.supervisor.epochs import RANKS
from chute_ros.supervisor.inputs import Mode
from chute_ros.supervisor.lease import LeaseConfig
from chute_ros.supervisor.link_evidence import LinkLimits

PARAMETERS = (
    Parameter(
        "mode",
        "ACTIVE",
        "mode at the start; SHADOW decides and says it, INHIBITED does nothing",
        choices=tuple(mode.name for mode in Mode),
    ),
    Parameter(
        "required_links",
        ["mavlink_parachute"],
        "links whose health flight depends on (node names)",
    ),
    Parameter("kill_links", ["mavlink_parachute"], "links that stop the motors (node names)"),
    Parameter(
        "deploy_links", ["mavlink_parachute"], "links that release a parachute (node names)"
    ),
    Parameter(
        "profile",
        "multirotor",
        "rules of the vehicle: multirotor, fixed_wing, rocket, by_hand, or a file "
        "(docs/reference/rules.md)",
    ),
    Parameter(
        "deploy_ladder",
        [""],
        "steps of a deploy, first to last, each LINK or LINK:DEVICE (upf_can:trigger fires a UPF "
        "parachute past its controller); empty: the deploy_links in their order",
    ),
    Parameter(
        "ladder_step_timeout",
        2.0,
        "a step of the ladder that is not confirmed after this is followed by the next, s",
        0.1,
        60.0,
    ),
    Parameter(
        "heartbeat_stale_after", 0.5, "a node silent for this long is STALE, s", 0.05, 600.0
    ),
    Parameter("heartbeat_lost_after", 1.0, "a node silent for this long is LOST, s", 0.05, 600.0),
    Parameter(
        "heartbeat_regain_after",
        1.0,
        "a node that was LOST must be heard for this long before it counts again, s",
        0.0,
        60.0,
    ),
    Parameter(
        "link_limits",
        [""],
        "limits of single links, each LINK NAME=VALUE ... with stale_after, lost_after, "
        "regain_after, startup_grace in s (umbilical stale_after=1.0 lost_after=3.0)",
    ),
    Parameter("startup_grace", 10.0, "how long links may take to come up, s", 0.0, 60.0),
    Parameter(
        "kill_to_deploy_delay",
        0.5,
        "the deploy waits for the kill's confirmation, but no longer than this, s",
        0.0,
        60.0,
    ),
    Parameter(
        "low_kill_to_deploy_delay",
        0.2,
        "no longer than this it waits below the low_height of the profile, in flight, s",
        0.0,
        60.0,
    ),
    Parameter("deploy_timeout", 8.0, "how long a deploy may take to be confirmed, s", 0.1, 60.0),
    Parameter("kill_timeout", 6.0, "how long a kill may take to be confirmed, s", 0.1, 60.0),
    Parameter(
        "resend_interval",
        0.1,
        "a decision without any report is sent again after (at first what fires sooner), s",
        0.02,
        60.0,
    ),
    Parameter(
        "vehicle_state_age",
        2.5,
        "parts of vehicle/state that are older do not count, s",
        0.1,
        60.0,
    ),
    Parameter(
        "require_vehicle_state",
        True,
        "block flight without vehicle/state: nobody could tell flight from ground",
    ),
    Parameter(
        "takeoff_height",
        2.0,
        "armed and higher is in the air, where no landed state is known, m",
        0.1,
        100.0,
    ),
    Parameter(
        "disarm_after_landing",
        True,
        "once landed and disarmed, disarm the parachutes that safety/arm has armed",
    ),
    Parameter(
        "alarm_interval",
        2.0,
        "an alarm that does not stop is said again after this, s",
        0.1,
        60.0,
    ),
    Parameter(
        "late_after",
        0.2,
        "an update that comes later than this was late: silence meanwhile does not count, s",
        0.02,
        60.0,
    ),
    Parameter(
        "max_pack_age",
        365,
        "arming needs a canopy packed so many days ago at most, 0: any",
        0,
        36500,
    ),
    Parameter("require_pack_date", False, "arming needs a pack date at all"),
    Parameter(
        "require_self_arm", False, "arming needs ATS_AUTO_ARM: the parachute arms itself by height"
    ),
    Parameter(
        "forbid_ground_cleared",
        True,
        "arming needs GROUND_CLEARED not set: on the ground it must not say that it may deploy",
    ),
    Parameter(
        "min_battery_remaining", 0.3, "arming needs this remaining charge, 0 to 1", 0.0, 1.0
    ),
    Parameter("min_battery_voltage", 0.0, "arming needs this voltage, V, 0: any", 0.0, 1000.0),
    Parameter(
        "min_backup_voltage",
        0.0,
        "arming needs this voltage of the parachute's own supply, V, 0: any",
        0.0,
        1000.0,
    ),
    Parameter(
        "max_clock_difference",
        0.25,
        "arming needs the hosts' wall clocks to differ by less, s",
        0.001,
        60.0,
    ),
    Parameter("hot_standby", False, "a second supervisor may run; one of them leads, by lease"),
    Parameter(
        "rank",
        0,
        "of several supervisors each has its own, 0 for the first choice",
        0,
        RANKS - 1,
    ),
    Parameter(
        "lease_timeout",
        0.5,
        "a leading supervisor that is silent for this long has lost the lease, s",
        0.15,
        60.0,
    ),
    Parameter(
        "lease_listen",
        4.0,
        "one of several that starts looks so long for a leader before it leads, s",
        0.0,
        60.0,
    ),
    *VEHICLE_PARAMETERS,
    *MEMORY_PARAMETERS,
    *BLACK_BOX_PARAMETERS,
)


def config_from(values: Mapping[str, Any]) -> SupervisorConfig:
    """The settings of the core; ParameterError where two parameters contradict each other,
    ProfileError with every mistake of the profile."""
    heartbeat = liveness_from(values, "heartbeat")
    standard = LinkLimits(
        heartbeat.stale_after,
        heartbeat.lost_after,
        values["heartbeat_regain_after"],
        values["startup_grace"],
    )
    config = SupervisorConfig(
        required_links=tuple(values["required_links"]),
        kill_links=tuple(values["kill_links"]),
        deploy_links=tuple(values["deploy_links"]),
        deploy_ladder=tuple(Rung.parse(text) for text in _given(values["deploy_ladder"])),
        ladder_step_timeout=values["ladder_step_timeout"],
        kill_to_deploy_delay=values["kill_to_deploy_delay"],
        low_kill_to_deploy_delay=values["low_kill_to_deploy_delay"],
        deploy_timeout=values["deploy_timeout"],
        kill_timeout=values["kill_timeout"],
        resend_interval=values["resend_interval"],
        alarm_interval=values["alarm_interval"],
        vehicle_state_age=values["vehicle_state_age"],
        require_vehicle_state=values["require_vehicle_state"],
        takeoff_height=values["takeoff_height"],
        disarm_after_landing=values["disarm_after_landing"],
        late_after=values["late_after"],
        rank=values["rank"],
        standby=values["hot_standby"],
        preflight=PreflightLimits(
            **{field.name: values[field.name] for field in fields(PreflightLimits)}
        ),
    )
    return replace(
        config,
        link_limits=MappingProxyType(
            dict.fromkeys(config.links, standard)
            | _link_limits(_given(values["link_limits"]), config.links, standard)
        ),
        profile=load_profile(values["profile"], config.links),
    )


def blind_rules(config: SupervisorConfig, sources: Sequence[str]) -> list[str]:
    """The rules that can never be fulfilled: they rest on measurements while the autopilot is
    silent, and it is the only source of measurements."""
    if set(sources) - {VEHICLE_STATE, MAVROS}:
        return []
    return [
        rule.name
        for rule in config.profile.rules
        if rule.misses_the_autopilot
        and sum(one.weight for one in rule.conditions if one.is_silence) < rule.needed
    ]


def lease_from(values: Mapping[str, Any], config: SupervisorConfig, name: str) -> LeaseConfig:
    """Which part this supervisor has among several. name: of its node."""
    return LeaseConfig(
        name,
        values["rank"],
        values["hot_standby"],
        values["lease_timeout"],
        values["lease_listen"],
        max(config.limits(link).lost_after for link in config.links),
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
            raise ParameterError(f"parameter link_limits for {link}: {error}") from None
    return told
