"""Keeps the supervisor's state in a file while a flight lasts, for one that starts again in it.

In two others, whatever starts anew: what was released, until a person resets, and what said last
that it is armed.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from chute_ros.errors import RecordError
from chute_ros.ros import diagnostics
from chute_ros.ros.kept_file import KeptFile
from chute_ros.ros.one_of_a_name import NameLock
from chute_ros.ros.private_files import read_own_text
from chute_ros.ros.ros_home import ros_home
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.record import CODEC
from chute_ros.supervisor.resume import (
    SavedState,
    dump,
    dump_parachutes,
    load,
    load_parachutes,
    worth_saving,
)
from chute_ros.supervisor.state import State

#: Changes with each start of the computer, with which the monotonic clock begins anew.
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


class RememberedParachutes:
    """(link, device) of those of which what holds, kept in a file that outlives every start."""

    def __init__(self, folder: str, own: str, node: Node) -> None:
        self.what = f"was {folder}"
        self._file = KeptFile(
            ros_home() / folder / f"{own}.json", dump_parachutes, folder, durable=True
        )
        self.close = self._file.close
        #: Before this start; where that cannot be read, there may be one.
        self.before = frozenset[tuple[str, str]]()
        path = self._file.path
        try:
            self.before = load_parachutes(read_own_text(path))
        except (FileNotFoundError, NotADirectoryError):
            pass  # nothing was ever kept there
        except (OSError, ValueError, RecordError) as error:
            node.get_logger().error(
                f"cannot read what {self.what} before this start: {path}: {error}"
            )
            self.before = frozenset({("a parachute that is not known", f"({path} is damaged)")})
        self._newest = self.before

    @property
    def trouble(self) -> str:
        """Why the newest is not kept; empty: it is."""
        return self._file.trouble

    def keep(self, those: frozenset[tuple[str, str]]) -> None:
        """The newest."""
        if those != self._newest:
            self._newest = those
            self._file.keep(those)


class SupervisorMemory:
    """In a file of the node's own, where resume_within says that it may be needed.

    NameTakenError if a living supervisor of this name is on this computer, whose file it would be.
    """

    def __init__(self, node: Node, values: Mapping[str, Any], config: SupervisorConfig) -> None:
        self._within = values["resume_within"]
        self._log, name = node.get_logger(), node.get_fully_qualified_name().lstrip("/")
        # Another ROS domain is another vehicle.
        own = f"{name.replace('/', '.')}@{node.context.get_domain_id()}"
        folder = ros_home() / "resume"
        self._path = folder / f"{own}.json"
        self._lock = NameLock(folder / f"{own}.lock", name)
        if self._lock.trouble:
            self._log.warning(f"this name is not locked: {self._lock.trouble}")
        told = json.dumps(dict(values), sort_keys=True) + CODEC.to_json(config, whole=True)
        self._settings = hashlib.sha256(told.encode()).hexdigest()
        self._boot = _BOOT_ID.read_text().strip() if self._within else ""
        self._file = KeptFile(self._path, self._text, "memory") if self._within else None
        self.released = RememberedParachutes("released", own, node)
        self.armed = RememberedParachutes("armed", own, node)

    def recall(self) -> State | None:
        """The saved state, read once: a state that ends this process does not end the next."""
        try:
            text = read_own_text(self._path) if self._within else ""
            self._path.unlink(missing_ok=True)
            state = (
                load(text, self._boot, self._settings, self._within, time.monotonic())
                if text
                else None
            )
        except FileNotFoundError:
            return None
        except (OSError, ValueError, RecordError) as error:
            self._log.warning(f"ignoring the saved state {self._path}: {error}; starting fresh")
            return None
        if state is not None:
            self._log.warning(f"continuing the interrupted flight: {state.stage.name}")
        return state

    def keep(self, state: State) -> None:
        """The newest state."""
        self.released.keep(state.released_since_reset)
        self.armed.keep(state.last_armed)
        if self._file is not None:
            self._file.keep(state)

    def task(self, name: str) -> DiagnosticStatus:
        """For diagnostics."""
        level, text = diagnostics.OK, "off"
        if self._file is not None:
            text = "saved during a flight"
            if self._file.trouble:
                level = diagnostics.WARN
                text = f"a restart in flight would lose it: {self._file.trouble}"
        for those in (self.armed, self.released):
            if those.trouble:
                level = diagnostics.WARN
                text = f"a restart would forget what {those.what}: {those.trouble}"
        written_times = 0 if self._file is None else self._file.times_written
        values = {"file": str(self._path), "times written": written_times}
        return diagnostics.status(name, "memory", level, text, values, "")

    def close(self) -> None:
        """Write what waits, then the name is free."""
        if self._file is not None:
            self._file.close()
        self.released.close()
        self.armed.close()
        self._lock.close()

    def _text(self, state: State) -> str:
        return dump(SavedState(self._boot, self._settings, state)) if worth_saving(state) else ""
