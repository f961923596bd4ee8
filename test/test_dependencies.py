"""package.xml, setup.py and requirements name what is imported, and nothing else."""

from __future__ import annotations

import ast
import functools
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: Module -> what package.xml, or requirements/*.in where rosdep has no key, calls it.
NAMES = {
    "serial": "python3-serial",
    "yaml": "python3-yaml",
    "orjson": "python3-orjson",
    "rich": "python3-rich",
    "can": "python-can",
}
#: Imported only where a parameter asks for it, with what to install (ros/vehicle_sources.py).
OPTIONAL = {"mavros_msgs"}
#: Comes with rclpy and its interfaces; the last with nicegui, which is built on it.
COMES_ALONG = {
    "builtin_interfaces", "rcl_interfaces", "rosidl_runtime_py", "rosidl_pycommon", "starlette",
}  # fmt: skip
#: Imported by python-can, and by the dialect that chute_msgs generates.
NOT_IMPORTED = {"msgpack", "pymavlink"}


@functools.cache
def imported() -> frozenset[str]:
    """Top-level modules that the package and its launch files import, without ours."""
    found: set[str] = set()
    for path in (*ROOT.glob("chute_ros/**/*.py"), *ROOT.glob("launch/*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                found.add(node.module.partition(".")[0])
    return frozenset(found - sys.stdlib_module_names - {"chute_ros"})


def in_package_xml() -> set[str]:
    root = ET.parse(ROOT / "package.xml").getroot()
    return {str(one.text) for kind in ("depend", "exec_depend") for one in root.iter(kind)}


def in_requirements() -> set[str]:
    files = [ROOT / f"requirements/{name}.in" for name in ("runtime", "extra")]
    lines = [line for file in files for line in file.read_text().splitlines()]
    named = [line.split("#")[0].strip() for line in lines]
    return {line.split("=")[0].rstrip(">=<") for line in named if line}


def test_what_is_imported_is_named() -> None:
    needed = {NAMES.get(one, one) for one in imported() - OPTIONAL - COMES_ALONG}
    assert sorted(needed - in_package_xml() - in_requirements()) == []


def test_what_is_named_is_imported() -> None:
    used = {NAMES.get(one, one) for one in imported()}
    assert sorted(in_package_xml() - used) == []
    # Those with a rosdep key are named twice: for machines without ROS as well.
    twice = {
        "pyserial": "python3-serial",
        "PyYAML": "python3-yaml",
        "orjson": "python3-orjson",
        "rich": "python3-rich",
    }
    told = {twice.get(one, one) for one in in_requirements()} - NOT_IMPORTED
    assert sorted(told - used) == []


def test_both_have_one_version_and_license() -> None:
    root = ET.parse(ROOT / "package.xml").getroot()
    calls = ast.walk(ast.parse((ROOT / "setup.py").read_text()))
    setup = next(
        one for one in calls if isinstance(one, ast.Call) and ast.unparse(one.func) == "setup"
    )
    told = {one.arg: one.value for one in setup.keywords}
    for name in ("version", "license"):
        value = told[name]
        assert isinstance(value, ast.Constant)
        assert value.value == root.findtext(name)
