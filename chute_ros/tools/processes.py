"""Child processes with their output in files: started, watched, ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from chute_ros.errors import ChuteError

END_TIMEOUT = 5.0  # s


class ProcessEndedError(ChuteError):
    """A child ended by itself. The text shows the end of what it wrote."""


def ros_arguments(namespace: str, **parameters: object) -> list[str]:
    """The end of a node's command line: where it is, and its parameters, as YAML."""
    given = [part for name, value in parameters.items() for part in ("-p", f"{name}:={value}")]
    return ["--ros-args", "-r", f"__ns:={namespace}", *given]


class Processes:
    """Modules of ours, each in a Python of its own."""

    #: How a log is opened: "ab" goes on where the last of this name ended.
    log_mode = "wb"

    def __init__(self, folder: Path, ros_home: Path | None = None) -> None:
        self._folder = folder
        #: Where the children keep what outlives them: allocation tables, black boxes.
        self.ros_home = ros_home or folder / "ros_home"
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, module: str, *arguments: str, on: Sequence[str] = ()) -> None:
        """Run module as name; what it writes goes to name.log. on: what the command begins with,
        where it is to run elsewhere than here."""
        with self.log(name).open(self.log_mode) as log:
            self._running[name] = subprocess.Popen(
                [*on, sys.executable, "-m", module, *arguments],
                # Buffered, the last words of one that crashes would come before what led to them.
                env={**os.environ, "PYTHONUNBUFFERED": "1", "ROS_HOME": str(self.ros_home)},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def log(self, name: str) -> Path:
        """Where the output of name goes."""
        return self._folder / f"{name}.log"

    def tail(self, name: str, lines: int = 15) -> str:
        """The end of what name wrote."""
        text = self.log(name).read_text(errors="replace").splitlines()
        return "\n".join(f"    {name}: {line}" for line in text[-lines:])

    def check(self) -> None:
        """ProcessEndedError if one is not running any more."""
        for name, process in self._running.items():
            code = process.poll()
            if code is not None:
                raise ProcessEndedError(f"{name} ended with code {code}:\n{self.tail(name)}")

    def names(self) -> list[str]:
        """All that were started."""
        return list(self._running)

    def pid(self, name: str) -> int:
        """Of one of them."""
        return self._running[name].pid

    def send_signal(self, name: str, number: signal.Signals) -> None:
        """To one of them; one that was killed is not watched any more."""
        self._running[name].send_signal(number)
        if number is signal.SIGKILL:
            self._running.pop(name).wait(END_TIMEOUT)

    def end(self) -> None:
        """SIGINT to all, SIGKILL to those that do not end."""
        for process in self._running.values():
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)  # one that is stopped hears nothing else
                process.send_signal(signal.SIGINT)
        for process in self._running.values():
            try:
                process.wait(END_TIMEOUT)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
