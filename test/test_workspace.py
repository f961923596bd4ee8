"""colcon finds both packages: at the root of a clone, and inside somebody's workspace."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
BOTH = ["chute_msgs", "chute_ros"]


def colcon_list(folder, *arguments):
    env = {key: value for key, value in os.environ.items() if not key.startswith("COLCON_")}
    listed = subprocess.run(
        ["colcon", "--log-base", "/dev/null", "list", "--names-only", *arguments],
        cwd=folder,
        env=env,
        check=True,
        capture_output=True,
        text=True,
    )
    return sorted(listed.stdout.split())


@pytest.fixture
def clone(tmp_path):
    """What colcon looks at, without what was built here."""
    folder = tmp_path / "workspace" / "src" / "chute_ros"
    folder.mkdir(parents=True)
    for name in ("package.xml", "setup.py", "setup.cfg", "colcon_defaults.yaml"):
        shutil.copy(ROOT / name, folder)
    (folder / "msg_defs").mkdir()
    for name in ("package.xml", "CMakeLists.txt"):
        shutil.copy(ROOT / "msg_defs" / name, folder / "msg_defs")
    return folder


def test_at_the_root_without_any_argument():
    assert colcon_list(ROOT) == BOTH


def test_in_a_workspace_with_both_paths_named(clone):
    workspace = clone.parents[1]
    assert colcon_list(workspace, "--base-paths", "src", "src/chute_ros/msg_defs") == BOTH


def test_in_a_workspace_with_a_link_beside_it(clone):
    (clone.parent / "chute_msgs").symlink_to(clone / "msg_defs")
    assert colcon_list(clone.parents[1]) == BOTH


def test_environments_and_results_are_not_taken_for_packages(clone):
    # A second copy of a name would stop colcon with an error.
    for name in (".venv-jazzy", "build-jazzy", "install-jazzy"):
        shutil.copytree(clone / "msg_defs", clone / name / "chute_msgs")
    assert colcon_list(clone) == BOTH
