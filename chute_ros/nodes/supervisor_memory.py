"""Keeps the supervisor's state in a file while a flight lasts, for one that starts again in it."""

from __future__ import annotations

import hashlib
import json
import os
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from chute_ros.errors import RecordError
from chute_ros.nodes import diagnostics
from chute_ros.nodes.parameters import Parameter
from chute_ros.nodes.ros_home import ros_home
from chute_ros.supervisor.config import SupervisorConfig
from chute_ros.supervisor.record import CODEC
from chute_ros.supervisor.resume import Left, resumed, worth_leaving, written
from chute_ros.supervisor.state import State

MEMORY_PARAMETERS = (
    Parameter(
        "resume_within",
        30.0,
        "a supervisor that starts again in flight goes on where it stopped, if that was no longer "
        "ago, s, 0: never",
        0.0,
        600.0,
    ),
)
#: Changes with each start of the computer, with which the monotonic clock begins anew.
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


class Memory:
    """A thread writes: a slow disk must not be in the decision loop's way."""

    def __init__(self, node: Node, values: Mapping[str, Any], config: SupervisorConfig) -> None:
        self._within = values["resume_within"]
        self._log, name = node.get_logger(), node.get_fully_qualified_name().lstrip("/")
        self._path = ros_home() / "resume" / f"{name.replace('/', '.')}.json"
        told = json.dumps(dict(values), sort_keys=True) + CODEC.to_json(config, whole=True)
        self._settings = hashlib.sha256(told.encode()).hexdigest()
        self._boot = _BOOT_ID.read_text().strip() if self._within else ""
        self._trouble = ""
        self._times = 0
        self._newest: State | None = None
        self._waiting = False
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._write_all, name="memory", daemon=True)
        if self._within:
            self._thread.start()

    def recall(self) -> State | None:
        """The state to go on with, once: should it be what stops us, the next starts anew."""
        try:
            text = self._path.read_text() if self._within else ""
            self._path.unlink(missing_ok=True)
        except (OSError, ValueError):
            return None
        try:
            state = (
                resumed(text, self._boot, self._settings, self._within, time.monotonic())
                if text
                else None
            )
        except RecordError as error:
            self._log.warning(f"starts anew, {self._path} is of no use: {error}")
            return None
        if state is not None:
            self._log.warning(f"goes on where it stopped in flight: {state.stage.name}")
        return state

    def keep(self, state: State) -> None:
        """The newest state."""
        if self._within:
            with self._changed:
                self._newest, self._waiting = state, True
                self._changed.notify()

    def task(self, name: str) -> DiagnosticStatus:
        """For diagnostics."""
        level, text = diagnostics.OK, "kept while a flight lasts" if self._within else "off"
        if self._trouble:
            level, text = diagnostics.WARN, self._trouble
        values = {"file": str(self._path), "times written": self._times}
        return diagnostics.status(name, "memory", level, text, values, "")

    def close(self) -> None:
        """Write what waits."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._within:
            self._thread.join(timeout=2.0)

    def _write_all(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._closed)
                state, self._waiting = self._newest if self._waiting else None, False
            if state is None:
                return
            try:
                self._write(state)
                self._trouble = ""
            except OSError as error:
                self._trouble = f"a start anew in flight would forget it: {error}"

    def _write(self, state: State) -> None:
        if not worth_leaving(state):
            self._path.unlink(missing_ok=True)
            return
        text = written(Left(self._boot, self._settings, state))
        self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        new = self._path.with_suffix(".new")
        # Not flushed to the disk: after a power cut the monotonic time is another anyway.
        with open(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w") as file:
            file.write(text)
        new.replace(self._path)
        self._times += 1
