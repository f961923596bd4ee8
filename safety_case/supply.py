"""The page of what is installed: packages, licences, known vulnerabilities; and the bill of
materials (CycloneDX) for machines."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from chute_ros.ros.own_version import own_version
from safety_case.documents import FOLDER, TOOLS, list_table, plain, write_made

_COPYLEFT = re.compile(r"\b(?:A|L)?GPL|MPL|EPL", re.IGNORECASE)
_INTRODUCTION = f"""
This product is chute_ros {own_version()}: its number, and a hash of its Python files. Its nodes
tell the same in their diagnostics; each test card and each report of the conformance kit has it.

The packages of the environment that ``make`` sets up, as they are installed. All of it, for
machines: ``sbom.cdx.json`` beside these pages (CycloneDX).
"""
#: An index that does not answer in this time is told as not asked, s.
_PATIENCE = 120.0
#: What a reason of the index says of one package alone.
_OF_PACKAGE = re.compile(r": \S+ \([^)]*\)$")


def write(out: Path) -> None:
    """The page, and sbom.cdx.json in out."""
    target = out / "sbom.cdx.json"
    command = [str(TOOLS / "cyclonedx-py"), "environment", sys.executable, "-o", str(target)]
    subprocess.run(command, check=True, capture_output=True)
    components = json.loads(target.read_text(encoding="utf-8"))["components"]
    packages = [(one["name"], one["version"], plain(_licence(one))) for one in components]
    kept = yaml.safe_load((FOLDER / "supply.yaml").read_text(encoding="utf-8"))
    parts = [
        ("", _INTRODUCTION),
        ("Licences that ask for something", _copyleft(packages, kept["copyleft"])),
        ("Known vulnerabilities", _vulnerabilities(kept)),
        ("All packages", _every(packages)),
    ]
    write_made("supply", "Supply", parts)


def _licence(component: Mapping[str, Any]) -> str:
    """As the package says; a ROS package says it in its package.xml."""
    told = [
        one.get("expression") or one["license"].get("id") or one["license"].get("name", "")
        for one in component.get("licenses", ())
    ]
    short = [one for one in dict.fromkeys(told) if len(one) < 60]
    return ", ".join(short) or _of_ros(component["name"]) or "not said"


def _of_ros(name: str) -> str:
    share = (
        Path(sys.prefix)
        / "share"
        / re.sub(r"^ros-(?:jazzy-|kilted-)?", "", name).replace("-", "_")
    )
    try:
        root = ElementTree.parse(share / "package.xml").getroot()
    except (OSError, ElementTree.ParseError):
        return ""
    return ", ".join(str(one.text) for one in root.iter("license"))


def _copyleft(packages: Sequence[tuple[str, ...]], kept: Mapping[str, Any]) -> str:
    rows = [
        (
            f"{name} {version}",
            licence,
            kept["packages"].get(name, "**nobody has looked at it yet**"),
        )
        for name, version, licence in packages
        if _COPYLEFT.search(licence) or name in kept["packages"]
    ]
    table = list_table(("package", "licence", "where it is used"), rows, (24, 28, 48))
    return f"{kept['text'].strip()}\n\n{table}"


def _vulnerabilities(kept: Mapping[str, Any]) -> str:
    rows = [
        (one["identifier"], one["package"], one["what"], one["fixed"], one["here"])
        for one in kept["vulnerabilities"]
    ]
    head = ("identifier", "package", "what is wrong", "fixed in", "what is done here")
    table = list_table(head, rows, (16, 14, 28, 14, 28))
    return f"{kept['read'].strip()}\n\n{table}\n\n**The index, asked now.** {_index()}"


def _index() -> str:
    """What the public index knows of these packages at this moment, in a sentence."""
    command = [str(TOOLS / "pip-audit"), "--format=json", "--progress-spinner=off", "--timeout=10"]
    paths = [one for one in sys.path if one.endswith("-packages")]
    for path in paths:
        command += ["--path", path]
    try:
        ended = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=_PATIENCE
        )
        answer = json.loads(ended.stdout)
    except subprocess.TimeoutExpired:
        return f"It could not be asked: no answer within {_PATIENCE:g} s."
    except json.JSONDecodeError:
        why = (ended.stderr.strip().splitlines() or ["no answer"])[-1]
        return f"It could not be asked: {plain(why[:200])}"
    found = [
        f"{one['name']} {one['version']}: {', '.join(each['id'] for each in one['vulns'])}"
        for one in answer["dependencies"]
        if one.get("vulns")
    ]
    asked = sum("vulns" in one for one in answer["dependencies"])
    if not asked:
        # A package of ROS, which no index has, says so of itself alone.
        reasons = Counter(
            _OF_PACKAGE.sub("", one["skip_reason"]) for one in answer["dependencies"]
        )
        why = reasons.most_common(1)[0][0] if reasons else "it names no package"
        return f"It could not be asked: {plain(why[:200])}."
    told = "; ".join(found) or "none is known to be vulnerable"
    return f"{asked} packages were asked about; {told}."


def _every(packages: Sequence[tuple[str, ...]]) -> str:
    return list_table(("package", "version", "licence"), sorted(packages), (40, 20, 40))
