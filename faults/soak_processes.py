"""Child processes that live on: started again when they end, read as they write, measured."""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bench.process_cost import resident_memory
from chute_ros.tools.processes import END_TIMEOUT
from faults.respawned import RESPAWN_DELAY

#: What no process may ever write.
_TROUBLE = re.compile(
    r"Traceback \(most recent call last\)|terminate called|Segmentation fault|"
    r"double free|corrupted|Fatal Python error|\[FATAL\]|Exception in thread|Exception ignored"
)
_LAST_LINES = 25


@dataclass(frozen=True)
class Sample:
    """What a process holds."""

    memory: float  # MB, resident
    descriptors: int
    threads: int


@dataclass
class Child:
    """One process with its lives."""

    name: str
    command: list[str]
    environment: Mapping[str, str]
    log: Path
    process: subprocess.Popen[bytes]
    #: It is ours that it ends: killed, or not wanted any more.
    ended_by_us: bool = False
    start_at: float = float("nan")
    #: How often it was started.
    life: int = 1
    read_to: int = 0
    #: The unfinished last line of what was read.
    rest: str = ""

    def live_again(self, process: subprocess.Popen[bytes]) -> None:
        """In another process."""
        self.process, self.ended_by_us, self.start_at = process, False, float("nan")
        self.life += 1


@dataclass
class Keeper:
    """Starts modules of ours and keeps them alive. environment: for all of them."""

    folder: Path
    environment: dict[str, str]
    children: dict[str, Child] = field(default_factory=dict)
    #: What must not be: tracebacks, processes that ended by themselves.
    findings: list[str] = field(default_factory=list)
    #: The end of what was written by those that ended by themselves.
    last_words: list[str] = field(default_factory=list)

    def start(
        self, name: str, module: str, *arguments: str, more: Mapping[str, str] | None = None
    ) -> None:
        """Run module as name. more: of its environment."""
        environment = {**os.environ, "PYTHONUNBUFFERED": "1", **self.environment, **(more or {})}
        command = [sys.executable, "-m", module, *arguments]
        log = self.folder / f"{name}.log"
        process = _spawn(command, environment, log)
        known = self.children.get(name)
        if known is None:
            self.children[name] = Child(name, command, environment, log, process)
            return
        known.command, known.environment = command, environment
        known.live_again(process)

    def look(self) -> list[tuple[str, str]]:
        """Start again what has ended long enough ago; the new lines of all: (name, line)."""
        now = time.monotonic()
        for child in self.children.values():
            code = child.process.poll()
            if code is None:
                continue
            if child.start_at != child.start_at:
                child.start_at = now + RESPAWN_DELAY
                if not child.ended_by_us:
                    self.findings.append(f"{child.name} ended by itself with code {code}")
                    self.last_words.append(_last_words(child))
            elif now >= child.start_at:
                child.live_again(_spawn(child.command, child.environment, child.log))
        return [(child.name, line) for child in self.children.values() for line in _new(child)]

    def note_troubles(self, lines: list[tuple[str, str]]) -> None:
        """Keep what no process may write."""
        self.findings += [
            f"{name} wrote {line.strip()!r}" for name, line in lines if _TROUBLE.search(line)
        ]

    def running(self) -> bool:
        """Every one is, and none is stopped."""
        return all(
            child.process.poll() is None and _state(child.process.pid) not in "TZ"
            for child in self.children.values()
        )

    def kill(self, name: str) -> None:
        """kill -9; look starts it again."""
        child = self.children[name]
        child.ended_by_us = True
        child.process.kill()
        child.process.wait(END_TIMEOUT)

    def pid(self, name: str) -> int:
        """Of the life that is now."""
        return self.children[name].process.pid

    def signal(self, name: str, number: signal.Signals) -> None:
        """SIGSTOP and SIGCONT."""
        self.children[name].process.send_signal(number)

    def sample(self, name: str) -> Sample:
        """What it holds now."""
        pid = self.pid(name)
        return Sample(
            resident_memory(pid),
            len(os.listdir(f"/proc/{pid}/fd")),
            len(os.listdir(f"/proc/{pid}/task")),
        )

    def exhaust_descriptors(self, name: str) -> None:
        """From now on it can open nothing more."""
        pid = self.pid(name)
        taken = {int(one) for one in os.listdir(f"/proc/{pid}/fd")}
        free = next(number for number in range(len(taken) + 1) if number not in taken)
        _, most = resource.prlimit(pid, resource.RLIMIT_NOFILE)
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (free, most))

    def restore_descriptors(self, name: str) -> None:
        """As many as it may have."""
        pid = self.pid(name)
        _, most = resource.prlimit(pid, resource.RLIMIT_NOFILE)
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (min(1024, most), most))

    def kill_all(self) -> None:
        """None is left."""
        for name in self.children:
            self.kill(name)

    def end(self, names: Sequence[str]) -> None:
        """SIGINT to these; each must end by itself, and with code 0. The others are killed."""
        for name in self.children.keys() - set(names):
            self.kill(name)
        some = [self.children[name] for name in names]
        for child in some:
            child.ended_by_us = True
            child.process.send_signal(signal.SIGINT)
        for child in some:
            try:
                code = child.process.wait(END_TIMEOUT)
            except subprocess.TimeoutExpired:
                child.process.kill()
                child.process.wait()
                self.findings.append(f"{child.name} did not end within {END_TIMEOUT:g} s")
            else:
                if code:
                    self.findings.append(f"{child.name} ended with code {code} after SIGINT")
        self.note_troubles([(child.name, line) for child in some for line in _new(child)])


def _spawn(
    command: list[str], environment: Mapping[str, str], log: Path
) -> subprocess.Popen[bytes]:
    with log.open("ab") as output:
        return subprocess.Popen(
            command,
            env=dict(environment),
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
        )


def _state(pid: int) -> str:
    """A letter of proc(5)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return "Z"


def _last_words(child: Child) -> str:
    lines = child.log.read_text(errors="replace").splitlines()
    return "\n".join(f"    {child.name}: {line}" for line in lines[-_LAST_LINES:])


def _new(child: Child) -> list[str]:
    """The whole lines that it has written since."""
    with child.log.open("rb") as file:
        file.seek(child.read_to)
        data = file.read()
    child.read_to += len(data)
    *whole, child.rest = (child.rest + data.decode(errors="replace")).split("\n")
    return whole
