"""A link in somebody's own package, installed for a while in a folder."""

import os
import subprocess
import sys

#: Its __init__.py: a vehicle `other` with one node.
OTHERS = """
from dataclasses import replace
from chute_ros.links.api import SUPERVISOR, ConnectionArgument
from chute_ros.links.relay import LINK as RELAY

LINKS = ["rocket_motor"]
NAMED = {"required_links": LINKS, "kill_links": LINKS, "deploy_links": LINKS}
VEHICLE = replace(
    RELAY.vehicles[0],
    name="other",
    links=("rocket_motor",),
    parameters={SUPERVISOR: NAMED},
    replaces="",
)
LINK = replace(
    RELAY,
    name="rocket_motor",
    node="other_link.node:Node",
    argument=ConnectionArgument("motor", "of a rocket"),
    package="other_package",
    stops_motors=True,
    vehicles=(VEHICLE,),
)
"""


def changed(old, new):
    """OTHERS with one thing otherwise."""
    assert old in OTHERS
    return OTHERS.replace(old, new)


def python(code, folder):
    """Run code in a Python of its own, which looks at this folder before all others."""
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *filter(None, sys.path)])},
        capture_output=True,
        text=True,
        check=False,
    )


def other_package(folder, entry="rocket_motor = other_link:LINK", code=OTHERS):
    """Install it in this folder."""
    (folder / "other_link").mkdir()
    (folder / "other_link" / "__init__.py").write_text(code)
    information = folder / "other_package-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: other\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text(f"[chute_ros.links]\n{entry}\n")
