"""What a campaign flies with is what the nodes start with."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from campaign_bench import SHIPPED

from chute_ros.campaign.draw import draw
from chute_ros.links.mavlink.parameters import MavlinkParameters
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.runtime import MavlinkSettings
from chute_ros.links.registered import vehicles
from chute_ros.links.umbilical.parameters import UmbilicalParameters
from chute_ros.links.umbilical.protocol.config import UmbilicalConfig
from chute_ros.links.umbilical.runtime import UmbilicalSettings
from chute_ros.links.upf.parameters import UpfParameters, config_from
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.runtime import UpfSettings
from chute_ros.ros import supervisor_parameters
from chute_ros.ros.vehicle_sources import SOURCES
from chute_ros.settings import Parameter, Settings, parameters_of, settings_from


def standard(parameters: tuple[Parameter, ...]) -> dict[str, Any]:
    return {one.name: one.default for one in parameters}


def test_the_nodes_of_the_links_have_the_standard_settings() -> None:
    mavlink, umbilical = MavlinkParameters(), UmbilicalParameters()
    assert mavlink.runtime == MavlinkSettings()
    assert mavlink.runtime.link == MavlinkConfig()
    assert umbilical.runtime == UmbilicalSettings()
    assert umbilical.runtime.link == UmbilicalConfig()
    upf = UpfParameters().runtime
    assert upf == UpfSettings()
    # Which is another on each machine.
    link = config_from(upf.link, {}, "upf_can", 0.0)
    assert replace(link, unique_id=UpfConfig().unique_id) == UpfConfig()


@pytest.mark.parametrize("kind", [MavlinkParameters, UpfParameters, UmbilicalParameters])
def test_the_defaults_that_ros_knows_are_those_of_the_settings(kind: type[Settings]) -> None:
    told = standard(parameters_of(kind))
    assert len(told) >= 25
    assert settings_from(kind, told) == kind()


def test_its_second_sources_are_ones_that_the_supervisor_takes() -> None:
    drawn = {one for seed in range(200) for one in draw(seed).vehicle_sources}
    assert {"vehicle/state", "imu", "odometry"} == drawn <= set(SOURCES)


@pytest.mark.parametrize("vehicle", vehicles())
def test_so_has_the_supervisor(vehicle: str) -> None:
    profile = "rocket" if vehicle == "umbilical" else "multirotor"
    flies = SHIPPED.config(vehicle, profile, False, 0)
    told = {
        "profile": profile,
        "required_links": list(flies.required_links),
        "kill_links": list(flies.kill_links),
        "deploy_links": list(flies.deploy_links),
        "unmonitored_links": list(flies.unmonitored_links) or [""],
        "deploy_ladder": [str(rung) for rung in flies.deploy_ladder] or [""],
    }
    values = {**standard(supervisor_parameters.PARAMETERS), **told}
    config = supervisor_parameters.config_from(values)
    assert all(config.limits(link) == flies.limits(link) for link in flies.links)
    # Nothing is decided by what cannot be fulfilled; each flight has sources of its own.
    assert replace(config, link_limits=flies.link_limits, blind_rules=()) == flies
