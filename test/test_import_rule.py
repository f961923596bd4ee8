"""Rules of the source code hold, and they bite: what the pure packages import, what reads files,
that a class name occurs once."""

import ast
import shutil
import subprocess
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def copy(tmp_path):
    """A copy of the package and the rule, free to be broken."""
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "chute_ros", tmp_path / "chute_ros", ignore=ignore)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def lint(folder):
    return subprocess.run(
        ["lint-imports", "--no-cache"], cwd=folder, capture_output=True, text=True, check=False
    )


def test_the_rule_holds(copy):
    result = lint(copy)
    assert result.returncode == 0, result.stdout
    assert "0 broken" in result.stdout


#: Package, what a module of it says, and what is named of that.
OFFENDERS = [
    ("protocol", "import socket", "socket"),
    ("protocol", "from time import monotonic", "time"),
    ("protocol", "import os.path", "os"),
    ("protocol", "def late():\n    import rclpy.node", "rclpy"),
    ("supervisor", "from threading import Lock", "threading"),
    ("supervisor", "import serial", "serial"),
    ("runtime", "import threading", "threading"),
    ("runtime", "from chute_ros.transport import offender", "chute_ros.transport"),
    ("links.upf.protocol", "import rclpy", "rclpy"),
    ("links.mavlink.protocol", "from time import monotonic", "time"),
    ("links.upf.protocol", "from chute_ros.links import mavlink", "chute_ros.links.mavlink"),
    ("campaign", "from chute_ros.supervisor.core import update", "chute_ros.supervisor.core"),
    ("protocol", "from chute_ros.ros import offender", "chute_ros.ros"),
    ("supervisor", "from chute_ros.transport import offender", "chute_ros.transport"),
    ("sim", "from chute_ros.ros import offender", "chute_ros.ros"),
    ("links.relay.protocol", "from chute_ros.supervisor import core", "chute_ros.supervisor.core"),
    ("links.relay.protocol", "from chute_ros.runtime import device", "chute_ros.runtime.device"),
    ("links.upf.simulator", "from chute_ros.campaign import world", "chute_ros.campaign.world"),
    ("links.upf.conformance", "from chute_ros.sim import lies", "chute_ros.sim.lies"),
]
#: Module that is there -> what it must not know: the shared types nothing of ours, what all use no
#: I/O, a part of a link what its row of docs/design/links.md forbids.
OFFENDING_MODULES = {
    "model": "chute_ros.errors",
    "errors": "subprocess",
    "links.upf.runtime": "chute_ros.transport.offender",
    "links.upf.node": "chute_ros.campaign.world",
    "links.upf.diagnostics": "chute_ros.sim.lies",
    "links.upf.virtual": "chute_ros.tools.arguments",
}


def test_the_rule_names_each_offender(copy):
    for layer in ("ros", "transport"):
        (copy / "chute_ros" / layer / "offender.py").touch()
    for number, (package, line, _) in enumerate(OFFENDERS):
        file = copy / "chute_ros" / package.replace(".", "/") / f"offending_{number}.py"
        file.write_text(line + "\n")
    for module, named in OFFENDING_MODULES.items():
        with (copy / "chute_ros" / f"{module.replace('.', '/')}.py").open("a") as file:
            file.write(f"\nimport {named}\n")
    result = lint(copy)
    assert result.returncode == 1
    for number, (package, _, named) in enumerate(OFFENDERS):
        assert f"chute_ros.{package}.offending_{number} -> {named}" in result.stdout
    for module, named in OFFENDING_MODULES.items():
        assert f"chute_ros.{module} -> {named}" in result.stdout


#: Files of the repository and of the system, which no person names.
OWN = {
    "tools/parameter_docs.py", "tools/pages.py", "tools/machine.py", "tools/explore_steps.py",
    "tools/simulation.py", "tools/processes.py", "tools/streams.py", "tools/chute/doctor_ports.py",
    "tools/panel/server.py",
}  # fmt: skip


def bare_reads(text):
    """The lines that open or read a file themselves: of a FIFO they would wait for ever."""
    found = []
    for call in (one for one in ast.walk(ast.parse(text)) if isinstance(one, ast.Call)):
        words = [one.value for one in call.args if isinstance(one, ast.Constant)]
        words += [one.value.value for one in call.keywords if isinstance(one.value, ast.Constant)]
        name = call.func.attr if isinstance(call.func, ast.Attribute) else ""
        of_path = name == "open" and not ast.unparse(call.func).endswith(("os.open", "wire.open"))
        is_open = of_path or (isinstance(call.func, ast.Name) and call.func.id == "open")
        if name in ("read_text", "read_bytes") or (is_open and not {"wb", "ab", "w"} & {*words}):
            found.append(call.lineno)
    return found


def test_what_a_person_names_is_read_by_regular_file_alone():
    """transport/regular_file.py refuses a FIFO, a device and a folder in words."""
    package = ROOT / "chute_ros"
    files = {
        str(path.relative_to(package)): path
        for folder in ("tools", "campaign")
        for path in (package / folder).rglob("*.py")
    }
    assert files.keys() >= OWN
    found = {name: bare_reads(path.read_text()) for name, path in files.items()}
    assert {name: lines for name, lines in found.items() if lines and name not in OWN} == {}


@pytest.mark.parametrize(
    "line", ["path.read_text()", "path.read_bytes()", "path.open('rb')", "open(path)"]
)
def test_and_finds_one_that_reads_by_itself(line):
    assert bare_reads(f"text = {line}") == [1]


def repeated(folder):
    """Class name -> where it stands, of those that stand in several places; a private name may
    stand once in each package."""
    places = defaultdict(list)
    for path in sorted(folder.rglob("*.py")):
        for one in ast.parse(path.read_text()).body:
            if isinstance(one, ast.ClassDef):
                package = str(path.parent) if one.name.startswith("_") else ""
                place = f"{path.relative_to(folder)}:{one.lineno}"
                places[package, one.name].append(place)
    return {name: found for (_, name), found in places.items() if len(found) > 1}


def test_a_class_name_occurs_once():
    assert repeated(ROOT / "chute_ros") == {}


def test_and_one_that_occurs_again_is_named_with_both_places(tmp_path):
    (tmp_path / "protocol").mkdir()
    (tmp_path / "tools").mkdir()
    (tmp_path / "protocol" / "a.py").write_text("class Report: ...\nclass _Kept: ...\n")
    (tmp_path / "tools" / "b.py").write_text("class _Kept: ...\n\n\nclass Report: ...\n")
    assert repeated(tmp_path) == {"Report": ["protocol/a.py:1", "tools/b.py:4"]}
    (tmp_path / "tools" / "c.py").write_text("class _Kept: ...\n")
    assert repeated(tmp_path)["_Kept"] == ["tools/b.py:1", "tools/c.py:1"]
