"""Signing of a MAVLink link, with the times that must outlive a restart in a file.

Without them a frame that was recorded before a restart would be believed after it, and a computer
whose clock was set back would sign with times that its devices refuse.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from chute_ros.protocol.mavlink.signing import LAST_TIME, Signer, Times, Verifier, times_of
from chute_ros.ros import diagnostics
from chute_ros.ros.kept_file import KeptFile
from chute_ros.ros.private_files import read_own_text
from chute_ros.ros.ros_home import ros_home
from chute_ros.transport.signing_key import signing_from_file

#: Between two writes, s: so old a frame may be that is replayed into a node after it crashed.
INTERVAL = 1.0


class SigningMemory:
    """Signer and verifier for the node's key file, or neither; SigningKeyError if it cannot be
    used."""

    def __init__(self, node: Node, values: Mapping[str, Any]) -> None:
        self.signer: Signer | None = None
        self.verifier: Verifier | None = None
        self._link_id = values["signing_link_id"]
        self._file: KeptFile[Times] | None = None
        self._due = 0.0
        if not values["signing_key_file"]:
            return
        name = node.get_fully_qualified_name().lstrip("/").replace("/", ".")
        path = ros_home() / "signing" / f"{name}.json"
        before = Times()
        try:
            before = times_from(read_own_text(path))
        except FileNotFoundError:
            pass  # the first start
        except (OSError, ValueError) as error:
            node.get_logger().warning(
                f"ignoring {path} ({error}): frames recorded in the last minute may "
                "be replayed to this node until its devices are received"
            )
        self.signer, self.verifier = signing_from_file(
            values["signing_key_file"], self._link_id, "parameter signing_key_file", before
        )
        self._file = KeptFile(path, text_of, "signing times")

    def keep(self, now: float) -> None:
        """In the link's turn, often: the times as they are now."""
        if now >= self._due:
            self._due = now + INTERVAL
            self._keep()

    def finish(self) -> None:
        """Once that thread has ended."""
        self._keep()
        if self._file is not None:
            self._file.close()

    def task(self, name: str) -> DiagnosticStatus:
        """For diagnostics."""
        if self._file is None:
            text = "off: anybody on this wire can imitate the parachute or the autopilot"
            return diagnostics.status(name, "signing", diagnostics.OK, text, {}, "")
        level = diagnostics.OK
        text = "on: every frame sent is signed, every unsigned frame received is dropped"
        if self._file.trouble:
            level = diagnostics.WARN
            text = f"on; its times cannot be saved for a restart: {self._file.trouble}"
        values = {
            "link id": self._link_id,
            "times are saved in": str(self._file.path),
            "times written": self._file.times_written,
        }
        return diagnostics.status(name, "signing", level, text, values, "")

    def _keep(self) -> None:
        if self._file is not None and self.signer is not None and self.verifier is not None:
            self._file.keep(times_of(self.signer, self.verifier))


def text_of(times: Times) -> str:
    """As JSON."""
    streams = {"/".join(map(str, stream)): time for stream, time in sorted(times.streams.items())}
    return json.dumps({"newest": times.newest, "streams": streams}, indent=1) + "\n"


def times_from(text: str) -> Times:
    """The same back; ValueError if it is not that."""
    try:
        told = json.loads(text)
        newest, streams = told["newest"], told["streams"]
        times = Times(newest, {_stream(name): time for name, time in streams.items()})
        if all(
            type(time) is int and 0 <= time <= LAST_TIME for time in (newest, *streams.values())
        ):
            return times
    except (AttributeError, LookupError, TypeError, ValueError, RecursionError):
        pass  # said below
    raise ValueError("it holds no signing times")


def _stream(name: str) -> tuple[int, int, int]:
    system_id, component_id, link_id = map(int, name.split("/"))
    return system_id, component_id, link_id
