"""What a campaign flies with is what the nodes start with."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest
from campaign_bench import SHIPPED

from chute_ros.campaign.draw import draw
from chute_ros.campaign.scenario import Vehicle
from chute_ros.links.mavlink import parameters as mavlink_parameters
from chute_ros.links.mavlink.protocol.config import MavlinkConfig
from chute_ros.links.mavlink.runtime import MavlinkSettings
from chute_ros.links.umbilical import parameters as umbilical_parameters
from chute_ros.links.umbilical.protocol.config import UmbilicalConfig
from chute_ros.links.umbilical.runtime import UmbilicalSettings
from chute_ros.links.upf import parameters as upf_parameters
from chute_ros.links.upf.protocol.config import UpfConfig
from chute_ros.links.upf.runtime import UpfSettings
from chute_ros.nodes import supervisor_parameters
from chute_ros.nodes.device_node import BLOCK_FLIGHT, COMMON_PARAMETERS
from chute_ros.nodes.vehicle_sources import SOURCES
from chute_ros.runtime.device import DeviceSettings
from chute_ros.settings import Parameter, settings_from


def standard(parameters: tuple[Parameter, ...]) -> dict[str, Any]:
    return {one.name: one.default for one in parameters}


def test_the_links_have_the_standard_settings_of_their_nodes() -> None:
    mavlink = mavlink_parameters.config_from(standard(mavlink_parameters.PARAMETERS))
    assert mavlink == MavlinkConfig()
    told = standard(umbilical_parameters.PARAMETERS)
    umbilical = settings_from(umbilical_parameters.UmbilicalParameters, told)
    assert umbilical.link == UmbilicalConfig()
    upf = upf_parameters.config_from(standard(upf_parameters.PARAMETERS), {}, "upf_can", 0.0)
    # Which is another on each machine.
    assert replace(upf, unique_id=UpfConfig().unique_id) == UpfConfig()


@pytest.mark.parametrize(
    ("settings", "parameters"),
    [
        (MavlinkSettings(), mavlink_parameters.PARAMETERS),
        (UpfSettings(), upf_parameters.PARAMETERS),
        (UmbilicalSettings(), umbilical_parameters.PARAMETERS),
    ],
)
def test_so_have_their_runtimes(
    settings: DeviceSettings, parameters: tuple[Parameter, ...]
) -> None:
    told = standard((*COMMON_PARAMETERS, *parameters))
    told["block_when_lost"] = told["on_supervisor_lost"] == BLOCK_FLIGHT
    names = [field.name for field in fields(settings)]
    assert len(names) >= 4
    assert {name: getattr(settings, name) for name in names} == {n: told[n] for n in names}


def test_its_second_sources_are_ones_that_the_supervisor_takes() -> None:
    drawn = {one for seed in range(200) for one in draw(seed).vehicle_sources}
    assert {"vehicle/state", "imu", "odometry"} == drawn <= set(SOURCES)


@pytest.mark.parametrize("vehicle", Vehicle)
def test_so_has_the_supervisor(vehicle: Vehicle) -> None:
    profile = "rocket" if vehicle is Vehicle.ROCKET else "multirotor"
    flies = SHIPPED.config(vehicle, profile, False, 0)
    told = {
        "profile": profile,
        "required_links": list(flies.required_links),
        "kill_links": list(flies.kill_links),
        "deploy_links": list(flies.deploy_links),
        "deploy_ladder": [str(rung) for rung in flies.deploy_ladder] or [""],
    }
    values = {**standard(supervisor_parameters.PARAMETERS), **told}
    config = supervisor_parameters.config_from(values)
    assert all(config.limits(link) == flies.limits(link) for link in flies.links)
    assert replace(config, link_limits=flies.link_limits) == flies
