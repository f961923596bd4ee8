"""Profiles by name and by path; what is wrong with one is said at the start."""

import pytest
from supervisor_bench import QUICK

from chute_ros.errors import ParameterError, ProfileError
from chute_ros.ros.profile_files import load_profile
from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode
from chute_ros.ros.supervisor_parameters import PARAMETERS, config_from

LINKS = ("mavlink_parachute",)
SHIPPED = ("by_hand", "fixed_wing", "multirotor", "rocket")


@pytest.mark.parametrize("name", SHIPPED)
def test_each_shipped_profile_is_there_by_its_name(name):
    profile = load_profile(name, LINKS)
    assert profile.name == name
    assert all(rule.says and rule.source for rule in profile.rules)


def test_by_hand_deploys_nothing_by_itself():
    assert all(rule.action.name != "DEPLOY" for rule in load_profile("by_hand", LINKS).rules)


def test_a_name_that_is_none_says_which_there_are():
    with pytest.raises(ParameterError, match="need one of by_hand, fixed_wing, multirotor"):
        load_profile("helicopter", LINKS)


def test_an_empty_name_is_said_to_be_empty():
    with pytest.raises(ParameterError, match=r"^parameter profile is empty: need one of by_hand"):
        load_profile("", LINKS)


def test_a_mistake_in_a_file_stops_the_start_with_its_line(bench, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("profile: mine\nrules:\n  tilts:\n    action: FIRE\n")
    with pytest.raises(ProfileError, match="line 4: action of rule 'tilts' is 'FIRE'"):
        bench.add(SafetySupervisorNode, **(QUICK | {"profile": str(file)}))


def values(**given: object) -> dict[str, object]:
    return {parameter.name: parameter.default for parameter in PARAMETERS} | given


def test_a_rule_that_can_never_be_fulfilled_is_named():
    sources = ["vehicle/state", "imu"]
    assert config_from(values()).blind_rules == ("autopilot lost and falling",)
    assert config_from(values(vehicle_sources=sources)).blind_rules == ()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            {"deploy_ladder": ["upf_can"]},
            "deploy_ladder names upf_can: need a link of",
        ),
        ({"deploy_ladder": [":x"]}, "deploy_ladder has ':x': need LINK or LINK:DEVICE"),
        ({"link_limits": ["gps stale_after=1"]}, "link_limits names 'gps': need one of mavlink"),
        ({"link_limits": ["mavlink_parachute stale=1"]}, "has 'stale=1' for mavlink_parachute"),
        ({"link_limits": ["mavlink_parachute stale_after=x"]}, "need NAME=SECONDS"),
        (
            {"link_limits": ["mavlink_parachute stale_after=9"]},
            "for mavlink_parachute: stale_after is 9.0 and lost_after is 1.0: a link",
        ),
    ],
)
def test_a_wrong_parameter_names_itself_and_the_fix(given, words):
    with pytest.raises(ParameterError, match=words):
        config_from(values(**given))


def test_single_links_have_limits_of_their_own():
    config = config_from(values(link_limits=["mavlink_parachute lost_after=3 startup_grace=20"]))
    assert config.limits("mavlink_parachute").lost_after == 3.0
    assert config.limits("mavlink_parachute").stale_after == 0.5
    assert config.limits("mavlink_parachute").startup_grace == 20.0
