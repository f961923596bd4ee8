"""Which devices are ours, among everything that can be heard on a network."""

from dataclasses import dataclass, field

import pytest

from chute_ros.links.mavlink.protocol.devices import MOST_DEVICES, Roster
from chute_ros.protocol.liveness import Liveness, LivenessLimits


@dataclass
class Thing:
    device: str
    liveness: Liveness = field(default_factory=lambda: Liveness(LivenessLimits(1.0, 2.0)))


def heard(roster, system_id, component_id):
    if not roster.admits(system_id, component_id):
        return False
    if roster.get(system_id, component_id) is None:
        roster.add(system_id, component_id, Thing(f"{system_id}/{component_id}"))
    return True


def test_named_system_is_ours_and_no_other_and_there_is_no_doubt():
    roster = Roster("parachute", 3, 0)
    assert not heard(roster, 1, 161)
    assert heard(roster, 3, 161)
    assert heard(roster, 3, 7)
    assert [thing.device for thing in roster.all()] == ["3/161", "3/7"]
    assert roster.doubt() == ""


def test_without_a_name_the_first_system_is_ours_and_a_second_makes_doubt():
    roster = Roster("parachute", 0, 0)
    assert heard(roster, 2, 161)
    assert roster.doubt() == ""
    assert not heard(roster, 1, 161)
    assert roster.get(1, 161) is None
    assert roster.doubt() == (
        "parachutes of systems 1, 2 received, using 2: set parachute_system_id"
    )
    assert heard(roster, 2, 162)


def test_other_component_than_the_named_one_is_neither_ours_nor_makes_doubt():
    roster = Roster("autopilot", 0, 1)
    assert not heard(roster, 9, 2)
    assert heard(roster, 1, 1)
    assert not heard(roster, 1, 2)
    assert not heard(roster, 9, 154)
    assert roster.doubt() == ""
    # Component 0 is a sender like any other.
    # The protocol's public emulator speaks as 255/0.
    roster = Roster("parachute", 0, 0)
    assert heard(roster, 255, 0)
    assert roster.named("255/0") is roster.get(255, 0)
    # Device by its name.
    roster = Roster("parachute", 0, 0)
    heard(roster, 1, 161)
    assert roster.named("1/161").device == "1/161"
    assert roster.named("1/16") is None


@pytest.mark.parametrize("named", [0, 1])
def test_system_0_is_nobody(named):
    """A command to it would go to every vehicle in reach."""
    roster = Roster("parachute", named, 0)
    assert not heard(roster, 0, 161)
    assert heard(roster, 1, 161)
    assert roster.system_id == 1
    assert roster.doubt() == ""


def test_flood_of_made_up_ids_is_bounded_and_keeps_those_who_were_first():
    roster = Roster("parachute", 0, 0)
    admitted = [heard(roster, 1, component) for component in range(256)]
    assert admitted.count(True) == MOST_DEVICES
    assert roster.refused_count == 256 - MOST_DEVICES
    assert heard(roster, 1, 3)
    for system in range(256):
        heard(roster, system, 1)
    assert len(roster.all()) == MOST_DEVICES
    assert roster.doubt().count(",") <= MOST_DEVICES + 1
