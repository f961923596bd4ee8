"""flyfire.VehicleStatus: ten times a second, and nothing old in it."""

import math

import pytest
from upf_link_bench import LAYOUTS, Bench, Layout, flying, landed, types_of

from chute_ros.links.upf.protocol.definitions import VEHICLE_STATUS, Definitions
from chute_ros.model import LandedState, LinkState, VehicleState


def test_landed_state_by_its_name(bench):
    in_air = (LandedState.IN_AIR, LandedState.TAKING_OFF, LandedState.LANDING)
    kinds = {LandedState.ON_GROUND: "ON_GROUND", LandedState.UNKNOWN: ""}
    for state, name in {**kinds, **dict.fromkeys(in_air, "IN_AIR")}.items():
        assert told(bench(""), flying(landed_state=state))["state"] == name


def test_field_that_is_missing_or_old_is_told_as_not_known(bench):
    nan, inf = math.nan, math.inf
    for field, changes in {
        "": [{}],
        "state": [{"landed_state_age": age} for age in (1.1, nan)],
        "height_of_home": [
            *({"height_age": age} for age in (1.1, nan)),
            *({"height": height} for height in (nan, inf, 70000.0)),
        ],
        "vz": [{"vertical_speed_age": 1.1}, {"vertical_speed": nan}],
    }.items():
        for change in changes:
            values = told(bench(""), flying(**change))
            known = {"state": "IN_AIR", "height_of_home": 50.0, "vz": -1.5}
            if field:
                del known[field]
                unknown = values[field]
                assert unknown == "" if field == "state" else math.isnan(unknown), change
            assert {name: values[name] for name in known} == known, change


def test_vehicle_that_is_not_known_or_lost_has_no_values(bench):
    for state in (None, VehicleState(), flying(link_state=LinkState.LOST)):
        values = told(bench(""), state)
        assert values["state"] == ""
        assert math.isnan(values["height_of_home"])
        assert math.isnan(values["vz"])


def told(story, state=None, passed=0.0):
    """The VehicleStatus that follows; state as its name, empty: not known."""
    if state is not None:
        story.call("vehicle", state)
    story.after(passed).clear().after(0.11)
    values = story.messages(VEHICLE_STATUS)[-1]
    name = story.definitions.state_name(VEHICLE_STATUS, values)
    return {**values, "state": "" if name == "UNKNOWN" else name}


def test_it_is_sent_ten_times_a_second(bench):
    story = bench("").step().call("vehicle", flying())
    assert 99 <= len(story.clear().at(10.0).messages(VEHICLE_STATUS)) <= 101


def test_it_stops_when_the_owner_hangs_and_goes_on_when_it_is_back(bench):
    story = bench("").at(1.0)
    story.owner_lives = False
    story.at(2.05).clear().at(5.0)
    assert story.messages(VEHICLE_STATUS) == []
    story.owner_lives = True
    assert len(story.at(6.0).messages(VEHICLE_STATUS)) >= 9


def test_values_grow_old_when_nothing_comes_any_more(bench):
    story = bench("")
    assert told(story, flying(), passed=0.7)["state"] == "IN_AIR"
    values = told(story, passed=0.3)
    assert values["state"] == ""
    assert math.isnan(values["height_of_home"])


def test_parachute_is_connected_while_it_is_heard(bench):
    story = bench("")
    assert not told(story)["is_parachute_connected"]
    assert told(story.status("READY"))["is_parachute_connected"]
    assert not told(story.after(4.0))["is_parachute_connected"]


def test_controller_sees_the_vehicle(bench):
    story = bench("controller").ready()
    assert story.controller.vehicle_connected
    assert "the controller does not receive our VehicleStatus" not in story.picture().faults
    story.loses = lambda from_link, data: from_link
    story.after(2.0)
    assert "the controller does not receive our VehicleStatus" in story.picture().faults


@pytest.fixture
def changed(tmp_path):
    """A bench with our types, in which old is replaced in VehicleStatus."""

    def make(*pairs):
        folder = tmp_path / "flyfire"
        folder.mkdir(exist_ok=True)
        for one in LAYOUTS["ours"].iterdir():
            text = one.read_text()
            for old, new in pairs if "VehicleStatus" in one.name else ():
                assert old in text
                text = text.replace(old, new)
            (folder / one.name).write_text(text)
        types = types_of(folder)
        return Bench(Layout("changed", types, Definitions(types)), "")

    return make


def test_types_that_cannot_say_not_known_say_nothing_until_it_is(changed):
    # Nothing is said while the only numbers mean something else.
    story = changed(("uint3 STATE_UNKNOWN = 0", ""), ("ON_GROUND = 1", "ON_GROUND = 0")).at(1.0)
    assert story.messages(VEHICLE_STATUS) == []
    (notice,) = [text for text in story.notices() if "is not sent: " in text]
    assert "has no STATE_UNKNOWN, and 0 means another state" in notice
    assert told(story, landed())["state"] == "ON_GROUND"
    # Types without a state still tell the rest.
    story = changed(("uint3 state ", "uint3 other_state ")).call("vehicle", flying())
    (values,) = story.step().messages(VEHICLE_STATUS)[-1:]
    assert "state" not in values
    assert values["height_of_home"] == 50.0


def test_nothing_is_said_while_a_whole_number_cannot_hold_what_is_not_known(changed):
    story = changed(("float16 vz", "int16 vz")).at(1.0)
    assert story.messages(VEHICLE_STATUS) == []
    assert len([text for text in story.notices() if "is not sent: " in text]) == 1
    assert told(story, flying(vertical_speed=-2))["vz"] == -2
