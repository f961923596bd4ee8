"""Scenarios as text: what was written reads back, and what is none is told so; and scenarios that
a person writes by hand."""

from __future__ import annotations

import json

import pytest
from campaign_bench import scenario

from chute_ros.campaign.channel import Spell
from chute_ros.campaign.draw import draw
from chute_ros.campaign.manoeuvre import landing
from chute_ros.campaign.scenario import (
    Failure,
    Person,
    Scenario,
    Stop,
    Vehicle,
    WayFault,
    flown_vehicles,
    ways_of,
)
from chute_ros.campaign.scenario_text import scenario_of, text_of
from chute_ros.campaign.sensors import SensorFault
from chute_ros.errors import RecordError


@pytest.mark.parametrize("seed", range(60))
def test_it_reads_back_as_it_was(seed: int) -> None:
    drawn = draw(seed)
    assert scenario_of(text_of(drawn, "MISSED: for a test"), "x") == (drawn, "MISSED: for a test")


def test_a_person_can_read_it() -> None:
    cut = WayFault("autopilot", Spell(0.5, 2.0, loss=1.0))
    text = text_of(scenario(Failure.MOTOR, cut, person=Person("kill", 3.0)), "was late")
    told = json.loads(text)
    assert told["format"] == 2
    assert told["scenario"]["failure"] == "MOTOR"
    assert told["scenario"]["person"] == {"does": "kill", "at": 3.0}
    spell = {"begin": 0.5, "end": 2.0, "loss": 1.0}
    assert told["scenario"]["faults"] == [{"kind": "WayFault", "way": "autopilot", "spell": spell}]


def test_one_of_before_second_sources_hears_the_autopilot_alone() -> None:
    told = json.loads(text_of(scenario(Failure.MOTOR), ""))
    del told["scenario"]["vehicle_sources"]
    assert scenario_of(json.dumps(told), "x")[0].vehicle_sources == ("vehicle/state",)
    fault = SensorFault("tilt", "jumps", 1.0, 2.0)
    told = json.loads(text_of(scenario(Failure.MOTOR, fault), ""))
    del told["scenario"]["faults"][0]["source"]
    assert scenario_of(json.dumps(told), "x")[0].faults == (fault,)


GOOD = text_of(scenario(Failure.MOTOR), "")
FLOWN = text_of(
    scenario(
        Failure.NOTHING,
        WayFault("autopilot", Spell(0.5, 2.0, loss=1.0)),
        SensorFault("tilt", "jumps", 1.0, 2.0),
        Stop("imu", 1.0, 1.0),
        manoeuvre=landing(20.0, 3.0, 1.5, 1.0),
    ),
    "",
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "old.json is no scenario of a campaign: JSONDecodeError"),
        ("{}", "KeyError: 'format'"),
        (GOOD.replace('"format": 2', '"format": 7'), "old.json: format 7: need 2"),
        (GOOD.replace("MOTOR", "WHEEL"), "KeyError: 'WHEEL'"),
        (GOOD.replace('"height"', '"depth"'), "TypeError"),
        ("[1]", "TypeError"),
        (GOOD.replace("60.0", '"high"'), "height is 'high': need a number"),
        (GOOD.replace("60.0", "NaN"), "NaN is no number"),
        (GOOD.replace('"multirotor"', '"kite"'), "profile 'kite': need one of multirotor, "),
        (GOOD.replace('"flights": 1', '"flights": 0'), "flights is 0: need 1 or more"),
        (FLOWN.replace('"landing"', '"hover"'), "manoeuvre 'hover': need one of flip, throw, "),
        (FLOWN.replace('"amount": 1.5', '"amount": 0.0'), "amount of a landing is 0.0: need"),
        (FLOWN.replace('"imu"', '"eyes"'), "who 'eyes': need one of supervisor, standby, "),
        (FLOWN.replace('"way": "autopilot"', '"way": "air"'), "way 'air': need one of "),
        (FLOWN.replace('"tilt"', '"smell"'), "sensor 'smell': need one of height, speed, "),
        (FLOWN.replace('"jumps"', '"hops"'), "how 'hops': need one of sticks, jumps, "),
    ],
)
def test_what_is_none_is_told_with_its_name(text: str, words: str) -> None:
    with pytest.raises(RecordError, match=r"old\.json") as told:
        scenario_of(text, "old.json")
    assert words in str(told.value)


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
