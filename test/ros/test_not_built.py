"""Started where chute_msgs was not built, a node says what to do, and nothing else."""

import os
import subprocess
import sys

import pytest

from chute_ros.links.registered import module_of

BUILD = [
    "chute_msgs cannot be imported: build both packages and source the result:",
    "  colcon build --base-paths src src/chute_ros/msg_defs   (in your workspace)",
    "  colcon build                                           (in the repository's root)",
    "  source install/setup.bash",
]
MISSING = """
import sys


class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == {name!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)


sys.meta_path.insert(0, Missing())
"""


def start_without(package, node, folder):
    (folder / "sitecustomize.py").write_text(MISSING.format(name=package))
    path = os.pathsep.join([str(folder), *filter(None, sys.path)])
    done = subprocess.run(
        [sys.executable, "-m", module_of(node)],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=30.0,
        check=False,
    )
    assert done.returncode != 0
    assert done.stdout == ""
    return done.stderr.splitlines()


NODES = pytest.mark.parametrize("node", ["mavlink_parachute", "safety_supervisor"])


@NODES
def test_it_says_exactly_how_to_build(node, tmp_path):
    lines = start_without("chute_msgs", node, tmp_path)
    assert lines[:4] == BUILD
    assert len(lines) == 5
    assert lines[4].startswith("(")
    assert "chute_msgs" in lines[4]


@NODES
@pytest.mark.parametrize("package", ["rclpy", "diagnostic_msgs"])
def test_another_missing_package_is_named_with_its_remedy(node, package, tmp_path):
    (line,) = start_without(package, node, tmp_path)
    assert line.startswith(f"{package} is not installed: ")
    assert "rosdep install --from-paths src src/chute_ros/msg_defs --ignore-src" in line
    assert "pip install -r requirements/runtime.in" in line
