"""Which devices are ours, among everything that can be heard on a network."""

from dataclasses import dataclass, field

import pytest

from chute_ros.links.mavlink.protocol.devices import MOST_DEVICES, DeviceFilter
from chute_ros.protocol.liveness import Liveness, LivenessLimits


@dataclass
class Thing:
    device: str
    liveness: Liveness = field(default_factory=lambda: Liveness(LivenessLimits(1.0, 2.0)))


def heard(device_table, system_id, component_id):
    if not device_table.admits(system_id, component_id):
        return False
    if device_table.get(system_id, component_id) is None:
        device_table.add(system_id, component_id, Thing(f"{system_id}/{component_id}"))
    return True


def test_named_system_is_ours_and_no_other_and_there_is_no_doubt():
    device_table = DeviceFilter("parachute", 3, 0)
    assert not heard(device_table, 1, 161)
    assert heard(device_table, 3, 161)
    assert heard(device_table, 3, 7)
    assert [thing.device for thing in device_table.all()] == ["3/161", "3/7"]
    assert device_table.doubt() == ""


def test_without_a_name_the_first_system_is_ours_and_a_second_makes_doubt():
    device_table = DeviceFilter("parachute", 0, 0)
    assert heard(device_table, 2, 161)
    assert device_table.doubt() == ""
    assert not heard(device_table, 1, 161)
    assert device_table.get(1, 161) is None
    assert device_table.doubt() == (
        "parachutes of systems 1, 2 received, using 2: set parachute_system_id"
    )
    assert heard(device_table, 2, 162)


def test_other_component_than_the_named_one_is_neither_ours_nor_makes_doubt():
    device_table = DeviceFilter("autopilot", 0, 1)
    assert not heard(device_table, 9, 2)
    assert heard(device_table, 1, 1)
    assert not heard(device_table, 1, 2)
    assert not heard(device_table, 9, 154)
    assert device_table.doubt() == ""
    # Component 0 is a sender like any other.
    # The protocol's public emulator speaks as 255/0.
    device_table = DeviceFilter("parachute", 0, 0)
    assert heard(device_table, 255, 0)
    assert device_table.named("255/0") is device_table.get(255, 0)
    # Device by its name.
    device_table = DeviceFilter("parachute", 0, 0)
    heard(device_table, 1, 161)
    assert device_table.named("1/161").device == "1/161"
    assert device_table.named("1/16") is None


@pytest.mark.parametrize("named", [0, 1])
def test_system_0_is_nobody(named):
    """A command to it would go to every vehicle in reach."""
    device_table = DeviceFilter("parachute", named, 0)
    assert not heard(device_table, 0, 161)
    assert heard(device_table, 1, 161)
    assert device_table.system_id == 1
    assert device_table.doubt() == ""


def test_flood_of_made_up_ids_is_bounded_and_keeps_those_who_were_first():
    device_table = DeviceFilter("parachute", 0, 0)
    admitted = [heard(device_table, 1, component) for component in range(256)]
    assert admitted.count(True) == MOST_DEVICES
    assert device_table.refused_count == 256 - MOST_DEVICES
    assert heard(device_table, 1, 3)
    for system in range(256):
        heard(device_table, system, 1)
    assert len(device_table.all()) == MOST_DEVICES
    assert device_table.doubt().count(",") <= MOST_DEVICES + 1


def test_what_was_made_up_and_is_lost_makes_room_for_the_true_device():
    """The longest lost first; one that is heard is never given up."""
    device_table = DeviceFilter("parachute", 1, 0)
    for component in range(1, MOST_DEVICES + 1):
        assert heard(device_table, 1, component)
        device_table.get(1, component).liveness.heard(float(component))
    assert not heard(device_table, 1, 161)
    device_table.get(1, 3).liveness.heard(100.0)
    for thing in device_table.all():
        thing.liveness.update(100.5)
        thing.liveness.update(101.0)
    for newcomer in range(200, 200 + MOST_DEVICES - 1):
        assert heard(device_table, 1, newcomer)
        device_table.get(1, newcomer).liveness.heard(101.0)
    assert not heard(device_table, 1, 161)
    assert next(one.device for one in device_table.all()) == "1/3"
