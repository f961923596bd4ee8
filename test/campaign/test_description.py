"""The description of a vehicle: what it says is taken, and each mistake is said with its line."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import pytest
from campaign_bench import FOLDER

from chute_ros.campaign.described import DescribedVehicle, OwnShipped, Range
from chute_ros.campaign.description import NUMBERS, parachutes, read_description
from chute_ros.errors import ProfileError

EXAMPLES = FOLDER.parent / "vehicles"
GOOD = """\
vehicle: a drone
kind: multirotor
mass: 6.0
drag_area: [0.1, 0.2]
descent_rate: 5.0
opening_time: 1.2
heights: [40.0, 60.0]
"""


def described(folder: Path, text: str) -> DescribedVehicle:
    """The vehicle in a file with this text."""
    file = folder / "drone.yaml"
    file.write_text(text)
    return read_description(file, FOLDER)


def test_the_least_that_must_be_said_is_enough(tmp_path: Path) -> None:
    one = described(tmp_path, GOOD)
    assert (one.name, one.kind, one.profile) == ("a drone", "multirotor", "multirotor")
    assert one.opening_time == Range(1.2, 1.2)
    assert one.soft_landing == 6.25, "the sink under the canopy and a quarter"
    assert one.fall_speed.least == pytest.approx(21.9, abs=0.1)
    assert one.fall_speed.most == pytest.approx(31.0, abs=0.1)
    assert one.energy(5.0) == 75.0


@pytest.mark.parametrize("name", ["example_multirotor", "example_aeroplane"])
def test_the_shipped_examples_are_right(name: str) -> None:
    one = read_description(EXAMPLES / f"{name}.yaml", FOLDER)
    assert one.parachute in parachutes()


def test_an_own_profile_is_read_from_beside_the_description(tmp_path: Path) -> None:
    shipped = (FOLDER / "multirotor.yaml").read_text()
    own = shipped.replace("minimum_height: 10.0", "minimum_height: 17.0")
    (tmp_path / "mine.yaml").write_text(own)
    one = described(tmp_path, GOOD + "profile: mine.yaml\n")
    config = OwnShipped(FOLDER, one.profile).config("mavlink", "multirotor", False, 0)
    assert config.profile.minimum_height == 17.0


@pytest.mark.parametrize(
    ("line", "instead", "words"),
    [
        ("mass: 6.0", "mass: -6.0", "line 3: mass (kg) is -6.0: need 0.1 to 1000"),
        ("mass: 6.0", "mass: heavy", "line 3: mass (kg) is 'heavy': need a number"),
        ("mass: 6.0", "mass: 1_000", "line 3: mass (kg) is 1_000, which YAML reads as 1000"),
        ("mass: 6.0", "mass: .nan", "line 3: mass (kg) is nan: need 0.1 to 1000"),
        ("mass: 6.0", "", "line 1: mass is missing: need 0.1 to 1000 kg"),
        ("mass: 6.0", "mas: 6.0", "a description of a vehicle has no 'mas': did you mean mass?"),
        ("mass: 6.0", "mass: 6.0\nmass: 7.0", "line 4: 'mass' is there twice: remove one"),
        ("1.2", "[1.4, 0.9]", "line 6: opening_time (s) is [1.4, 0.9]: need one number, or"),
        ("1.2", "[1, 2, 3]", "line 6: opening_time (s) is [1, 2, 3]: need one number, or"),
        ("1.2", "[]", "line 6: opening_time (s) is empty: need at least one"),
        ("1.2", "0.0", "line 6: opening_time (s) is 0.0: need 0.05 to 10"),
        ("kind: multirotor", "kind: rocket", "line 2: kind is 'rocket': need multirotor or"),
        ("heights:", "soft_landing: 5.1\nheights:", "line 7: soft_landing is 5.1 m/s: a canopy"),
        ("[0.1, 0.2]", "50.0", "line 4: a mass of 6 kg and a drag_area of 50 m^2 fall with 1."),
        ("heights:", "self_release: true\nheights:", "line 7: self_release is true: the"),
        ("heights:", "self_release: yes\nheights:", "line 7: self_release is yes, which YAML"),
        ("heights:", "autopilot: arduplane\nheights:", "autopilot is 'arduplane': need px4 or"),
        ("heights:", "parachute: umbilical\nheights:", "parachute is 'umbilical': need "),
        ("heights:", "vehicle_sources: [imu]\nheights:", "vehicle_sources is imu: need vehicle/"),
        ("heights:", "sinks: {dive: 9}\nheights:", "sinks has no 'dive': it may have partial"),
        ("heights:", "profile: mine\nheights:", "line 7: profile is 'mine': need by_hand or"),
        ("heights:", "profile: no.yaml\nheights:", "profile is 'no.yaml': no file "),
        ("vehicle: a drone", "[", "not YAML: "),
    ],
)
def test_what_cannot_be_is_said_with_its_line_and_what_can(
    line: str, instead: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(ProfileError, match=re.escape(words)) as refused:
        described(tmp_path, GOOD.replace(line, instead))
    assert str(refused.value).startswith(f"{tmp_path}/drone.yaml, line ")


def test_all_mistakes_are_said_at_once(tmp_path: Path) -> None:
    with pytest.raises(ProfileError) as refused:
        described(tmp_path, GOOD.replace("6.0", "0.0").replace("1.2", "99"))
    assert len(str(refused.value).splitlines()) == 2


def test_a_file_that_is_none_is_said(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match=r"nowhere\.yaml: No such file or directory"):
        read_description(tmp_path / "nowhere.yaml", FOLDER)


def test_no_field_of_the_description_is_left_out() -> None:
    """Each number is a field of the vehicle, by the same name."""
    assert {*NUMBERS} <= {one.name for one in fields(DescribedVehicle)}
