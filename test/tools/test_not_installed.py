"""Started where something is not installed, not built or not registered as it should be, a tool
says what to do, and nothing else."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from command_bench import tool
from test_not_built import MISSING

from chute_ros.not_installed import remedy

#: Those that need messages, or links; the others run without.
NEED_MESSAGES = [
    *("demo", "replay", "report", "test_card", "to_rosbag2", "sim", "judge_log", "chute"),
]
NEED_LINKS = ["campaign", "compare", "judge_log", "conformance"]


def told_by(name: str, first: Path) -> list[str]:
    """What it says on stderr; it ends with 2, or as chute tells that it can find nothing out."""
    path = os.pathsep.join([str(first), *filter(None, sys.path)])
    code, out, err = tool(name, "status" if name == "chute" else "mavlink", PYTHONPATH=path)
    assert (code, out) == (1 if name == "chute" else 2, ""), err
    return err.splitlines()


@pytest.mark.parametrize("name", NEED_MESSAGES)
def test_where_the_messages_are_not_built_it_says_how_to_build_them(
    name: str, tmp_path: Path
) -> None:
    (tmp_path / "sitecustomize.py").write_text(MISSING.format(name="chute_msgs"))
    first, *lines, last = told_by(name, tmp_path)
    assert first.endswith(
        "chute_msgs cannot be imported: build both packages and source the result:"
    )
    assert len(lines) == 3
    assert "chute_msgs" in last


@pytest.mark.parametrize("name", NEED_LINKS)
def test_a_link_whose_package_was_removed_is_named(name: str, tmp_path: Path) -> None:
    info = tmp_path / "gone-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: gone\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[chute_ros.links]\npyro = gone_package\n")
    (line,) = told_by(name, tmp_path)
    assert line.startswith(f"{name}: ")
    assert "pyro" in line


@pytest.mark.parametrize(
    ("error", "begins"),
    [
        (
            ModuleNotFoundError("No module named 'serial'", name="serial"),
            "serial is not installed",
        ),
        (ImportError("cannot import name 'Telem'", name="chute_msgs.msg"), "chute_msgs cannot be"),
        (ImportError("cannot import name 'x' from 'chute_ros'", name="chute_ros"), ""),
        (ModuleNotFoundError("No module named 'chute_ros.x'", name="chute_ros.x"), ""),
        (ImportError("cannot import name 'x' from 'rclpy'", name="rclpy"), ""),
    ],
)
def test_what_is_missing_is_told_and_a_mistake_of_ours_is_not_hidden(
    error: ImportError, begins: str
) -> None:
    told = remedy(error)
    assert told.startswith(begins)
    assert bool(told) is bool(begins)
