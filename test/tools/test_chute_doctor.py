"""What goes wrong in the field is found, each with its remedy."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from heard_vehicle import Heard, heartbeat, stamped

from chute_ros.ros.middleware import RANGE
from chute_ros.tools.chute import doctor_computer as computer
from chute_ros.tools.chute import doctor_ports as ports
from chute_ros.tools.chute.diagnostic_tasks import Task
from chute_ros.tools.chute.doctor_vehicle import (
    clock_findings,
    namesake_findings,
    supervisor_findings,
    task_findings,
    version_findings,
)
from chute_ros.tools.chute.finding import (
    NOTE,
    OK,
    WRONG,
    DoctorFinding,
    finding_lines,
    worst_first,
)
from chute_ros.tools.chute.surroundings import surroundings

INSTALLED = ("rmw_fastrtps_cpp", "rmw_x")
ONLY_HERE = "ROS domain 0, discovery range LOCALHOST (ROS_LOCALHOST_ONLY)"


def task(level="ERROR", name="drone1/upf_can: link", message="no such port"):
    return Task(name, level, message, {}, 0.1)


def test_the_worst_comes_first_each_on_one_line_with_its_remedy():
    findings = [
        DoctorFinding(OK, "disk"),
        DoctorFinding(NOTE, "domain", "use 0"),
        DoctorFinding(WRONG, "port", "x"),
    ]
    assert finding_lines(worst_first(findings)) == [
        "WRONG  port -> x",
        "NOTE   domain -> use 0",
        "OK     disk",
    ]


# Environment and computer


@pytest.mark.parametrize(
    ("environment", "text"),
    [
        ({}, "ROS domain 0, discovery range SUBNET (the default), rmw_fastrtps_cpp"),
        (
            {"ROS_DOMAIN_ID": "7", RANGE: "LOCALHOST"},
            "ROS domain 7, discovery range LOCALHOST, rmw_fastrtps_cpp",
        ),
        (
            {"ROS_LOCALHOST_ONLY": "1", "ROS_STATIC_PEERS": "hub"},
            f"{ONLY_HERE}, rmw_fastrtps_cpp, ROS_STATIC_PEERS=hub",
        ),
    ],
)
def test_the_environment_is_told_as_the_user_set_it(environment, text):
    around = surroundings(environment, INSTALLED)
    assert around.text() == text
    assert computer.environment_findings(around) == [DoctorFinding(OK, f"environment: {text}")]


@pytest.mark.parametrize(
    ("environment", "levels", "told"),
    [
        ({"ROS_DOMAIN_ID": "300"}, [WRONG], "ROS_DOMAIN_ID is '300': need a whole number from 0"),
        ({"ROS_DOMAIN_ID": "999999999999"}, [WRONG], "ROS_DOMAIN_ID is '999999999999': need"),
        ({"ROS_DOMAIN_ID": "one"}, [WRONG], "ROS_DOMAIN_ID is 'one'"),
        ({"ROS_DOMAIN_ID": "-1"}, [WRONG], "ROS_DOMAIN_ID is '-1'"),
        ({RANGE: "FOO"}, [WRONG], f"{RANGE} is 'FOO': need OFF, LOCALHOST, SUBNET or SYSTEM_D"),
        ({RANGE: "LOCALHOST "}, [WRONG], f"{RANGE} is 'LOCALHOST '"),
        ({"RMW_IMPLEMENTATION": "rmw_y"}, [WRONG], "installed: rmw_fastrtps_cpp, rmw_x"),
        ({"ROS_DOMAIN_ID": "150"}, [OK, NOTE], "may be taken by other programs"),
        ({"RMW_IMPLEMENTATION": "rmw_x"}, [OK, NOTE], "RMW_IMPLEMENTATION is rmw_x"),
    ],
)
def test_what_is_odd_in_the_environment(environment, levels, told):
    found = computer.environment_findings(surroundings(environment, INSTALLED))
    assert [one.level for one in found] == levels
    assert told in found[-1].what
    assert found[-1].remedy


def test_shared_memory_that_is_missing_full_or_locked(tmp_path, monkeypatch):
    assert computer.shared_memory_finding(tmp_path).level == OK
    missing = computer.shared_memory_finding(tmp_path / "shm")
    assert (missing.level, missing.what) == (
        WRONG,
        f"shared memory: {tmp_path}/shm is no folder",
    )
    assert "--ipc=host" in missing.remedy
    monkeypatch.setattr(computer, "LEAST_SHARED", 10**18)
    assert computer.shared_memory_finding(tmp_path).what.endswith("need 1e+09 GB")
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert "may not be written" in computer.shared_memory_finding(tmp_path).what


def test_a_disk_without_room_for_the_black_box(tmp_path, monkeypatch):
    folder = tmp_path / "not" / "made" / "yet"
    assert computer.disk_finding(folder).what.endswith(f"GB free in {tmp_path}")
    monkeypatch.setattr(computer, "LEAST_DISK", 10**18)
    full = computer.disk_finding(folder)
    assert (full.level, "black_box_folder" in full.remedy) == (WRONG, True)
    (tmp_path / "file").write_text("in its place")
    assert computer.disk_finding(tmp_path / "file").level == WRONG


def test_the_versions_of_a_report_of_a_fault():
    around = surroundings({"ROS_DISTRO": "jazzy"}, INSTALLED)
    versions = computer.versions(around, (2, 14, 5))
    found = computer.version_finding(versions)
    assert found.what.startswith("versions: chute_ros ")
    assert "ROS jazzy, Python 3." in found.what
    assert found.what.endswith(", Fast DDS 2.14.5")
    assert [name for name, one in versions.items() if one is None] == []


def test_a_version_that_is_not_known_is_left_out(monkeypatch):
    monkeypatch.setattr(computer, "_PACKAGES", ("no-such-package",))
    versions = computer.versions(surroundings({}, INSTALLED), None)
    assert [name for name, one in versions.items() if one is None] == [
        "ROS",
        "Fast DDS",
        "no-such-package",
    ]
    told = computer.version_finding(versions).what
    assert told.startswith("versions: chute_ros ")
    assert ", Python 3." in told
    assert "None" not in told


# Ports and buses


@pytest.mark.parametrize(
    ("connection", "told"),
    [
        ("serial:/dev/nothing:57600", "/dev/nothing: no such port, is it plugged in?"),
        ("serial:/dev/nothing:fast", "baud rate 'fast'"),
        ("usb:ffff:fffe", "no such USB device is plugged in"),
        ("usb:x", "USB ids are hexadecimal"),
        ("slcan:/dev/nothing@115200", "/dev/nothing: no such port"),
        ("socketcan:can77", "there is no CAN interface can77"),
        ("udpin:0.0.0.0:14550", ""),
        ("mcast:0", ""),
        ("", ""),
    ],
)
def test_the_port_of_a_connection_is_looked_at_here(connection, told):
    trouble = ports.trouble_here(connection)
    assert (told in trouble, bool(trouble)) == (True, bool(told))


@pytest.mark.parametrize(
    ("flags", "told"), [("0x1002", "is down: sudo ip link set"), ("0x41", "")]
)
def test_a_bus_is_up_or_down(tmp_path, monkeypatch, flags, told):
    (tmp_path / "can0").mkdir()
    (tmp_path / "can0" / "flags").write_text(f"{flags}\n")
    monkeypatch.setattr(ports, "_NETWORKS", tmp_path)
    trouble = ports.trouble_here("socketcan:can0")
    assert (told in trouble, bool(trouble)) == (True, bool(told))


def test_a_port_that_this_user_may_not_open(tmp_path, monkeypatch):
    for name in ("ttyUSB0", "ttyACM3", "tty7"):
        (tmp_path / name).touch()
    assert ports.port_findings(tmp_path) == []
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    found = ports.port_findings(tmp_path)
    assert [Path(one.what.split()[-1]).name for one in found] == ["ttyACM3", "ttyUSB0"]
    assert all("add yourself to the group of the port" in one.remedy for one in found)


def test_what_a_node_says_of_its_wire_counts_wherever_it_runs():
    found = ports.connection_finding("upf_can", "socketcan:can0", task("OK"), lambda _: "missing")
    assert found.level == OK
    found = ports.connection_finding("upf_can", "socketcan:can0", task("ERROR"), lambda _: "none")
    assert found == DoctorFinding(
        WRONG,
        "connection socketcan:can0 of upf_can: no such port",
        "here: none; if upf_can runs on another computer, look there",
    )
    found = ports.connection_finding("upf_can", "socketcan:can0", None, lambda _: "none")
    assert (found.level, "none" in found.what) == (WRONG, True)
    assert ports.connection_finding("upf_can", "mcast:0", None, lambda _: "").level == OK


# The vehicle


@pytest.fixture
def heard():
    return Heard()


def beat(heard, name, leads, clock=0.0):
    message = heartbeat(name, supervisor=True, device_healthy=leads)
    heard.hears(stamped(message, clock=clock))


@pytest.mark.parametrize(
    ("leads", "level", "what"),
    [
        ({"a": True}, OK, "supervisor of /drone1: a"),
        ({"a": False, "b": True}, OK, "supervisor of /drone1: b, standby: a"),
        ({"a": True, "b": True}, WRONG, "2 supervisors lead in /drone1: a, b"),
        ({"a": False}, WRONG, "no supervisor leads in /drone1, standby: a"),
        ({}, WRONG, "no supervisor leads in /drone1"),
    ],
)
def test_one_supervisor_leads(heard, leads, level, what):
    heard.hears(stamped(heartbeat(device_healthy=True)))
    for name, one in leads.items():
        beat(heard, name, one)
    (found,) = supervisor_findings(heard.picture, "/drone1")
    assert (found.level, found.what, bool(found.remedy)) == (level, what, level != OK)


def test_two_nodes_of_one_name():
    nodes = [("upf_can", "/drone1")] * 2 + [("upf_can", "/drone2"), ("relay", "/drone1")]
    (found,) = namesake_findings(nodes, "/drone1")
    assert (found.level, found.what) == (WRONG, "2 nodes are called /drone1/upf_can")
    assert namesake_findings(nodes, "/drone2") == []


@pytest.mark.parametrize(
    ("supervisor", "device", "level", "what"),
    [
        (0.0, 0.1, OK, "clocks: 0.10 s apart in the vehicle"),
        (0.0, 0.5, WRONG, "clocks: that of upf_can is 0.50 s ahead of that of a"),
        (60.0, 60.0, NOTE, "clocks: those of the vehicle are +60.0 s to that of this computer"),
        (-60.0, -60.0, NOTE, "clocks: those of the vehicle are -60.0 s to that of this computer"),
    ],
)
def test_clocks_that_differ(heard, supervisor, device, level, what):
    beat(heard, "a", True, clock=supervisor)
    heard.hears(stamped(heartbeat("upf_can"), clock=device))
    (found,) = clock_findings(heard.picture)
    assert (found.level, found.what) == (level, what)


def test_without_heartbeats_nothing_is_said_of_clocks(heard):
    assert clock_findings(heard.picture) == []


DIFFER = "versions of chute_ros differ: 0.2.0 of a, upf_can; 0.1.0 of relay"
SILENT = "no version of chute_ros is received of relay"
OTHER = "the vehicle has chute_ros 0.1.0 of a, relay; this command is of 0.2.0"


@pytest.mark.parametrize(
    ("versions", "found"),
    [
        ({"upf_can": "0.2.0", "a": "0.2.0"}, []),
        ({"upf_can": "0.2.0", "relay": "0.1.0", "a": "0.2.0"}, [(WRONG, DIFFER)]),
        ({"relay": "", "a": "0.2.0"}, [(NOTE, SILENT)]),
        ({"relay": "0.1.0", "a": "0.1.0"}, [(NOTE, OTHER)]),
    ],
    ids=["of one version", "of different ones", "without one", "of another than this command"],
)
def test_the_versions_of_nodes_are_compared(heard, versions, found):
    """Given nodes that report these versions (an empty one is not reported), and a foreign one."""
    for node in versions:
        heard.hears(stamped(heartbeat(node)))
    tasks = [
        Task(f"drone1/{node}: middleware", "OK", "", {"chute_ros": one} if one else {}, 0.1)
        for node, one in {"mavros": "9", **versions}.items()
    ]
    told = version_findings(heard.picture, tasks, "0.2.0")
    assert [(one.level, one.what) for one in told] == found


def test_what_nodes_report_themselves():
    tasks = [task(), task("STALE", "a: parachute", "never received"), task("WARN", "a: b", "c")]
    found = task_findings([*tasks, task("OK")])
    assert [(one.level, one.what) for one in found] == [
        (WRONG, "upf_can reports ERROR: link: no such port"),
        (WRONG, "a reports STALE: parachute: never received"),
        (NOTE, "a reports WARN: b: c"),
    ]
    assert task_findings([task("OK")])[0].level == OK
    many = task_findings([task()] * 30)
    assert (len(many), many[-1].what) == (11, "20 more")
