"""Processes on a machine without ROS, and without other modules."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path

#: Makes their import fail.
_PROGRAM = """
import sys
from fnmatch import fnmatchcase

NAMES = {names!r}


class Missing:
    def find_spec(self, name, path=None, target=None):
        for one in NAMES:
            if fnmatchcase(name, one) or fnmatchcase(name, one + ".*"):
                raise ImportError(f"no ROS here: {{name}}")


sys.meta_path.insert(0, Missing())
"""


def environment_without(names: Iterable[str], folder: Path) -> dict[str, str]:
    """An environment in which these modules (patterns of their names), and what is below them,
    cannot be imported. folder: where what does that is written."""
    (folder / "sitecustomize.py").write_text(_PROGRAM.format(names=tuple(names)))
    path = os.pathsep.join([str(folder), *filter(None, sys.path)])
    return {**os.environ, "PYTHONPATH": path}
