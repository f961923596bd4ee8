"""The table of what can be done to a simulated vehicle."""

import re

import pytest

from chute_ros.links.registered import vehicles
from chute_ros.sim.bench_actions import ACTIONS, actions_of
from chute_ros.tools.simulated_vehicle import simulators_of


def names(vehicle):
    return [one.name for one in actions_of(simulators_of(vehicle))]


def test_each_has_a_name_for_its_service_and_says_what_it_does():
    assert (
        len({one.name for one in ACTIONS}) == len({one.title for one in ACTIONS}) == len(ACTIONS)
    )
    for one in ACTIONS:
        assert re.fullmatch(r"[a-z]+(_[a-z]+)*", one.name)
        assert one.orders
        assert re.match(r"[A-Z].*\.$", one.effect), one.name


def test_each_is_of_some_vehicle():
    assert {name for vehicle in vehicles() for name in names(vehicle)} == {
        one.name for one in ACTIONS
    }


@pytest.mark.parametrize("vehicle", vehicles())
def test_a_vehicle_has_the_actions_of_its_simulators_with_the_orders_to_them(vehicle):
    there = simulators_of(vehicle)
    actions = actions_of(there)
    assert {simulator for one in actions for simulator, _ in one.orders} == set(there)
    assert {"refuse_to_open", "open_again", "start_over"} <= set(names(vehicle))


def test_a_rocket_is_launched_and_a_drone_takes_off():
    assert "launch" in names("umbilical")
    assert "take_off" not in names("umbilical")
    assert [one.name for one in ACTIONS if one.leaves_ground] == ["take_off", "launch"]


def test_without_simulators_nothing_can_be_done():
    assert actions_of([]) == ()
