"""What is shipped for the middleware: both files, and whose settings count."""

import os
import subprocess
import sys
from xml.etree import ElementTree

import pytest

from chute_ros.nodes.config_folder import config_folder
from chute_ros.nodes.middleware import set_up_middleware

NAMES = {
    "FASTRTPS_DEFAULT_PROFILES_FILE": "fastrtps.xml",
    "FASTDDS_DEFAULT_PROFILES_FILE": "fastdds.xml",
}


@pytest.fixture(autouse=True)
def nothing_set(monkeypatch):
    for name in NAMES:
        monkeypatch.setenv(name, "")  # so that it is put back afterwards
        del os.environ[name]


@pytest.mark.parametrize(
    ("distribution", "name"),
    [
        ("jazzy", "FASTRTPS_DEFAULT_PROFILES_FILE"),
        ("kilted", "FASTDDS_DEFAULT_PROFILES_FILE"),
        ("", "FASTDDS_DEFAULT_PROFILES_FILE"),
    ],
)
def test_without_settings_of_the_user_ours_are_used(distribution, name, monkeypatch):
    monkeypatch.setenv("ROS_DISTRO", distribution)
    set_up_middleware()
    assert os.environ[name] == str(config_folder() / NAMES[name])
    assert len([one for one in NAMES if one in os.environ]) == 1, "3 would read the other as well"


@pytest.mark.parametrize("name", NAMES)
def test_settings_of_the_user_are_left_alone(name, monkeypatch):
    monkeypatch.setenv(name, "/etc/mine.xml")
    set_up_middleware()
    assert os.environ[name] == "/etc/mine.xml"
    assert len([one for one in NAMES if one in os.environ]) == 1


@pytest.mark.parametrize("file", NAMES.values())
def test_what_was_lost_is_asked_for_within_20_ms(file):
    tree = ElementTree.parse(config_folder() / file)
    periods = [
        e
        for e in tree.iter()
        if e.tag.split("}")[-1].lower().replace("_", "") == "heartbeatperiod"
    ]
    (period,) = periods
    assert [int(part.text) for part in period] == [0, 20_000_000]


def test_the_middleware_understands_its_file():
    """It complains about what it does not know."""
    set_up_middleware()
    code = "import rclpy; rclpy.init(); n = rclpy.create_node('x'); n.destroy_node()"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    spoilt = config_folder() / "mavlink_vehicle.yaml"
    (name,) = [one for one in NAMES if one in os.environ]
    environment = os.environ | {name: str(spoilt)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment
    )
    assert str(spoilt) in done.stdout + done.stderr, "this test sees complaints"
