"""A scenario that a person writes by hand names its vehicle by a member or by its name."""

from __future__ import annotations

from chute_ros.campaign.scenario import Failure, Scenario, Vehicle, flown_vehicles, ways_of


def test_each_vehicle_that_is_flown_is_a_member_and_its_name() -> None:
    assert [one.value for one in Vehicle] == [one.name for one in flown_vehicles()]
    assert Vehicle.MAVLINK == "mavlink"
    assert {"mavlink": 1}[Vehicle.MAVLINK] == 1
    assert ways_of(Vehicle.BOTH) == ways_of("both")


def test_a_scenario_with_a_member_is_that_with_the_name() -> None:
    def written(vehicle: str) -> Scenario:
        return Scenario(1, vehicle, "multirotor", 80.0, 0.3, 25.0, 0.0, Failure.MOTOR, 1.0)

    assert written(Vehicle.UPF) == written("upf")
    assert written(Vehicle.UPF).carries.name == "upf"
