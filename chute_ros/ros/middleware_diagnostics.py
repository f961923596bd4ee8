"""/diagnostics of what a node runs on: its version, its middleware, can one packet end it?"""

from __future__ import annotations

import resource
from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from chute_ros.ros.middleware import CURED, fast_dds, is_cured, is_local
from chute_ros.ros.own_version import own_version

#: The names of the task, and of its value that is the node's version.
TASK, VERSION = "middleware", "chute_ros"


def middleware_task(node: str) -> DiagnosticStatus:
    """For diagnostics. It stays the same for as long as the process lives."""
    version, local = fast_dds(), is_local()
    cured = ", ".join(map(_text, CURED))
    values = {
        VERSION: own_version(),
        "kept to this host": local,
        "memory limit (MB)": _limit(),
    }
    if version is None:
        return _status(node, DiagnosticStatus.OK, "no Fast DDS", values)
    values |= {"Fast DDS": _text(version), "published holes are fixed in": cured}
    name = f"Fast DDS {_text(version)}"
    if is_cured(version):
        return _status(node, DiagnosticStatus.OK, name, values)
    if local:
        return _status(node, DiagnosticStatus.OK, f"{name}, kept to this host", values)
    text = (
        f"{name}: one packet from anybody on the network can end this process (fixed in "
        f"{cured}): set ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST if no other computer "
        "must receive this node (docs/guide/security.md)"
    )
    return _status(node, DiagnosticStatus.WARN, text, values)


def _status(
    node: str, level: bytes, message: str, values: Mapping[str, object]
) -> DiagnosticStatus:
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return DiagnosticStatus(level=level, name=f"{node}: {TASK}", message=message, values=pairs)


def _limit() -> str:
    soft, _ = resource.getrlimit(resource.RLIMIT_DATA)
    return "none" if soft == resource.RLIM_INFINITY else str(soft >> 20)


def _text(version: tuple[int, int, int]) -> str:
    return ".".join(map(str, version))
