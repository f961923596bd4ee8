"""The key of signing is shown nowhere: not in what a node says, not in what it writes."""

from __future__ import annotations

import base64
import os
import subprocess
import sys

import pytest
from chute_msgs.srv import Deploy, SetTriggers
from mavlink_attack import CHUTE, KEY, Attacked, deployed, forgers
from mcap.reader import make_reader
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.qos import QoSProfile

from chute_ros.ros.safety_supervisor_node import SafetySupervisorNode

#: One digit short, and in a file that others may read.
TEXTS = {"digits": KEY.hex()[:-1].encode(), "raw": KEY}


def forms(key):
    """How it could be shown: whole, or half of it."""
    found = []
    for part in (key, key[:16], key[16:]):
        found += [part, part.hex().encode(), part.hex().upper().encode(), part.hex(" ").encode()]
        found += [base64.b64encode(part)[:20], repr(part)[2:-1].encode()]
        found += [str(list(part))[1:-1].encode()]
    return found


def shown(data):
    return [form for form in forms(KEY) if form in data]


def contents(folder):
    """Every byte of every file, those of a black box unpacked."""
    parts = []
    for path in (one for one in folder.rglob("*") if one.is_file()):
        parts.append(path.read_bytes())
        if path.suffix == ".mcap":
            with path.open("rb") as file:
                parts += [message.data for _, _, message in make_reader(file).iter_messages()]
    return b"\n".join(parts)


def test_the_search_would_find_it():
    for told in (KEY.hex(), str(KEY), KEY.hex().upper(), str(list(KEY))):
        assert shown(f"key {told}!".encode())
    assert shown(base64.b64encode(KEY))
    assert not shown(b"no key")


def test_the_key_is_in_no_log_no_diagnostics_no_parameter_and_no_file(bench, monkeypatch, capfd):
    home = bench.folder / "ros_home"
    monkeypatch.setenv("ROS_HOME", str(home))
    log = bench.follow(Log, "/rosout", QoSProfile(depth=1000))
    attacked = Attacked(bench)
    supervisor = bench.add(SafetySupervisorNode, profile="by_hand")
    attacked.plug_devices()
    bench.until(attacked.link.has_parachute, "the module is heard")
    for signer in forgers().values():
        attacked.send(*deployed(CHUTE, signer))
    bench.call(Deploy, "mavlink_parachute/deploy", reason="not armed, so refused")
    bench.call(SetTriggers, "mavlink_parachute/set_triggers", arm=9999, select=0)
    bench.until(lambda: attacked.task("signing"), "diagnostics come")
    names = bench.call(ListParameters, "mavlink_parachute/list_parameters").result.names
    values = bench.call(GetParameters, "mavlink_parachute/get_parameters", names=names).values
    times = attacked.network.node._signing._file.path
    bench.until(times.exists, "the times are written")
    bench.remove(supervisor)
    out, err = capfd.readouterr()
    said = "\n".join([out, err, *map(str, (*log, *attacked.diagnostics, *values))])
    written = contents(home)
    assert str(attacked.key_file) in said, "where it is may be known"
    assert b"safety/heartbeat" in written, "the black box is among them"
    assert b"newest" in written, "so are the times"
    assert shown(said.encode("utf-8", "surrogateescape")) == []
    assert shown(written) == []


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_a_node_that_cannot_use_its_key_does_not_show_it(tmp_path, text):
    key = tmp_path / "signing.key"
    key.write_bytes(text)
    key.chmod(0o644 if text == KEY else 0o600)
    command = [sys.executable, "-m", "chute_ros.links.mavlink", "--ros-args"]
    command += ["--log-level", "debug", "-p", f"signing_key_file:={key}"]
    home = tmp_path / "home"
    environment = os.environ | {"ROS_HOME": str(home), "ROS_LOG_DIR": str(home / "log")}
    done = subprocess.run(command, capture_output=True, timeout=60.0, check=False, env=environment)
    assert done.returncode == 2, done.stderr
    assert str(key).encode() in done.stderr
    assert shown(done.stdout + done.stderr + contents(home)) == []
