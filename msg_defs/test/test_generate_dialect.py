"""The generator of the dialect: what it writes, and what it says when it cannot."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pymavlink
import pytest
from lxml import etree

PACKAGE = Path(__file__).resolve().parents[1]
GENERATOR = PACKAGE / "mavlink" / "generate_dialect.py"
REMEDY = "run: pip install pymavlink==2.4.50 (see requirements/ in the repository root)"


def run(*arguments, python_path=None, script=GENERATOR):
    """Run the generator; return its exit code, its standard output and its errors."""
    # An environment of its own, and -S where pymavlink is to be another or none.
    isolation = [] if python_path is None else ["-S"]
    environment = {"PYTHONPATH": str(python_path)} if python_path else None
    result = subprocess.run(
        [sys.executable, *isolation, script, *arguments],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    return result.returncode, result.stdout, result.stderr


def fake_pymavlink(folder, version):
    """Put a package into folder that looks like pymavlink and can do nothing."""
    generator = folder / "pymavlink" / "generator"
    generator.mkdir(parents=True)
    (folder / "pymavlink" / "__init__.py").write_text(f"__version__ = {version!r}\n")
    for name in ("__init__", "mavgen", "mavparse"):
        (generator / f"{name}.py").touch()


def test_xml_is_valid_mavlink():
    """parachute.xml follows MAVLink's own schema."""
    schema_file = Path(pymavlink.__file__).parent / "generator" / "mavschema.xsd"
    schema = etree.XMLSchema(etree.parse(str(schema_file)))
    schema.assertValid(etree.parse(str(PACKAGE / "mavlink" / "parachute.xml")))


def test_every_enumeration_of_a_new_field_exists(dialect):
    """No field names an enumeration that is not there."""
    for number in (80, 396, 430):
        for enumeration in dialect.mavlink_map[number].fieldenums_by_name.values():
            assert enumeration in dialect.enums


def test_quiet_and_the_same_every_time(dialect_path, tmp_path):
    """Two runs give the same bytes, without a word and without anything beside them."""
    again = tmp_path / "parachute.py"
    assert run(again) == (0, "", "")
    assert again.read_bytes() == dialect_path.read_bytes()
    assert list(tmp_path.iterdir()) == [again]


def test_installed_dialect_is_this_one(dialect_path):
    """What chute_msgs has installed was made from this parachute.xml."""
    if importlib.util.find_spec("chute_msgs") is None:
        pytest.skip("chute_msgs is not built or its workspace is not sourced")
    installed = importlib.util.find_spec("chute_msgs.mavlink.parachute").origin
    assert Path(installed).read_bytes() == dialect_path.read_bytes(), "chute_msgs needs a rebuild"


def test_without_pymavlink(tmp_path):
    """One line that says what to install."""
    code, output, errors = run(tmp_path / "parachute.py", python_path=tmp_path)
    assert (code, output) == (1, "")
    assert errors.count("\n") == 1
    assert "cannot import pymavlink" in errors
    assert REMEDY in errors


@pytest.mark.parametrize(
    ("version", "complaint"),
    [
        ("2.4.49", "pymavlink 2.4.49 is too old"),
        ("2.4.9", "pymavlink 2.4.9 is too old"),
        ("1.1.73", "pymavlink 1.1.73 is too old"),
        ("2.5.0", "pymavlink 2.5.0 has no common.xml"),
    ],
)
def test_unsuitable_pymavlink(tmp_path, version, complaint):
    """One line that says what to install instead."""
    fake_pymavlink(tmp_path, version)
    code, output, errors = run(tmp_path / "parachute.py", python_path=tmp_path)
    assert (code, output) == (1, "")
    assert errors == f"generate_dialect.py: error: {complaint}; {REMEDY}\n"


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        (
            'id="80" name="COMMAND_CANCEL"',
            'id="76" name="COMMAND_CANCEL"',
            "Duplicate message id 76",
        ),
        ('type="char[11]"', 'type="text"', "unknown type 'text'"),
        ("</mavlink>", "", "no element found"),
    ],
)
def test_broken_definition(tmp_path, old, new, complaint):
    """One line that says what is wrong, and no module."""
    definition = (PACKAGE / "mavlink" / "parachute.xml").read_text()
    assert old in definition
    script = tmp_path / "generate_dialect.py"
    script.write_bytes(GENERATOR.read_bytes())
    (tmp_path / "parachute.xml").write_text(definition.replace(old, new))
    code, output, errors = run(tmp_path / "parachute.py", script=script)
    assert (code, output) == (1, "")
    assert errors.count("\n") == 1
    assert complaint in errors
    assert not (tmp_path / "parachute.py").exists()


def test_output_that_cannot_be_written(tmp_path):
    """One line that names the file."""
    output = tmp_path / "missing" / "parachute.py"
    assert run(output) == (
        1,
        "",
        f"generate_dialect.py: error: cannot write {output}: No such file or directory\n",
    )


@pytest.mark.parametrize("arguments", [[], ["a.py", "b.py"], ["--help"]])
def test_usage(arguments):
    """Anything but one output file gets the usage line."""
    assert run(*arguments) == (2, "", "usage: generate_dialect.py OUTPUT.py\n")
