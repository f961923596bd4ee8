"""Mutation testing of chute_ros/supervisor: changes it a little, many times, and runs its tests.

A mutant that no test notices is a survivor. Each must be explained in docs/mutation.md by its
changed line; one that is not, or one in gate.py or machine.py that is not equivalent, fails the
run. Works in a copy of the tree. Needs mutmut (requirements/dev.in) and takes an hour or more.

    python3 scripts/mutate.py [MODULE...] [--children N] [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import collections
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "mutation.md"
MODULES = (
    "gate",
    "machine",
    "counter",
    "lease",
    "conditions",
    "flight",
    "policy",
    "orders",
    "deploying",
)
#: The random ones find the same, and take longer than all others together.
SLOW = ("test_properties.py", "test_properties_loop.py", "test_properties_time.py",
        "test_properties_rules.py")
_SETTINGS = """\
[mutmut]
source_paths=chute_ros
only_mutate=
    {modules}
pytest_add_cli_args_test_selection=test/supervisor
pytest_add_cli_args=
    -p
    no:cacheprovider
    {ignored}
also_copy=
    config
    scripts
"""


def copy_tree(folder: pathlib.Path, modules: list[str]) -> None:
    """The part of the repository that the tests of the supervisor need."""
    for name in ("chute_ros", "config", "scripts", "test/supervisor"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("test/conftest.py", "pyproject.toml"):
        shutil.copy(ROOT / name, folder / name)
    settings = _SETTINGS.format(
        modules="\n    ".join(f"chute_ros/supervisor/{module}.py" for module in modules),
        ignored="\n    ".join(f"--ignore=test/supervisor/{name}" for name in SLOW),
    )
    (folder / "setup.cfg").write_text(settings)
