"""What the tests of the wire contracts share."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

GENERATOR = Path(__file__).resolve().parents[1] / "mavlink" / "generate_dialect.py"


@pytest.fixture(scope="session")
def dialect_path(tmp_path_factory):
    """Path of a module made from the parachute.xml that stands beside these tests.

    Made anew, so that the tests never pass on what an older build has installed.
    """
    path = tmp_path_factory.mktemp("dialect") / "parachute.py"
    subprocess.run([sys.executable, GENERATOR, path], check=True)
    return path


@pytest.fixture(scope="session")
def dialect(dialect_path):
    """Return the dialect as an imported module."""
    spec = importlib.util.spec_from_file_location("parachute_dialect", dialect_path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
