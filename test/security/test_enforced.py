"""A node that is told to enforce security never runs without it."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from chute_ros.links.registered import module_of

NODES = ("mavlink_parachute", "safety_supervisor")


def started(name, tmp_path, **environment):
    """The node as a process that must enforce; it ends by itself."""
    command = [sys.executable, "-m", module_of(name), "--ros-args"]
    command += ["--enclave", f"/{name}"]
    enforced = {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}
    environment = os.environ | enforced | {"ROS_HOME": str(tmp_path)} | environment
    return subprocess.run(
        command, capture_output=True, text=True, timeout=60.0, check=False, env=environment
    )


def keystore(tmp_path, *enclaves):
    for name in enclaves:
        (tmp_path / "keystore" / "enclaves" / name).mkdir(parents=True)
    return str(tmp_path / "keystore")


@pytest.mark.parametrize(
    ("name", "enclaves"),
    [
        pytest.param("mavlink_parachute", (), id="no keystore"),
        pytest.param("mavlink_parachute", ("console",), id="another's enclave"),
        pytest.param("mavlink_parachute", NODES, id="an enclave without keys"),
        pytest.param("safety_supervisor", NODES, id="the supervisor's without keys"),
    ],
)
def test_without_keys_or_a_middleware_that_knows_them_nothing_starts(
    ros, name, enclaves, tmp_path
):
    """Where the middleware is built without security, as the wheels of PyPI are, no keys help;
    where it is built with it, an enclave without keys does not."""
    done = started(name, tmp_path, ROS_SECURITY_KEYSTORE=keystore(tmp_path, *enclaves))
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    (line,) = [one for one in done.stderr.splitlines() if one.startswith(f"{name}: ")]
    assert "ROS_SECURITY_ENABLE is true: docs/guide/security.md" in line
    assert not list(tmp_path.rglob("*.mcap")), "nothing was begun"
