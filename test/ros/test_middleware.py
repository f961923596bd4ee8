"""What is shipped for the middleware: both files, and whose settings count."""

import os
import subprocess
import sys
from xml.etree import ElementTree

import pytest

from chute_ros.ros.config_folder import config_folder
from chute_ros.ros.middleware import set_up_middleware

NAMES = {
    "FASTRTPS_DEFAULT_PROFILES_FILE": "fastrtps.xml",
    "FASTDDS_DEFAULT_PROFILES_FILE": "fastdds.xml",
}


FILES = [f"{stem}{end}.xml" for stem in ("fastrtps", "fastdds") for end in ("", "_localhost")]
RANGE, OLD_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_LOCALHOST_ONLY"


@pytest.fixture(autouse=True)
def nothing_set(monkeypatch):
    others = ("FASTDDS_BUILTIN_TRANSPORTS", RANGE, OLD_RANGE, "ROS_STATIC_PEERS")
    for name in (*NAMES, *others, "RMW_IMPLEMENTATION"):
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
    assert "FASTDDS_BUILTIN_TRANSPORTS" not in os.environ, "nor anything beside them"
    assert len([one for one in NAMES if one in os.environ]) == 1


def test_transports_of_the_user_are_left_alone(monkeypatch):
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "DEFAULT")
    set_up_middleware()
    assert os.environ["FASTDDS_BUILTIN_TRANSPORTS"] == "DEFAULT"


@pytest.mark.parametrize("given", [{RANGE: "LOCALHOST"}, {OLD_RANGE: "1"}])
def test_who_keeps_to_this_host_does_so_by_our_file(given, monkeypatch):
    """ROS's own LOCALHOST brings shared memory."""
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    set_up_middleware()
    file = os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"]
    assert file == str(config_folder() / "fastrtps_localhost.xml")
    assert (os.environ[RANGE], OLD_RANGE in os.environ) == ("SUBNET", False)
    set_up_middleware()
    assert os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] == file, "a child keeps to it"


@pytest.mark.parametrize(
    "besides",
    [
        {"ROS_STATIC_PEERS": "192.0.2.1"},
        {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"},
        {"FASTRTPS_DEFAULT_PROFILES_FILE": "/etc/mine.xml"},
    ],
)
def test_localhost_is_left_to_ros_where_ours_would_not_do_as_it_says(besides, monkeypatch):
    for name, value in {RANGE: "LOCALHOST", **besides}.items():
        monkeypatch.setenv(name, value)
    set_up_middleware()
    assert os.environ[RANGE] == "LOCALHOST"


@pytest.mark.parametrize("given", ["LOCALHOST", "SUBNET", ""])
def test_no_process_of_ours_shares_memory_(given, monkeypatch):
    if given:
        monkeypatch.setenv(RANGE, given)
    set_up_middleware()
    code = (
        "import os, rclpy; rclpy.init(); n = rclpy.create_node('x'); n.create_publisher("
        "__import__('std_msgs.msg').msg.String, 'x', 1)\n"
        "for t in os.listdir('/proc/self/task'): print(open(f'/proc/self/task/{t}/comm').read())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    threads = done.stdout.split()
    assert [one for one in threads if one.startswith("dds.udp.")]
    assert not [one for one in threads if one.startswith("dds.shm")]


@pytest.mark.parametrize("stem", ["fastrtps", "fastdds"])
def test_the_files_differ_in_nothing_but_the_transport(stem):
    plain, localhost = (
        ElementTree.parse(config_folder() / f"{stem}{end}.xml").getroot()
        for end in ("", "_localhost")
    )
    (profiles,) = localhost
    own = [e for e in profiles if e.tag.endswith(("transport_descriptors", "participant"))]
    assert len(own) == 2
    for one in own:
        profiles.remove(one)
    written = [ElementTree.tostring(one).split() for one in (plain, localhost)]
    assert written[0] == written[1]
    addresses = [e.text for one in own for e in one.iter() if e.tag.endswith("address")]
    assert set(addresses) == {"127.0.0.1"}


@pytest.mark.parametrize("file", FILES)
def test_what_was_lost_is_asked_for_within_20_ms_but_the_graph(file):
    """The graph goes from every node to every other: at 20 ms it filled the network of a fleet."""
    writers = [
        one
        for one in ElementTree.parse(config_folder() / file).iter()
        if one.tag.endswith("data_writer")
    ]
    periods = {
        one.get("profile_name"): [int(part.text) for part in period]
        for one in writers
        for period in one.iter()
        if period.tag.split("}")[-1].lower().replace("_", "") == "heartbeatperiod"
    }
    assert periods == {"chute_ros": [0, 20_000_000], "ros_discovery_info": [0, 500_000_000]}


@pytest.mark.parametrize("given", ["LOCALHOST", "SUBNET"])
def test_the_middleware_understands_its_file(given, monkeypatch):
    """It complains about what it does not know."""
    monkeypatch.setenv(RANGE, given)
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
