"""The version of chute_ros that runs here."""

from __future__ import annotations

import functools
import hashlib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import chute_ros

#: Hexadecimal digits that are told.
_DIGITS = 12


@functools.cache
def own_version() -> str:
    """As in package.xml, and a hash of the package's Python files: 0.1.0+0123456789ab. Two commits
    of one number differ in it, and an installed package has no other sign of its commit."""
    try:
        number = version("chute_ros")
    except PackageNotFoundError:
        number = "not-installed"
    return f"{number}+{hash_of(Path(chute_ros.__file__).parent)}"


def hash_of(package: Path) -> str:
    """Of the names and contents of its Python files, the same wherever it is installed."""
    total = hashlib.sha256()
    files = {one.relative_to(package).as_posix(): one for one in package.rglob("*.py")}
    for name, file in sorted(files.items()):
        total.update(name.encode() + hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()[:_DIGITS]
